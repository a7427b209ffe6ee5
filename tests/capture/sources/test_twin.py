"""The twin as a source: its pace, its truth, and what may be asked of it."""

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from monochord.capture.sources._labels import EVERY, LabelMemory
from monochord.capture.sources._visits import Visit, wander
from monochord.capture.sources.twin import TwinSource
from monochord.core.errors import InputError
from monochord.core.types import Audio, Contact, Truth
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import segment_frequencies
from monochord.physics.twin import Labels

RATE = 44100
SENSOR = load_sensor("prototype")
RESTING = Visit(start=0.1, position=0.08, force=0.8, seconds=0.6)


def heard(ranges: list[tuple[float, float]] | None = None, **options: Any) -> tuple[Audio, list[Truth]]:
    with TwinSource(speed=0.0, **options).open() as stream:
        sound = np.concatenate([block.samples for block in stream], axis=1)
        return sound, [stream.truth(round(a * RATE), round(b * RATE)) for a, b in ranges or []]


def test_a_touch_is_approached_pressed_and_released() -> None:
    ranges = [(0.0, 0.04), (0.1, 0.15), (0.45, 0.65), (0.95, 1.0)]
    before, onset, held, after = heard(ranges, duration=1.0, script=(RESTING,))[1]
    assert before == {"contact": 0.0, "settled": 0.0}
    assert onset["settled"] == 0.0
    assert (held["contact"], held["settled"], held["slip"]) == (1.0, 1.0, 0.0)
    assert held["position"] == pytest.approx(0.08)
    assert held["force"] == pytest.approx(0.8, rel=0.05)
    assert held["slip_velocity"] < 5e-4
    assert after["contact"] == 0.0
    assert "position" not in after


@pytest.mark.parametrize("speed", [0.02, -0.02])
@pytest.mark.parametrize("direction", ["across", "along"])
def test_a_slide_shows_in_the_truth_with_its_sign(direction: str, speed: float) -> None:
    motion: dict[str, Any] = {direction: speed, "still": 0.2, "moving": 0.3, "seconds": 0.8}
    visit = Visit(start=0.1, position=0.09, force=1.0, **motion)
    still, sliding, after = heard([(0.22, 0.29), (0.4, 0.5), (0.75, 0.85)], duration=0.9, script=(visit,))[1]
    assert (still["slip"], sliding["slip"], after["slip"]) == (0.0, 1.0, 0.0)
    assert sliding["slip_velocity"] == pytest.approx(0.02, rel=0.2)
    assert abs(sliding[f"slip_{direction}"]) == pytest.approx(0.02, rel=0.2)
    moved = 0.3 * speed if direction == "along" else 0.0
    assert after["position"] == pytest.approx(0.09 + moved, abs=1e-5)


def test_the_two_directions_of_a_slide_differ_in_sign() -> None:
    def sliding(speed: float) -> float:
        visit = Visit(start=0.1, position=0.09, across=speed, still=0.1, moving=0.3)
        return heard([(0.3, 0.4)], duration=0.45, script=(visit,))[1][0]["slip_across"]

    assert sliding(0.02) * sliding(-0.02) < 0.0


def test_an_object_that_rolls_does_not_slip() -> None:
    visit = Visit(start=0.1, position=0.09, along=0.02, rolls=True, still=0.1, moving=0.4, seconds=1.0)
    rolling = heard([(0.3, 0.5)], duration=0.6, script=(visit,))[1][0]
    assert rolling["slip"] == 0.0
    assert rolling["settled"] == 0.0
    assert 0.092 < rolling["position"] < 0.096


def test_the_sound_is_that_of_the_touch() -> None:
    sound = heard(duration=1.1, script=(Visit(start=0.05, position=0.08, force=1.0),))[0]
    late = sound[:, round(0.6 * RATE) :] * np.hanning(round(0.5 * RATE))
    power = np.abs(np.fft.rfft(late, 4 * late.shape[1])) ** 2
    line = power.argmax(axis=1) * RATE / (4 * late.shape[1])
    series = np.array(segment_frequencies(SENSOR.string, Contact(position=0.08, force=1.0), "geometric"))
    number = line / series
    # A segment's lines lie within a few per cent of its series: stiffness and the drivers' pull move them.
    assert np.round(number).min() >= 1.0
    assert number / np.round(number) == pytest.approx([1.0, 1.0], abs=0.03)


@pytest.mark.parametrize("block", [61, 333])
def test_the_size_of_blocks_does_not_matter(block: int) -> None:
    options: dict[str, Any] = {
        "duration": 0.3,
        "script": (Visit(start=0.1234567, position=0.09, seconds=0.07),),
    }
    ranges = [(0.1, 0.15), (0.15, 0.2), (0.25, 0.3)]
    (sound, truth), (other, other_truth) = (
        heard(ranges, block=block, **options),
        heard(ranges, block=4096, **options),
    )
    assert sound.tobytes() == other.tobytes()
    assert truth == other_truth


