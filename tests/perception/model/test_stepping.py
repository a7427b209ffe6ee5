"""A window's way into a model: one spectrum serves the pitch and the features."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.perception.windows import RATE, SIZE, cut

from monochord.core.types import Audio, Signal, Window
from monochord.perception.model import ModelState, load
from monochord.perception.spectrum import SpectrumAnalyser
from monochord.perception.tuning import Tuner, TunerState
from monochord.physics.sensors import retuned
from monochord.physics.strings import load_string
from monochord.physics.theory import open_frequency

STRING = load_string("prototype").string
SIGNAL = Signal(sample_rate=RATE, channels=2, string=STRING)


def windows(ratio: float, count: int, hop: int = SIZE) -> list[Window]:
    """Two partials of an untouched string at a ratio of the known pitch, unlike at both microphones."""
    time = np.arange(count * hop + SIZE) / RATE
    own = ratio * open_frequency(STRING)
    partials = [np.sin(2.0 * np.pi * n * own * time) for n in (1, 2)]
    levels = np.array([[0.1, 0.05], [0.09, 0.06]])
    return cut(levels @ np.stack(partials), hop)[:count]


@pytest.mark.parametrize("ratio", [1.0, 1.03])
def test_a_window_is_transformed_once_and_one_in_ten_for_what_its_channels_carry(
    ratio: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    stream, transform = load("demo").stream(SIGNAL, SIZE), np.fft.rfft
    sound, counted = windows(ratio, 60, SIZE // 10), list[int]()

    def counting(samples: Audio, **options: Any) -> object:
        counted[-1] += 1
        return transform(samples, **options)

    for window in sound[:40]:  # at the other pitch, the model changes to it and prepares its features
        stream(window)
    monkeypatch.setattr(np.fft, "rfft", counting)
    for window in sound[40:]:
        counted.append(0)
        stream(window)
    assert sorted(counted) == [1] * 18 + [2] * 2


def test_a_stream_that_follows_gives_the_bits_of_a_model_for_its_pitch() -> None:
    model, sound = load("demo"), windows(1.03, 8)
    stream, tuner, state = model.stream(SIGNAL, SIZE), Tuner.of(SIGNAL, SIZE), TunerState()
    followed = [stream(window) for window in sound]
    for window in sound[:3]:
        state = tuner.step(state, window)
    assert state.tuning is not None
    own, of_own = model.tuned(state.tuning.tuned(STRING)), ModelState(start=sound[1].start)
    for window, estimates in zip(sound[2:], followed[2:], strict=True):
        of_own, expected = own.step(of_own, window)
        assert repr(estimates) == repr(expected)


def test_a_tuner_reads_a_given_spectrum_as_its_own() -> None:
    tuner, analyser = Tuner.of(SIGNAL, SIZE), SpectrumAnalyser.of(SIGNAL, SIZE)
    alone = given = TunerState()
    for window in windows(1.01, 5):
        alone, given = (
            tuner.step(alone, window),
            tuner.step(given, window, analyser.analyse(window.samples)),
        )
    assert alone.tuning is not None
    assert alone.tuning == given.tuning


def test_a_spectrum_lists_the_lines_above_the_pitch_of_another_string() -> None:
    low = SpectrumAnalyser.of(SIGNAL, SIZE)
    high = SpectrumAnalyser.of(replace(SIGNAL, string=retuned(STRING, 1.1 * low.nominal)), SIZE)
    rng = np.random.default_rng(1)
    window = rng.normal(0.0, 0.1, (2, SIZE)).astype(np.float32)
    time = np.arange(SIZE) / RATE
    window += np.sin(2.0 * np.pi * 0.85 * low.nominal * time).astype(np.float32)
    listed, expected = high.relisted(low.analyse(window)), high.analyse(window)
    assert [each.tolist() for each in listed] == [each.tolist() for each in expected]
    assert listed.frequency.tolist() != low.analyse(window).frequency.tolist()


def test_a_copy_of_a_stream_goes_on_by_itself() -> None:
    stream, sound = load("demo").stream(SIGNAL, SIZE), windows(1.03, 8)
    for window in sound[:4]:
        stream(window)
    copy, silenced = stream.copy(), stream.copy()
    for window in sound[4:]:  # what one of them hears is nothing to the others
        silenced(replace(window, samples=np.zeros_like(window.samples)))
    expected = [repr(stream(window)) for window in sound[4:]]
    assert [repr(copy(window)) for window in sound[4:]] == expected
