"""Offsets from taps: known ones are found again in the twin's sound, force and motion."""

from functools import cache

import numpy as np
import pytest
from studies.taps import RATE, Tapped, tapped

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.physics.sensors import load_sensor
from monochord.sessions.sync.onsets import first_onset, novelty, surprise
from monochord.sessions.sync.pulses import Taps, taps_of_force
from monochord.sessions.sync.taps import Offset, audio_offset, height_offset, offset_of, travel_time

STRING = load_sensor("prototype").string
TRAVEL = travel_time(STRING.length, (STRING.tension / STRING.linear_density) ** 0.5)


@cache
def played(seed: int, force: float, taps: int = 5, *, driven: bool = False) -> Tapped:
    place = float(np.random.default_rng(seed).uniform(0.05, 0.15))
    return tapped(
        groups=(1.5,),
        taps=taps,
        seconds=5.5,
        force=force,
        position=place,
        seed=seed,
        drivers=(driven, driven),
    )


def measured(
    truth: Tapped, seed: int, *, force_rate: float, pose_rate: float, noise: float = 0.0
) -> tuple[Offset, float, Offset, float]:
    """Return the offsets of audio and pose against force, each with the true one."""
    rng = np.random.default_rng(1000 + seed)
    late = dict(zip(("audio", "force", "pose"), rng.uniform(-0.3, 0.3, 3).tolist(), strict=True))
    time = np.arange(rng.random() / force_rate, truth.seconds, 1.0 / force_rate)
    time = time[rng.random(time.size) > 0.005]
    force = np.interp(time, np.arange(truth.force.size) / RATE, truth.force)
    force += 0.01 * rng.standard_normal(time.size)
    taps = taps_of_force(time + late["force"], force)
    there = np.arange(rng.random() / pose_rate, truth.seconds, 1.0 / pose_rate)
    there = there[rng.random(there.size) > 0.005]
    height = truth.height(there) + 5e-5 * rng.standard_normal(there.size)
    hiss = noise * rng.standard_normal(truth.microphones.shape)
    sound = (truth.microphones + hiss).astype(np.float32)
    sound_offset = audio_offset(taps, sound, first=late["audio"], rate=float(RATE), travel=TRAVEL)
    seen = height_offset(taps, there + late["pose"], height)
    return sound_offset, late["audio"] - late["force"], seen, late["pose"] - late["force"]


def check(cases: int) -> None:
    """Audio within 0.5 ms, pose within its sampling interval; uncertainties not too small nor too large."""
    audio, pose, stds = np.empty(cases), np.empty(cases), np.empty(cases)
    for case in range(cases):
        truth = played(case % 6, (0.3, 1.0, 2.0)[case % 3])
        force_rate, pose_rate = (7000.0, 1000.0)[case % 2], (100.0, 250.0, 500.0)[case % 3]
        noise = (0.0, 0.002, 0.01)[case % 5 % 3]
        sound_offset, late, seen, behind = measured(
            truth, case, force_rate=force_rate, pose_rate=pose_rate, noise=noise
        )
        assert sound_offset.is_determined
        assert seen.is_determined
        audio[case], stds[case] = sound_offset.value - late, sound_offset.std
        pose[case] = (seen.value - behind) * pose_rate
        assert abs(seen.value - behind) < 3.0 * seen.std
    sure, scores = stds < 0.5e-3, np.abs(audio) / stds
    off, out = 1e3 * np.abs(audio[sure]), np.abs(pose)
    assert sure.mean() > 0.97
    assert off.max() < 0.5
    assert out.max() < 1.0
    assert 0.3 < np.sqrt(np.mean(scores**2)) < 1.3
    assert scores.max() < 4.0


def test_known_offsets_are_recovered() -> None:
    check(9)


@pytest.mark.slow
def test_known_offsets_are_recovered_in_many_cases() -> None:
    check(180)


def test_a_driven_string_does_not_drown_its_taps() -> None:
    truth = played(1, 1.0, driven=True)
    sound_offset, late, _, _ = measured(truth, 1, force_rate=7000.0, pose_rate=250.0)
    assert sound_offset.value == pytest.approx(late, abs=0.5e-3)


@pytest.mark.parametrize("dead", [0, 1])
def test_a_dead_microphone_does_not_spoil_the_other_ones_taps(dead: int) -> None:
    for seed in (0, 26, 34, 51):  # of the last three, noise of the dead one agrees by chance
        rng = np.random.default_rng(seed)
        begin, late = np.array([0.7, 1.0, 1.7]), 0.05
        sound = 1e-3 * rng.standard_normal((2, 3 * 44100))
        for place in np.rint((begin + late) * 44100).astype(int):
            sound[1 - dead, place : place + 200] += 0.1
        taps = Taps(begin=begin, end=begin + 0.006, spacing=1 / 7000)
        offset = audio_offset(taps, sound.astype(np.float32), first=0.0, rate=44100.0)
        assert offset.is_determined
        assert offset.value == pytest.approx(late, abs=0.2e-3)
        assert offset.std < 0.5e-3


