"""A window's way into a model: one spectrum serves the pitch and the features."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from monochord.core.types import Audio, Signal, Window
from monochord.perception.model import ModelState, load
from monochord.perception.model.context import context_row
from monochord.perception.model.stepping import Stepper, step_all
from monochord.perception.spectrum import SpectrumAnalyser
from monochord.perception.tuning import Tuner, TunerState
from monochord.physics.sensors import retuned
from monochord.physics.strings import load_string
from monochord.physics.theory import inharmonicity, open_frequency

RATE, SIZE = 44100, 4410
STRING = load_string("prototype").string
SIGNAL = Signal(sample_rate=RATE, channels=2, string=STRING)


def windows(ratio: float, count: int, hop: int = SIZE) -> list[Window]:
    """Two partials of an untouched string at a ratio of the known pitch, unlike at both microphones."""
    time = np.arange(count * hop + SIZE) / RATE
    own = ratio * open_frequency(STRING)
    partials = [np.sin(2.0 * np.pi * n * own * time) for n in (1, 2)]
    levels = np.array([[0.1, 0.05], [0.09, 0.06]])
    samples = (levels @ np.stack(partials)).astype(np.float32)
    return [
        Window(samples=samples[:, start : start + SIZE], start=start, sample_rate=RATE)
        for start in range(0, count * hop, hop)
    ]


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


def of_partials(heights: dict[int, float], ratio: float, start: int) -> Window:
    """A window of partials of the stiff string, at a ratio of its known pitch."""
    time, bending = np.arange(start, start + SIZE) / RATE, inharmonicity(STRING)
    own = ratio * open_frequency(STRING)
    tone = sum(
        height * np.sin(2.0 * np.pi * n * np.sqrt(1.0 + bending * n**2) * own * time)
        for n, height in heights.items()
    )
    return Window(samples=np.stack((tone, 0.9 * tone)).astype(np.float32), start=start, sample_rate=RATE)


ALL, FIFTH = {1: 0.1, 2: 0.05, 3: 0.03}, {5: 0.06, 15: 0.0004}


def contact_after(heights: dict[int, float], ratio: float, *, value: float, seconds: float = 0.1) -> float:
    """What becomes of a contact head's output so many seconds after the string has sounded untouched."""
    stepper, state = Stepper(load("demo")), ModelState()
    for k in range(12):
        (state, _), *_ = step_all([stepper.entry(state, of_partials(ALL, 0.99, k * SIZE))])
    known = context_row(state, stepper.context)
    assert known[-1] == 1.0
    entry = stepper.entry(state, of_partials(heights, ratio, 11 * SIZE + round(seconds * RATE)))
    row = stepper.row(entry)
    outputs = stepper.network.outputs(row[None], known[None])[0]
    outputs["contact"] = outputs["contact"]._replace(value=value)
    return stepper.reading(entry, outputs, row, known).outputs["contact"].value


@pytest.mark.parametrize(
    ("heights", "ratio", "value"),
    [(ALL, 0.993, -4.0), (FIFTH, 0.99, -4.0), (FIFTH, 0.993, 0.0)],
    ids=["a higher pitch", "another partial", "both"],
)
def test_a_touch_at_a_node_of_the_held_partial_is_not_denied(
    heights: dict[int, float], ratio: float, value: float
) -> None:
    assert contact_after(heights, ratio, value=-4.0) == value


def test_a_pitch_that_rises_tells_a_touch_until_it_may_have_been_tuned() -> None:
    assert contact_after(ALL, 0.996, value=0.5) == 5.5
    assert contact_after(ALL, 0.986, value=0.5) == 0.5, "a pitch that falls is no press"
    assert contact_after(ALL, 0.996, value=0.5, seconds=59.0) == 5.5
    assert contact_after(ALL, 0.996, value=0.5, seconds=61.0) == 0.5
