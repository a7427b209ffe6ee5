"""How many microphones two channels are: sensors have two, copies one, and an unused input adds none."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import soxr

import monochord as mc
from monochord.core.inputs import Inputs, InputState
from monochord.core.types import Audio, Floats, Window
from monochord.dsp.microphones import Microphones, compare_inputs, inputs_of
from monochord.physics.sensors import load_sensor

RATE, SIZE = 44100, 4410
LATE = 21  # windows until a copy is believed


def played(name: str, own: float, build: int, world: str) -> Audio:
    """A sensor whose microphones hear their own end by this share: untouched, and touched twice."""
    sensor = load_sensor(name)
    sensor = replace(sensor, pickups=replace(sensor.pickups, own=(own, own)))
    twin = mc.VirtualSensor(sensor, seed=build, build=build, world=world)  # pyright: ignore[reportArgumentType]
    parts = [twin.advance(0.6)[0]]
    low, high = sensor.range
    for place, force, material in ((0.3, 0.6, "plastic"), (0.5, 1.5, "metal_tube")):
        twin.press(low + place * (high - low), force, material=material)
        parts.append(twin.advance(0.4)[0])
        twin.release()
        parts.append(twin.advance(0.2)[0])
    return np.concatenate(parts, axis=1).astype(np.float32)


def windows(sound: Floats | Audio, rate: int = RATE) -> list[Window]:
    size, hop = rate // 10, rate // 100
    sound = sound.astype(np.float32)
    starts = range(0, sound.shape[1] - size + 1, hop)
    return [Window(samples=sound[:, k : k + size], start=k, sample_rate=rate) for k in starts]


def told(sound: Floats | Audio) -> list[Inputs]:
    microphones = Microphones()
    return [microphones(window) for window in windows(sound)]


@pytest.fixture(scope="module")
def sensor() -> Audio:
    return played("prototype", 0.85, 3, "plausible")


# The kernel of the long string's many modes takes long to compile.
@pytest.mark.parametrize(
    ("name", "own"),
    [("prototype", 0.85), ("gauge_012", 0.55), ("gauge_013", 0.95), ("prototype_one_driver", 0.6),
     pytest.param("long", 0.7, marks=pytest.mark.slow)],
)  # fmt: skip
def test_a_sensor_has_two_microphones_touched_or_not(name: str, own: float) -> None:
    for build, world in ((7, "ideal"), (160, "plausible")):
        seen = told(played(name, own, build, world))
        assert {*seen} <= {Inputs.TWO, Inputs.UNKNOWN}
        assert seen.count(Inputs.TWO) > 0.9 * len(seen)


def hum(mains: float, count: int, level: float) -> Floats:
    """Mains hum with its harmonics, by an RMS of about `level` dB."""
    time = np.arange(count) / RATE
    parts = zip(range(1, 10), (0, -25, -12, -30, -14, -30, -12, -35, -18), strict=True)
    waves = [10.0 ** (gain / 20) * np.sin(2.0 * np.pi * mains * k * time + k) for k, gain in parts]
    return 10.0 ** (level / 20) * np.sum(waves, axis=0)


@pytest.mark.parametrize("gain", [1.0, -0.3, 0.05])
@pytest.mark.parametrize("noise", [-np.inf, -96.0, -80.0])
def test_a_copy_is_one_microphone(sensor: Audio, gain: float, noise: float) -> None:
    random = np.random.default_rng(0)
    one = sensor.mean(axis=0)
    both = np.stack((one, gain * one)) + 10.0 ** (noise / 20) * random.standard_normal(sensor.shape)
    assert {*told(both)[LATE:]} == {Inputs.SAME}
    whole = np.round(both * 32768.0) / 32768.0
    assert {*told(whole)[LATE:]} == {Inputs.SAME}


def test_a_copy_with_the_hum_of_its_cable_is_one_microphone(sensor: Audio) -> None:
    one = sensor.mean(axis=0)
    assert {*told(np.stack((one, one + hum(50.0, one.size, -40.0))))[LATE:]} == {Inputs.SAME}


def empty(count: int) -> dict[str, Floats]:
    """What an input brings with nothing plugged in."""
    noise = np.random.default_rng(1).standard_normal(count)
    return {
        "zero": np.zeros(count),
        "offset": np.full(count, 0.2),
        "faint noise": 10.0 ** (-90.0 / 20.0) * noise,
        "noise": 10.0 ** (-45.0 / 20.0) * noise,
        "hum": hum(50.03, count, -40.0) + 3e-5 * noise,
        "loud hum": hum(59.97, count, -20.0) + 3e-5 * noise,
    }


@pytest.mark.parametrize("kind", [*empty(1)])
@pytest.mark.parametrize("trace", [0.0, 2e-4])
def test_an_unused_input_is_no_microphone(sensor: Audio, kind: str, trace: float) -> None:
    for channel, expected in ((1, Inputs.FIRST), (0, Inputs.SECOND)):
        sound = sensor.astype(np.float64)
        sound[channel] = empty(sound.shape[1])[kind] + trace * sensor[1 - channel]
        seen = told(sound)
        assert {*seen} <= {expected, Inputs.UNKNOWN}
        assert seen.count(expected) > 0.5 * len(seen)
        pieces = np.split(sound[:, : SIZE * (sound.shape[1] // SIZE)], sound.shape[1] // SIZE, axis=1)
        assert inputs_of(pieces, RATE) is expected  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("rates", [(44100, 48000), (48000, 44100)])
def test_channels_of_unlike_rates_share_no_sound(sensor: Audio, rates: tuple[int, int]) -> None:
    other = soxr.resample(sensor[1], *rates)
    count = min(other.size, sensor.shape[1])
    seen = told(np.stack((sensor[0, :count], other[:count])))
    assert seen.count(Inputs.APART) > 0.5 * len(seen)


def test_two_microphones_before_one_string_in_the_air_are_two() -> None:
    random, time = np.random.default_rng(2), np.arange(RATE) / RATE
    numbers = np.arange(1, 14)
    partials = np.sin(2.0 * np.pi * 146.8 * np.outer(numbers, time)) * np.exp(-np.outer(numbers, time))
    sides = random.uniform(0.3, 1.0, (2, 13)) / numbers
    sound = 0.1 * sides @ partials + 1e-4 * random.standard_normal((2, RATE))
    assert {*told(sound)} == {Inputs.TWO}
    assert {*told(0.1 * (sides[:1] * [[1.0], [0.6]]) @ partials)[LATE:]} == {Inputs.SAME}


def test_what_tells_nothing_is_unknown() -> None:
    noise = np.random.default_rng(3).standard_normal((2, SIZE)).astype(np.float32)
    for sound in (
        0.0 * noise,
        0.1 * noise,
        noise * np.float32("nan"),
        np.stack((hum(50.0, SIZE, -20.0),) * 2),
    ):
        assert compare_inputs(sound.astype(np.float32), RATE) is Inputs.UNKNOWN


def test_lost_sound_tells_nothing_of_the_inputs(sensor: Audio) -> None:
    alone = np.stack((sensor[0], 0.0 * sensor[0]))[:, :SIZE]
    look = Window(samples=alone, start=0, sample_rate=RATE)
    assert Microphones()(look) is Inputs.FIRST
    assert Microphones()(replace(look, has_gap=True)) is Inputs.UNKNOWN


@pytest.mark.parametrize(
    ("seen", "last"),
    [
        (("SAME",), "UNKNOWN"),
        (("SAME", "SAME", "SAME"), "SAME"),
        (("SAME", "SAME", "SAME", "TWO"), "TWO"),
        (("TWO", *["SAME"] * 29), "TWO"),
        (("TWO", *["SAME"] * 30), "SAME"),
        (("TWO", "FIRST", "FIRST", "TWO", "FIRST"), "TWO"),
        (("TWO", "FIRST", "FIRST", "FIRST"), "FIRST"),
        (("APART", "APART"), "UNKNOWN"),
        (("APART", "APART", "APART", "TWO"), "APART"),
        (("FIRST", "UNKNOWN"), "FIRST"),
    ],
)
def test_one_look_does_not_unsay_what_was_known(seen: Sequence[str], last: str) -> None:
    state = InputState()
    for each in seen:
        state = state.after(Inputs[each])
    assert state.inputs is Inputs[last]
