"""The twin as a source: its pace, its truth, and what may be asked of it."""

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from monochord.capture.sources._labels import LABEL_STEP, LabelMemory
from monochord.capture.sources._script import ScriptedTouch, draw_touches
from monochord.capture.sources.twin import LABELS, TwinSource, label_columns
from monochord.core.errors import InputError
from monochord.core.types import Audio, Contact, Truth
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import segment_frequencies
from monochord.physics.twin import Labels

RATE = 44100
SENSOR = load_sensor("prototype")
RESTING = ScriptedTouch(start=0.1, position=0.08, force=0.8, seconds=0.6)


def play(ranges: list[tuple[float, float]] | None = None, **options: Any) -> tuple[Audio, list[Truth]]:
    with TwinSource(speed=0.0, **options).open() as stream:
        sound = np.concatenate([block.samples for block in stream], axis=1)
        return sound, [stream.truth(round(a * RATE), round(b * RATE)) for a, b in ranges or []]


def test_a_touch_is_approached_pressed_and_released() -> None:
    ranges = [(0.0, 0.04), (0.1, 0.15), (0.45, 0.65), (0.95, 1.0)]
    before, onset, pressed, after = play(ranges, duration=1.0, script=(RESTING,))[1]
    assert before == {"contact": 0.0, "transition": 0.0, "settled": 0.0}
    assert "contact" not in onset or onset["settled"] < 1.0
    assert (pressed["contact"], pressed["settled"], pressed["slip"]) == (1.0, 1.0, 0.0)
    assert pressed["position"] == pytest.approx(0.08)
    assert pressed["force"] == pytest.approx(0.8, rel=0.05)
    assert pressed["slip_velocity"] < 5e-4
    assert after["contact"] == 0.0
    assert "position" not in after


def test_a_plausible_world_sounds_otherwise_and_is_labelled_alike() -> None:
    sounds: list[Audio] = []
    for world in ("ideal", "plausible"):
        sound, (pressed,) = play([(0.45, 0.65)], duration=0.7, script=(RESTING,), world=world, build=1, day=1)
        assert (pressed["contact"], pressed["slip"]) == (1.0, 0.0)
        assert pressed["position"] == pytest.approx(0.08, abs=1e-6)
        assert pressed["force"] == pytest.approx(0.8, rel=0.1)
        sounds.append(sound)
    assert np.abs(sounds[0] - sounds[1]).max() > 0.01
    with pytest.raises(InputError, match="world"):
        play(duration=0.1, world="real")


@pytest.mark.parametrize("direction", ["across", "along"])
def test_a_slide_shows_in_the_truth_with_its_sign(direction: str) -> None:
    signed: list[float] = []
    for speed in (0.02, -0.02):
        motion: dict[str, Any] = {direction: speed, "still": 0.2, "moving": 0.3, "seconds": 0.8}
        touch = ScriptedTouch(start=0.1, position=0.09, force=1.0, **motion)
        ranges = [(0.22, 0.29), (0.4, 0.5), (0.75, 0.85)]
        still, sliding, after = play(ranges, duration=0.9, script=(touch,))[1]
        assert (still["slip"], sliding["slip"], after["slip"]) == (0.0, 1.0, 0.0)
        assert sliding["slip_velocity"] == pytest.approx(0.02, rel=0.2)
        signed.append(sliding[f"slip_{direction}"])
        moved = 0.3 * speed if direction == "along" else 0.0
        assert after["position"] == pytest.approx(0.09 + moved, abs=1e-5)
    assert [abs(each) for each in signed] == pytest.approx([0.02, 0.02], rel=0.2)
    assert signed[0] * signed[1] < 0.0


def test_an_object_that_rolls_does_not_slip() -> None:
    touch = ScriptedTouch(
        start=0.1, position=0.09, along=0.02, rolls=True, still=0.1, moving=0.4, seconds=1.0
    )
    rolling = play([(0.3, 0.5)], duration=0.6, script=(touch,))[1][0]
    assert rolling["slip"] == 0.0
    assert rolling["settled"] == 0.0
    assert 0.092 < rolling["position"] < 0.096


def test_the_sound_is_that_of_the_touch() -> None:
    sound = play(duration=1.1, script=(ScriptedTouch(start=0.05, position=0.08, force=1.0),))[0]
    late = sound[:, round(0.6 * RATE) :] * np.hanning(round(0.5 * RATE))
    power = np.abs(np.fft.rfft(late, 4 * late.shape[1])) ** 2
    line = power.argmax(axis=1) * RATE / (4 * late.shape[1])
    series = np.array(segment_frequencies(SENSOR.string, Contact(position=0.08, force=1.0), "geometric"))
    number = line / series
    # A segment's lines lie within a few per cent of its series: stiffness and the drivers' pull move them.
    assert np.round(number).min() >= 1.0
    assert number / np.round(number) == pytest.approx([1.0, 1.0], abs=0.03)


def test_a_seed_fixes_everything_and_another_changes_it() -> None:
    options: dict[str, Any] = {"duration": 1.0, "hold": 0.5}
    first, again, other = (play(seed=seed, **options)[0] for seed in (1, 1, 2))
    assert first.tobytes() == again.tobytes()
    assert np.abs(first - other).max() > 0.01


