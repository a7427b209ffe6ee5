"""Noise has the stated ratio and is the same for every estimator."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.dsp.noise import GEAR_TEETH
from monochord.evaluation.noise import (
    MOTOR_SPEEDS,
    Disturbance,
    motor,
    noise_kinds,
    noise_recordings,
    noise_suite,
    parse_noise,
)

RATE = 44100
SOUND = 0.1 * np.random.default_rng(0).normal(size=(2, 2 * RATE)).astype(np.float32)
RECORDINGS = {"song": np.sin(np.arange(3000.0)).astype(np.float32)}


def noise_of(kind: str, ratio: float, session: str = "take", seed: int = 0) -> np.ndarray:
    noise = Disturbance(kind=kind, ratio=ratio, seed=seed, recordings=RECORDINGS)
    return noise.apply(SOUND, 0.01, RATE, session).astype(np.float64) - SOUND


@pytest.mark.parametrize("kind", noise_kinds(RECORDINGS))
def test_level_and_draw_of_every_kind(kind: str) -> None:
    loud, soft = noise_of(kind, 0.0), noise_of(kind, 20.0)
    assert 10.0 * np.log10(0.01 / np.mean(soft**2)) == pytest.approx(20.0, abs=0.01)
    np.testing.assert_allclose(loud, 10.0 * soft, atol=1e-5)
    np.testing.assert_array_equal(loud, noise_of(kind, 0.0))
    assert not np.allclose(loud, noise_of(kind, 0.0, session="other"))
    assert not np.allclose(loud, noise_of(kind, 0.0, seed=1))
    alike = np.allclose(soft[0], soft[1], atol=1e-6)
    assert alike == (kind not in ("white", "pink", "band"))


def test_a_recording_replaces_synthetic_speech() -> None:
    recordings = {"speech": np.ones(10, np.float32)}
    noisy = Disturbance(kind="speech", ratio=0.0, recordings=recordings).apply(SOUND, 0.01, RATE, "take")
    np.testing.assert_allclose(noisy - SOUND, 0.1, atol=1e-6)


def test_noise_is_named_by_kind_and_ratio_and_what_cannot_be_made_is_refused() -> None:
    noise = parse_noise("hum:5.5", {})
    assert (noise.kind, noise.ratio) == ("hum", 5.5)
    for text, named in (("pinc:10", "'pink'"), ("pink:nan", "nan"), ("hum", "hum:10"), ("song:10", "song")):
        with pytest.raises(InputError, match=named):
            parse_noise(text, {"song": np.zeros(9, np.float32)})


def test_the_suite_has_every_kind_at_every_ratio() -> None:
    music = np.ones(100, np.float32)
    recordings = noise_recordings(RATE, music)
    slower = noise_recordings(22050, music)
    assert len(slower["music"]) == pytest.approx(len(recordings["music"]) / 2, rel=0.01)
    kinds = {"white", "pink", "hum", "band", "motor", "speech", "music"}
    suite = noise_suite(recordings, ratios=(0.0, 20.0))
    assert {(each.kind, each.ratio) for each in suite} == {(kind, r) for kind in kinds for r in (0.0, 20.0)}


def test_a_motor_has_lines_at_its_speed_and_at_its_gear_mesh() -> None:
    sound = motor(np.random.default_rng(3), 2 * RATE, float(RATE))
    power = np.abs(np.fft.rfft(sound * np.hanning(sound.size))) ** 2
    frequency = np.fft.rfftfreq(sound.size, 1 / RATE)
    possible = (frequency > 0.95 * MOTOR_SPEEDS[0]) & (frequency < 1.05 * MOTOR_SPEEDS[1])
    speed = frequency[possible][power[possible].argmax()]
    mesh, between = (
        power[np.abs(frequency - factor * speed) < 0.05 * GEAR_TEETH * speed].sum()
        for factor in (GEAR_TEETH, 1.5 * GEAR_TEETH)
    )
    assert mesh > 20.0 * between
