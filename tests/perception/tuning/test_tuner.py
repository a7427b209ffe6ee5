"""The string's own pitch from untouched sound: where it is heard, and where it is refused."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike
from tests.perception.windows import RATE, SIZE, cut
from tests.physics.twin.built import planned

import monochord as mc
from monochord.core.errors import InputError
from monochord.core.reasons import Reason
from monochord.core.types import Audio, Block, Floats, Signal, StringParams, Window
from monochord.dsp.resample import resampled
from monochord.perception.tuning import Tuner, TunerState, tuner
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import inharmonicity, open_frequency, stiff_partials
from monochord.physics.twin import Sensor
from monochord.physics.twin.virtual_sensor import VirtualSensor

PRESETS = ("prototype", "long", "gauge_012", "gauge_013", "prototype_one_driver", "prototype_ebow")
SEMITONES = 2.0 ** (1.5 / 12.0)
PULL = 0.004
"""Share by which drivers pull what they sustain off the string's own pitch."""


@pytest.fixture(autouse=True)
def sixteen_modes(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Limit the twins of quick tests to 16 modes: the kernel for those of the long string compiles slowly."""
    if not request.node.get_closest_marker("slow"):
        planned(monkeypatch, 1)


def detuned(name: str, ratio: float) -> Sensor:
    """Return a preset whose string is tuned to `ratio` times its nominal pitch."""
    sensor = load_sensor(name)
    return replace(sensor, string=replace(sensor.string, tension=sensor.string.tension * ratio**2))


@cache
def untouched(name: str, ratio: float = 1.0, seconds: float = 1.0, seed: int = 0) -> Audio:
    """Return the sound of an untouched twin from its pluck on."""
    return VirtualSensor(detuned(name, ratio), seed=seed).advance(seconds)[0]


def followed(sound: Audio, string: StringParams, size: int = SIZE, hop: int = SIZE) -> TunerState:
    """Return the state of a tuner after all windows of a sound."""
    tuner = Tuner.of(Signal(sample_rate=RATE, channels=len(sound), string=string), size)
    state = TunerState()
    for window in cut(sound, hop, size=size):
        state = tuner.step(state, window)
    return state


def tones(frequencies: ArrayLike, levels: ArrayLike, seconds: float = 1.0) -> Audio:
    """Return sines of given amplitudes (tones,) or (channels, tones) at two microphones."""
    time = np.arange(round(seconds * RATE)) / RATE
    pitch = np.asarray(frequencies, float)[:, np.newaxis]
    waves = np.sin(2.0 * np.pi * pitch * time + np.arange(len(pitch))[:, np.newaxis])
    return (np.broadcast_to(levels, (2, len(pitch))) @ waves).astype(np.float32)


def at_ratio(sound: Audio, noise: Floats | Audio, decibels: float) -> Audio:
    """Return a sound with noise (n,) or (channels, n) at this ratio of powers."""
    scale = np.sqrt(np.mean(sound**2.0) / np.mean(noise**2)) * 10.0 ** (-decibels / 20.0)
    return (sound + scale * noise).astype(np.float32)


PROTOTYPE = load_sensor("prototype").string


@pytest.mark.parametrize(
    ("name", "ratio"), [*zip(PRESETS, (0.91, 1.09, 0.97, 1.04, 0.91, 1.06), strict=True), ("prototype", 1.09)]
)
def test_the_pitch_of_a_detuned_string_is_heard(name: str, ratio: float) -> None:
    string = load_sensor(name).string
    tuning = followed(untouched(name, ratio), string).tuning
    assert tuning is not None
    error = tuning.frequency / (ratio * open_frequency(string)) - 1.0
    assert abs(error) < PULL
    assert abs(error) < 4.0 * tuning.frequency_std / tuning.frequency
    assert tuning.tuned(string).tension == pytest.approx(string.tension * ratio**2, rel=2.0 * PULL)


@pytest.mark.slow
@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("percent", [-9, -5, -1, 0, 3, 6, 9])
def test_each_tuning_is_heard_after_any_touch(name: str, percent: int) -> None:
    sensor = detuned(name, 1.0 + percent / 100.0)
    twin, (low, high) = VirtualSensor(sensor, seed=percent + 20), sensor.range
    string, random = load_sensor(name).string, np.random.default_rng([percent + 20, len(name)])
    heard = 0
    for material in ("plastic", "wood", "metal_tube"):
        twin.press(random.uniform(low, high), random.uniform(0.2, 1.8), material=material)
        twin.advance(0.8)
        twin.release()
        twin.advance(0.35)
        tuning = followed(twin.advance(1.5)[0], string).tuning
        if tuning is not None:
            heard += 1
            assert abs(tuning.deviation(sensor.string)) < PULL
    assert heard >= 2  # nothing or several things at once may be all that sounds, but not always


@pytest.mark.parametrize("rate", [46725])
def test_resampled_sound_is_that_of_another_tuning(rate: int) -> None:
    """Sound played faster by the tuning's ratio is that of a string of that pitch, whatever the twin does."""
    nominal = followed(untouched("prototype"), PROTOTYPE).tuning
    sound = Block(samples=untouched("prototype"), start=0)
    blocks = list(resampled([sound], sample_rate=RATE, new_rate=rate))
    tuning = followed(np.concatenate([block.samples for block in blocks], axis=1), PROTOTYPE).tuning
    assert nominal is not None
    assert tuning is not None
    assert tuning.frequency / nominal.frequency == pytest.approx(RATE / rate, rel=3e-4)
    assert tuning.partials[0] == nominal.partials[0]


@pytest.mark.parametrize(
    ("number", "ratio"),
    [(1, SEMITONES), (2, 1.0 / SEMITONES), (4, SEMITONES), (5, 1.05)],  # the fifth at 1.08 may be the sixth
)
def test_one_partial_is_enough(number: int, ratio: float) -> None:
    own = ratio * open_frequency(PROTOTYPE)
    partial = stiff_partials(own, inharmonicity(PROTOTYPE), float(number))
    tuning = followed(tones([partial], [0.1]), PROTOTYPE).tuning
    assert tuning is not None
    assert tuning.partials == (number,)
    assert tuning.frequency == pytest.approx(own, rel=1e-3)


@pytest.mark.parametrize("decibels", [-15.0, -9.0, 12.0])
def test_microphones_of_unlike_gain_hear_the_pitch(decibels: float) -> None:
    even = followed(untouched("prototype", 0.97), PROTOTYPE).tuning
    state = followed(
        untouched("prototype", 0.97) * np.array([[1.0], [10.0 ** (decibels / 20.0)]], np.float32), PROTOTYPE
    )
    assert even is not None
    assert state.tuning is not None
    assert state.tuning.frequency == pytest.approx(even.frequency, rel=1e-3)
    assert state.gain == pytest.approx(-decibels, abs=4.0)


@pytest.mark.parametrize("share", [0.3, 0.36, 0.5, 0.64])
def test_a_segment_alone_is_no_string_that_a_microphone_hears_less(share: float) -> None:
    pitch = open_frequency(PROTOTYPE) / share
    segment = tones(pitch * np.array([1.0, 2.0, 3.0]), [[0.1, 0.02, 0.01], [0.018, 0.0036, 0.0018]])
    assert followed(segment, PROTOTYPE).tuning is None
    untouched_before = np.concatenate((untouched("prototype"), segment), axis=1)
    both, before = followed(untouched_before, PROTOTYPE), followed(untouched("prototype"), PROTOTYPE)
    assert both.tuning == before.tuning
    assert "at one microphone only" in both.refused


def test_a_high_partial_that_may_be_another_is_refused() -> None:
    state = followed(tones([6.55 * open_frequency(PROTOTYPE)], [0.1]), PROTOTYPE)
    assert state.tuning is None
    assert "two readings" in state.reason
    both = followed(
        tones(np.array([6.55, 2.0 * 6.55 / 7.0]) * open_frequency(PROTOTYPE), [0.1, 0.003]), PROTOTYPE
    )
    assert both.tuning is not None
    assert both.tuning.partials == (7, 2)


def test_a_rival_of_nearly_the_same_pitch_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """Partials that drivers pull apart have two readings 0.5 % apart: one tuning, less certain."""
    read = tuner.read_tuning
    string, sound = load_sensor("prototype").string, untouched("prototype")

    def with_rival(ratio: float) -> TunerState:
        def reading(*given: Any) -> tuner.TuningReading:
            own = read(*given)
            return own._replace(rival_score=own.score, rival_frequency=own.frequency * ratio)

        monkeypatch.setattr(tuner, "read_tuning", reading)
        return followed(sound, string)

    alone = followed(sound, string).tuning
    near = with_rival(1.006).tuning
    assert alone is not None
    assert near is not None
    assert near.frequency == alone.frequency
    assert near.frequency_std == pytest.approx(np.hypot(alone.frequency_std, 0.003 * alone.frequency))
    assert Reason.of(with_rival(1.02).reason) is Reason.TWO_READINGS


def test_a_series_of_a_multiple_of_the_pitch_is_refused() -> None:
    state = followed(tones(1.01 * open_frequency(PROTOTYPE) * np.array([3.0, 6.02]), [0.1, 0.03]), PROTOTYPE)
    assert state.tuning is None
    assert "another string" in state.reason


def test_a_string_of_another_pitch_is_refused() -> None:
    state = followed(tones([1.4 * open_frequency(PROTOTYPE)], [0.1]), PROTOTYPE)
    assert state.tuning is None
    assert "not a partial" in state.reason


@pytest.mark.parametrize(
    ("name", "share"), [*zip(PRESETS, (0.4, 0.55, 2.0 / 3.0, 0.4, 0.55, 0.4), strict=True)]
)
def test_a_touched_string_is_refused(name: str, share: float) -> None:
    sensor = load_sensor(name)
    twin = VirtualSensor(sensor, seed=3)
    twin.press(share * sensor.string.length, 1.0)
    twin.advance(0.4)
    state = followed(twin.advance(0.6)[0], sensor.string)
    assert state.tuning is None
    assert "touched" in state.reason


@pytest.mark.parametrize("name", ["prototype", "gauge_013"])
def test_a_touch_at_the_middle_is_refused_or_hides_in_a_partial(name: str) -> None:
    """The second partial has a node at the middle, where a touch changes nothing, its pitch neither."""
    sensor = detuned(name, 0.96)
    twin = VirtualSensor(sensor, seed=3)
    twin.press(0.5 * sensor.string.length, 0.5)
    twin.advance(0.4)
    state = followed(twin.advance(0.6)[0], load_sensor(name).string)
    assert state.tuning is None or abs(state.tuning.deviation(sensor.string)) < 2.0 * PULL


def test_silence_noise_and_hum_are_refused() -> None:
    noise = np.random.default_rng(0).normal(size=(2, RATE))
    hum = tones(50.0 * np.arange(1, 40), 0.02 / np.arange(1, 40) ** 0.7)
    for sound, reason in (
        (0.0 * noise, Reason.SILENCE),
        (0.05 * noise, Reason.NO_LINE),
        (hum, Reason.HUM_ALONE),
    ):
        state = followed(sound.astype(np.float32), PROTOTYPE)
        assert state.tuning is None
        assert Reason.of(state.reason) is reason


def test_hum_does_not_move_the_pitch() -> None:
    sound, mains = untouched("long", 1.09), 50.0
    hum = tones(1.0004 * mains * np.arange(1, 40), 1.0 / np.arange(1, 40) ** 0.7)
    tuning = followed(at_ratio(sound, hum, 10.0), load_sensor("long").string).tuning
    assert tuning is not None
    assert abs(tuning.deviation(detuned("long", 1.09).string)) < PULL


def test_music_does_not_move_the_pitch() -> None:
    random, music = np.random.default_rng(1), np.zeros(RATE)
    for start in range(0, RATE, RATE // 5):
        for pitch in 110.0 * 2.0 ** (random.integers(0, 36, 3) / 12.0):
            note = tones(pitch * np.arange(1, 9), 1.0 / np.arange(1, 9), 0.2)[0]
            music[start : start + len(note)] += note
    sound = untouched("prototype", 0.91)
    tuning = followed(at_ratio(sound, music, 10.0), PROTOTYPE).tuning
    assert tuning is not None
    assert abs(tuning.deviation(detuned("prototype", 0.91).string)) < PULL


@pytest.mark.parametrize("dead", [0, 1])
def test_one_microphone_decides_only_what_it_can(dead: int) -> None:
    own = open_frequency(PROTOTYPE)
    levels = np.ones((2, 2)) * 0.1
    levels[dead] = 0.0
    tuning = followed(tones([2.04 * own, 3.06 * own], levels), PROTOTYPE).tuning
    assert tuning is not None
    assert tuning.channels == (2 - dead,)
    assert tuning.frequency == pytest.approx(1.02 * own, rel=1e-3)
    alone = followed(tones([2.04 * own], levels[:, :1]), PROTOTYPE)
    assert alone.tuning is None
    assert "one microphone" in alone.reason
    assert followed(tones([2.04 * own], [0.1])[:1], PROTOTYPE).tuning is None


def test_stiffness_is_heard_where_high_partials_sound() -> None:
    own, bend = open_frequency(PROTOTYPE), 2.4e-4
    partials = stiff_partials(own, bend, np.array([1.0, 2.0, 5.0, 7.0, 11.0]))
    tuning = followed(tones(partials, [0.02, 0.1, 0.003, 0.003, 0.003]), PROTOTYPE).tuning
    assert tuning is not None
    assert tuning.inharmonicity == pytest.approx(bend, abs=3.0 * tuning.inharmonicity_std)
    assert tuning.inharmonicity_std < 0.15 * bend
    alone = followed(tones(partials[:1], [0.1]), PROTOTYPE).tuning
    assert alone is not None
    assert alone.inharmonicity == pytest.approx(inharmonicity(PROTOTYPE), rel=0.02)
    assert alone.inharmonicity_std > 0.4 * alone.inharmonicity


def test_losses_are_heard_where_a_partial_dies_away() -> None:
    own, rate = open_frequency(PROTOTYPE), 9.0
    time = np.arange(RATE) / RATE
    sustained, free = tones([2.0 * own], [0.1]), tones([own], [0.01]) * np.exp(-rate * time)
    tuning = followed((sustained + free).astype(np.float32), PROTOTYPE).tuning
    assert tuning is not None
    assert tuning.decay == pytest.approx(rate, rel=0.1)
    alone = followed(sustained, PROTOTYPE).tuning
    assert alone is not None
    assert np.isnan(alone.decay)


def test_the_pitch_is_followed_past_touches() -> None:
    own = open_frequency(PROTOTYPE)
    before, after = tones([2.0 * own], [0.1], 5.0), tones([2.02 * own], [0.1], 5.0)
    touch = tones([2.4 * own, 1.7 * own], np.array([[0.1, 0.02], [0.02, 0.1]]), 1.0)
    state = followed(np.concatenate((before, touch, after), axis=1), PROTOTYPE)
    assert state.tuning is not None
    assert state.tuning.frequency == pytest.approx(1.01 * own, rel=1e-3)
    assert state.refusals >= 9


def test_lost_sound_does_not_move_the_pitch() -> None:
    """What a device fills a gap with may ring as a string does."""
    own, kept = open_frequency(PROTOTYPE), TunerState()
    tuner = Tuner.of(Signal(sample_rate=RATE, channels=2, string=PROTOTYPE), SIZE)
    before, within = tones([2.0 * own], [0.1]), tones([2.1 * own], [0.1])
    for number in range(16):
        has_gap = number >= 5
        samples = (within if has_gap else before)[:, :SIZE]
        window = Window(samples=samples, start=number * SIZE, sample_rate=RATE, has_gap=has_gap)
        kept = tuner.step(kept, window)
    assert kept.tuning is not None
    assert kept.tuning.frequency == pytest.approx(own, rel=1e-3)
    assert (kept.tuning.windows, kept.refusals) == (5, 11)


def test_the_state_is_all_there_is() -> None:
    """The fold gives the same from the same state, and begins anew with another stream."""
    sound = untouched("prototype")
    tuner = Tuner.of(Signal(sample_rate=RATE, channels=2, string=PROTOTYPE), SIZE)
    windows = cut(sound)[:8]
    first = state = TunerState()
    states = [state := tuner.step(state, window) for window in windows]
    again = [first := tuner.step(first, window) for window in windows]
    assert [one.tuning for one in states] == [one.tuning for one in again]
    assert len(tuner.step(state, windows[0]).lines) == 1


def test_what_cannot_be_tuned_is_refused() -> None:
    with pytest.raises(InputError, match="string"):
        Tuner.of(Signal(sample_rate=RATE, channels=2), SIZE)
    with pytest.raises(InputError, match="3"):
        Tuner.of(Signal(sample_rate=RATE, channels=3, string=PROTOTYPE), SIZE)
    with pytest.raises(InputError, match="frames"):
        Tuner.of(Signal(sample_rate=RATE, channels=2, string=PROTOTYPE), 300)


def test_a_virtual_sensor_and_an_array_are_tuned_as_a_recording_is() -> None:
    twin = mc.VirtualSensor("prototype", seed=1)
    sound, _ = twin.advance(1.5)
    by_array = mc.tune(sound[:, 4410:], sensor="prototype", seconds=1.0, sample_rate=44100)
    assert abs(by_array.deviation) < 2e-3
    assert abs(mc.tune(twin, seconds=1.0).deviation - by_array.deviation) < 2e-3