def test_a_seed_fixes_everything_and_another_changes_it() -> None:
    options: dict[str, Any] = {"duration": 1.0, "hold": 0.5}
    first, again, other = (heard(seed=seed, **options)[0] for seed in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    assert np.abs(first - other).max() > 0.01


def test_another_build_and_another_day_sound_otherwise_but_are_called_the_same() -> None:
    touch = (Visit(start=0.05, position=0.09),)
    variants: list[dict[str, Any]] = [{}, {"build": 1}, {"day": 1}, {"build": 1, "day": 1}]
    sounds = [heard(duration=0.3, script=touch, **options)[0] for options in variants]
    for one, two in itertools.combinations(sounds, 2):
        assert np.abs(one - two).max() > 1e-3
    with TwinSource(build=1, day=1).open() as stream:
        assert stream.signal.string == SENSOR.string


def test_noise_of_the_room_is_heard_at_its_ratio(tmp_path: Path) -> None:
    path = tmp_path / "hum.wav"
    hum = 0.3 * np.sin(2 * np.pi * 3000.0 * np.arange(22050) / 22050)
    soundfile.write(path, np.stack([hum, hum], axis=1), 22050)
    script = (Visit(start=0.1, position=0.09),)

    def level(snr: float) -> float:
        with TwinSource(speed=0.0, duration=0.4, script=script, noise=str(path), snr=snr).open() as stream:
            outside = stream._twin.scene.outside  # pyright: ignore[reportAttributeAccessIssue]
            assert outside is not None
            assert outside.samples.size == RATE
            return outside.level

    assert level(10.0) / level(30.0) == pytest.approx(10.0)
    quiet, loud = (heard(duration=0.4, script=script, noise=str(path), snr=snr)[0] for snr in (60.0, 0.0))
    assert np.std(loud[:, -8820:] - quiet[:, -8820:]) > 0.02


def test_random_visits_keep_to_their_ranges_and_do_everything() -> None:
    drawn = wander(
        seed=1, hold=1.0, positions=(0.05, 0.15), forces=(0.1, 2.0), slips=0.4, materials=("wood", "plastic")
    )
    visits = list(itertools.islice(drawn, 400))
    for visit in visits:
        visit.refuse_impossible(0.2)
        assert 0.05 <= visit.position <= 0.15
        assert 0.05 <= visit.position + visit.along * visit.moving <= 0.15
        assert 0.1 <= visit.force <= 2.0
        assert 0.7 <= visit.seconds <= 1.3
    assert all(a.end < b.begin for a, b in itertools.pairwise(visits))
    slips = [v for v in visits if v.across or v.along]
    assert len(slips) == pytest.approx(160, abs=40)
    speeds = [v.across for v in slips if v.across]
    assert min(map(abs, speeds)) < 0.004
    assert 0.02 < max(map(abs, speeds)) <= 0.0303
    assert {math.copysign(1.0, speed) for speed in speeds} == {1.0, -1.0}
    assert {v.rolls for v in slips if v.along} == {True, False}
    assert {v.material for v in visits} == {"wood", "plastic"}
    assert any(v.then is not None for v in visits)


@pytest.mark.parametrize(
    ("visit", "keys"),
    [
        (Visit(start=1.0, position=0.08), 3),
        (Visit(start=1.0, position=0.08, seconds=1.0), 6),
        (Visit(start=1.0, position=0.08, seconds=2.0, across=0.01), 10),
        (Visit(start=1.0, position=0.08, along=0.01), 7),
    ],
)
def test_a_visit_becomes_a_touch(visit: Visit, keys: int) -> None:
    touch = visit.touch("rubber")
    assert len(touch.motion) == keys
    assert touch.material.name == "rubber"
    assert touch.motion[0].time == pytest.approx(visit.begin)
    if math.isfinite(visit.seconds):
        assert touch.motion[-1].time == pytest.approx(visit.end)
        assert touch.motion[-1].force == 0.0


def test_truth_of_short_old_and_future_ranges() -> None:
    memory = LabelMemory(100 * EVERY)
    count = 150 * EVERY
    contact = np.zeros((1, count))
    contact[:, 120 * EVERY :] = 1
    one = np.ones((1, count))
    labels = Labels(
        contact=contact, position=0.1 * one, force=one, reaction=one, slip=0 * one, across=0 * one,
        along=0 * one, friction=one, settled=np.ones(count),
    )  # fmt: skip
    assert memory.over(0, 10) == {}
    memory.add(labels)
    assert memory.over(0, 10 * EVERY) == {}  # forgotten
    assert memory.over(100 * EVERY, 101 * EVERY) == {"contact": 0.0, "settled": 1.0}
    assert memory.over(130 * EVERY + 1, 130 * EVERY + 2)["contact"] == 1.0
    assert memory.over(140 * EVERY, 200 * EVERY)["position"] == pytest.approx(0.1)
    mixed = memory.over(110 * EVERY, 129 * EVERY)
    assert mixed == {"contact": 0.0, "settled": 0.0}
    assert memory.over(112 * EVERY, 129 * EVERY)["contact"] == 1.0


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"sensor": "prototypo"}, "did you mean 'prototype'"),
        ({"materials": ("plastik",)}, "did you mean 'plastic'"),
        ({"materials": ()}, "no materials"),
        ({"speed": -1.0}, "speed -1"),
        ({"block": 0}, "block 0"),
        ({"day": -1}, "seeds of 0 or more"),
        ({"hold": 0.0}, "hold 0 s"),
        ({"forces": (0.5, 0.1)}, "forces 0.5 to 0.1 N"),
        ({"places": (0.0, 2.0)}, "places 0 to 2"),
        ({"slips": 1.5}, "slips 1.5"),
        ({"noise": "nowhere.wav"}, "not there"),
        ({"sample_rate": 8000}, "sample rate 8000 Hz"),
        ({"script": (Visit(position=0.3),)}, "place 0.3 m"),
        ({"script": (Visit(position=0.1, along=0.3, moving=1.0),)}, "place 0.4 m"),
        ({"script": (Visit(position=0.1, across=0.01, seconds=0.5),)}, "seconds 0.5: allowed is 0.94 s"),
        ({"script": (Visit(position=0.1, force=-1.0),)}, "force -1"),
        ({"script": (Visit(position=0.1, material="plastik"),)}, "did you mean 'plastic'"),
        ({"script": (Visit(position=0.1), Visit(start=1.0, position=0.1))}, "visits one after another"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(options: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError, match=line), TwinSource(**options).open():
        pass