def test_one_tap_gives_an_offset_that_is_not_trusted() -> None:
    sound_offset, late, seen, _ = measured(played(1, 1.0, taps=1), 1, force_rate=7000.0, pose_rate=250.0)
    assert sound_offset.value == pytest.approx(late, abs=1e-3)
    assert sound_offset.taps == seen.taps == 1
    assert sound_offset.std > 1e-3


def test_even_spacing_leaves_the_offset_open() -> None:
    time = np.arange(0.0, 8.0, 0.004)
    at = 2.0 + 0.4 * np.arange(10, dtype=np.float64)
    height = np.minimum(0.2 * np.abs(time[:, None] - at).min(axis=1), 3e-3)
    even = Taps(begin=at - 0.003, end=at + 0.003, spacing=1e-3)
    assert height_offset(even, time, height).rival > 0.8
    assert not height_offset(even, time, height).is_determined


def test_without_taps_or_sound_nothing_is_known() -> None:
    none = Taps(begin=np.zeros(0), end=np.zeros(0), spacing=1e-3)
    some = Taps(begin=np.array([1.0, 1.5]), end=np.array([1.1, 1.6]), spacing=1e-3)
    silence = np.zeros((2, 3 * RATE), np.float32)
    time = np.arange(0.0, 3.0, 0.01)
    for result in (
        audio_offset(none, silence, first=0.0, rate=44100.0),
        audio_offset(some, silence, first=0.0, rate=44100.0),
        audio_offset(some, silence[:, :10], first=0.0, rate=44100.0),
        height_offset(none, time, np.zeros(time.size)),
        height_offset(some, time, np.zeros(time.size)),
    ):
        assert not result.is_determined


def test_noise_alone_is_not_taken_for_taps() -> None:
    taken = 0
    begin: Floats
    for seed in range(6):
        rng = np.random.default_rng(seed)
        begin = np.sort(rng.uniform(1.5, 4.0, 5))
        taps = Taps(begin=begin, end=begin, spacing=1e-3)
        sound = rng.standard_normal((2, 6 * RATE)).astype(np.float32)
        result = audio_offset(taps, sound, first=0.0, rate=44100.0)
        taken += result.is_determined and result.std < 0.5e-3 and result.taps >= 3
    assert taken == 0


def test_an_outlier_is_left_out_and_scatter_makes_uncertain() -> None:
    rng = np.random.default_rng(0)
    result = offset_of(np.array([0.1001, 0.0999, np.nan, 0.1002, 0.4]), spacing=1e-4)
    assert result.taps == 3
    assert result.value == pytest.approx(0.1, abs=2e-4)
    assert np.isnan(result.each[[2, 4]]).all()
    scores = [
        (offset := offset_of(1e-3 * rng.standard_normal(5), spacing=1e-4)).value / offset.std
        for _ in range(500)
    ]
    assert 0.88 < np.mean(np.abs(scores) < 2.0) < 0.98


def test_what_does_not_fit_is_refused() -> None:
    taps = Taps(begin=np.ones(1), end=np.ones(1), spacing=1e-3)
    with pytest.raises(InputError):
        audio_offset(taps, np.zeros((2, 99), np.float32), first=0.0, rate=44100.0, travel=(0.0,))
    with pytest.raises(InputError):
        height_offset(taps, np.zeros(3), np.zeros(2))


def ringing(seed: int, frames: int = 22050) -> Floats:
    """Two channels of ten decaying partials, with a converter's noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(frames) / RATE
    partials = rng.uniform(200.0, 9000.0, (2, 10, 1))
    sound = (0.05 * np.sin(2.0 * np.pi * partials * time + rng.uniform(0.0, 6.3, partials.shape))).sum(axis=1)
    return sound + 3e-5 * rng.standard_normal(sound.shape)


def test_a_step_under_a_ringing_string_is_located_to_the_sample_however_loud() -> None:
    for seed in range(2):
        sound = ringing(seed)
        sound[:, 12000:] += 0.03
        errors = surprise(sound)
        assert np.allclose(errors, surprise(sound * np.array([[1.0], [1e-3]])), rtol=1e-6)
        assert all(abs(first_onset(channel[11700:12100]) - 300) <= 1 for channel in errors)
        assert abs(int(novelty(errors, 44).argmax()) * 44 - 12000) <= 44


@pytest.mark.parametrize("quiet", [8, 16, 32])
def test_a_faint_tap_is_located_though_the_noise_before_it_begins_quietly(quiet: int) -> None:
    rng = np.random.default_rng(quiet)
    for _ in range(20):
        errors = rng.standard_normal(600)
        errors[:quiet] *= 0.2
        errors[500:] *= 5.0
        assert abs(first_onset(errors) - 500) <= 6


def test_the_first_of_two_events_is_located_but_no_faint_one_nor_a_quiet_beginning() -> None:
    rng = np.random.default_rng(0)
    for _ in range(10):
        errors = rng.standard_normal(700)
        errors[:16] *= 0.2
        errors[300:] *= 20.0
        errors[500:] *= 5.0
        assert abs(first_onset(errors) - 300) <= 3
        errors[300:500] /= 10.0
        assert abs(first_onset(errors) - 500) <= 6