def test_another_build_and_another_day_sound_otherwise_but_are_called_the_same() -> None:
    script = (ScriptedTouch(start=0.05, position=0.09),)
    variants: list[dict[str, Any]] = [{}, {"build": 1}, {"day": 1}, {"build": 1, "day": 1}]
    sounds = [play(duration=0.3, script=script, **options)[0] for options in variants]
    for one, two in itertools.combinations(sounds, 2):
        assert np.abs(one - two).max() > 1e-3
    with TwinSource(build=1, day=1).open() as stream:
        assert stream.signal.string == SENSOR.string


def test_ambient_noise_is_added_at_its_ratio(tmp_path: Path) -> None:
    path = tmp_path / "hum.wav"
    hum = 0.3 * np.sin(2 * np.pi * 3000.0 * np.arange(22050) / 22050)
    soundfile.write(path, np.stack([hum, hum], axis=1), 22050)
    script = (ScriptedTouch(start=0.1, position=0.09),)

    def level(snr: float) -> float:
        """Return the level at 3 kHz of a fifth of a second, within what the hum adds there."""
        late = play(duration=0.4, script=script, noise=str(path), snr=snr)[0][0, -8820:]
        return float(np.abs(np.mean(late * np.exp(2j * np.pi * 3000.0 * np.arange(8820) / RATE))))

    assert level(0.0) / level(10.0) == pytest.approx(10.0**0.5, rel=0.1)


def test_random_touches_keep_to_their_ranges_and_do_everything() -> None:
    drawn = draw_touches(
        seed=1, hold=1.0, positions=(0.05, 0.15), forces=(0.1, 2.0), slips=0.4, materials=("wood", "plastic")
    )
    touches = list(itertools.islice(drawn, 400))
    for touch in touches:
        touch.refuse_impossible(0.2)
        assert 0.05 <= touch.position <= 0.15
        assert 0.05 <= touch.position + touch.along * touch.moving <= 0.15
        assert 0.1 <= touch.force <= 2.0
        assert 0.7 <= touch.seconds <= 1.3
    assert all(a.end < b.begin for a, b in itertools.pairwise(touches))
    slips = [t for t in touches if t.across or t.along]
    assert len(slips) == pytest.approx(160, abs=40)
    speeds = [t.across for t in slips if t.across]
    assert min(map(abs, speeds)) < 0.004
    assert 0.02 < max(map(abs, speeds)) <= 0.0303
    assert {math.copysign(1.0, speed) for speed in speeds} == {1.0, -1.0}
    assert {t.rolls for t in slips if t.along} == {True, False}
    assert {t.material for t in touches} == {"wood", "plastic"}
    assert any(t.then is not None for t in touches)


def test_truth_of_short_old_and_future_ranges() -> None:
    memory = LabelMemory(LABELS, RATE, seconds=100 * LABEL_STEP / RATE)
    count = 150 * LABEL_STEP
    contact = np.zeros((1, count))
    contact[:, 120 * LABEL_STEP :] = 1
    one = np.ones((1, count))
    labels = Labels(
        contact=contact, position=0.1 * one, force=one, reaction=one, slip=0 * one, across=0 * one,
        along=0 * one, friction=one, settled=np.ones(count),
    )  # fmt: skip
    assert memory.over(0, 10) == {}
    memory.add(label_columns(labels), count)
    assert memory.over(0, 10 * LABEL_STEP) == {}  # forgotten
    assert memory.over(100 * LABEL_STEP, 101 * LABEL_STEP) == {
        "contact": 0.0,
        "transition": 0.0,
        "settled": 1.0,
    }
    assert memory.over(130 * LABEL_STEP + 1, 130 * LABEL_STEP + 2)["contact"] == 1.0
    assert memory.over(140 * LABEL_STEP, 151 * LABEL_STEP)["position"] == pytest.approx(0.1)
    assert memory.over(140 * LABEL_STEP, 200 * LABEL_STEP) == {}  # most of it is to come
    mixed = memory.over(110 * LABEL_STEP, 129 * LABEL_STEP)
    assert mixed == {"transition": 1.0, "settled": 1.0}
    assert memory.over(120 * LABEL_STEP, 129 * LABEL_STEP)["contact"] == 1.0


@pytest.mark.parametrize(
    ("options", "given"),
    [
        ({"sensor": "prototypo"}, "prototypo"),
        ({"materials": ("plastik",)}, "plastik"),
        ({"materials": ()}, "materials"),
        ({"speed": -1.0}, "-1"),
        ({"block": 0}, "0"),
        ({"day": -1}, "day' = -1"),
        ({"hold": 0.0}, "0"),
        ({"forces": (0.5, 0.1)}, "0.5 to 0.1"),
        ({"places": (0.0, 2.0)}, r"places.* 2"),
        ({"slips": 1.5}, "1.5"),
        ({"noise": "nowhere.wav"}, "nowhere.wav"),
        ({"sample_rate": 8000}, "8000"),
        ({"script": (ScriptedTouch(position=0.3),)}, "0.3"),
        ({"script": (ScriptedTouch(position=0.1, along=0.3, moving=1.0),)}, "0.4"),
        ({"script": (ScriptedTouch(position=0.1, across=0.01, seconds=0.5),)}, "0.5"),
        ({"script": (ScriptedTouch(position=0.1, force=-1.0),)}, "-1"),
        ({"script": (ScriptedTouch(position=0.1, material="plastik"),)}, "plastik"),
        ({"script": (ScriptedTouch(position=0.1), ScriptedTouch(start=1.0, position=0.1))}, "touch"),
    ],
)
def test_what_cannot_be_is_refused(options: dict[str, Any], given: str) -> None:
    with pytest.raises(InputError, match=given), TwinSource(**options).open():
        pass
