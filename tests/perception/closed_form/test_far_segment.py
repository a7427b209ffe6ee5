"""The far-segment form: calibration by takes, and the position of a note."""

from itertools import pairwise

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio, Estimates, Window
from monochord.evaluation import recordings
from monochord.evaluation.noise import babble
from monochord.perception.closed_form.far_segment import SETUP_STD, FarSegment, Setup, abstain

LENGTH, OPEN = 0.65, 110.0
RISE, BEHIND = 0.004, -0.003
"""Shares by which pressing raises this instrument's wave speed, and its string ends behind the bridge."""


def ratio(place: float) -> float:
    """Open frequency over the note at x/L = `place` of an instrument that departs from the clamp."""
    return (1.0 + BEHIND - place) / ((1.0 + RISE) * (1.0 + BEHIND))


def estimated(frequency: float, form: FarSegment) -> Estimates:
    time = np.arange(4410) / 44100
    n = np.arange(1.0, 11.0)[:, np.newaxis]
    tone = (np.sin(2.0 * np.pi * frequency * n * time + n) / n).sum(axis=0)
    tone += 1e-4 * np.random.default_rng(0).standard_normal(4410)
    window = Window(samples=0.2 * tone[np.newaxis].astype(np.float32), start=0, sample_rate=44100)
    return form.prepare(44100, 4410)(window)


def form(**options: object) -> FarSegment:
    plain = {
        "length": LENGTH,
        "open_frequency": OPEN,
        "calibration": (),
        "reach": 0.8,
        "margin": 6.0,
        "evidence": 27.0,
    }
    return FarSegment(**(plain | options))  # pyright: ignore[reportArgumentType]


class TestSetup:
    def test_without_takes_nothing_is_corrected(self) -> None:
        correction, std = Setup().correct(1.0)
        assert correction == 0.0
        assert std == pytest.approx(SETUP_STD)
        assert Setup().correct(0.5)[1] > 0.5 * std

    def test_takes_correct_the_setup_and_lower_its_error(self) -> None:
        setup = Setup()
        stds = [setup.correct(ratio(0.4))[1]]
        for place in (0.1, 0.3, 0.6, 0.2, 0.5):
            setup = setup.learn(ratio(place), place)
            stds.append(setup.correct(ratio(0.4))[1])
        assert all(later < earlier for earlier, later in pairwise(stds))
        correction, _ = setup.correct(ratio(0.4))
        assert 1.0 - ratio(0.4) + correction == pytest.approx(0.4, abs=2e-4)
        assert abs(1.0 - ratio(0.4) - 0.4) > 2e-3

    def test_the_order_of_takes_does_not_matter(self) -> None:
        takes = [(ratio(place), place) for place in (0.1, 0.3, 0.6)]
        forward, backward = Setup(), Setup()
        for take in takes:
            forward = forward.learn(*take)
        for take in takes[::-1]:
            backward = backward.learn(*take)
        assert forward.shift == pytest.approx(backward.shift, abs=1e-12)

    def test_an_implausible_take_is_refused(self) -> None:
        with pytest.raises(InputError, match=r"calibration take at 30\.0 % .*check its position"):
            Setup().learn(ratio(0.5), 0.3)


def test_a_note_has_position_frequency_and_errors() -> None:
    estimates = estimated(OPEN / 0.7, form())
    assert estimates["position"].value == pytest.approx(0.3 * LENGTH, abs=3e-4)
    assert estimates["position"].std == pytest.approx(LENGTH * Setup().correct(0.7)[1], rel=0.1)
    assert estimates["frequency"].value == pytest.approx(OPEN / 0.7, rel=1e-4)
    assert estimates["inharmonicity"].value == pytest.approx(0.0, abs=1e-4)


def test_takes_correct_the_position() -> None:
    takes = tuple((OPEN / ratio(place), place * LENGTH) for place in (0.1, 0.3, 0.6))
    note = OPEN / ratio(0.45)
    plain, calibrated = (estimated(note, form(calibration=each))["position"] for each in ((), takes))
    assert abs(plain.value - 0.45 * LENGTH) > 1e-3
    assert calibrated.value == pytest.approx(0.45 * LENGTH, abs=3e-4)
    assert calibrated.std < plain.std


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"length": 0.0}, "string length 0 m"),
        ({"length": np.nan}, "string length nan m"),
        ({"open_frequency": 6000.0}, "10 to 5000 Hz"),
        ({"reach": 1.0}, "reach 1"),
        ({"calibration": ((110.0, 0.7),)}, r"calibration \[110.0, 0.7\]"),
        ({"calibration": ((110.0, 0.1, 1.0),)}, "inharmonicity"),
    ],
)
def test_bad_options_are_refused(options: dict[str, object], match: str) -> None:
    with pytest.raises(InputError, match=match):
        form(**options)


def test_an_abstention_is_one_of_everything() -> None:
    estimates = abstain("silence")
    assert set(estimates) == {"frequency", "position", "inharmonicity"}
    assert {estimate.why_not for estimate in estimates.values()} == {"silence"}


def answers(sound: Audio, rate: int, open_frequency: float) -> list[float]:
    """Return the positions in a sound (n,), window by window, without the abstentions."""
    size = rate // 10
    estimate = form(open_frequency=open_frequency).prepare(rate, size)
    starts = range(0, sound.size - size + 1, size // 2)
    windows = [
        Window(samples=sound[np.newaxis, s : s + size].copy(), start=s, sample_rate=rate) for s in starts
    ]
    positions = [estimate(window)["position"] for window in windows]
    return [position.value for position in positions if position.valid]


@pytest.mark.parametrize("glide", [-0.8, -0.3, 0.3, 0.8])
@pytest.mark.parametrize("frequency", [150.0, 220.0])
def test_a_harmonic_sound_that_glides_is_no_held_string(frequency: float, glide: float) -> None:
    time = np.arange(4410) / 44100 - 0.05
    phase = 2.0 * np.pi * frequency * (time + 0.5 * glide * time**2)
    voice = sum(np.sin(n * phase + n) / n for n in range(1, 11))
    voice = voice + 1e-4 * np.random.default_rng(0).standard_normal(4410)
    assert answers(0.2 * np.asarray(voice, np.float32), 44100, OPEN) == []


@pytest.mark.parametrize("open_frequency", [82.4, 110.0])
def test_speech_has_hardly_a_position(open_frequency: float) -> None:
    sound = 0.1 * babble(np.random.default_rng(4), 4 * 44100, 44100.0).astype(np.float32)
    assert len(answers(sound, 44100, open_frequency)) <= 4


@pytest.mark.skipif(recordings.folder() is None, reason="no real recordings (MONOCHORD_REALSTRINGS)")
@pytest.mark.parametrize("open_frequency", [82.4, 146.8, 246.9])
def test_a_recorded_voice_has_hardly_a_position(open_frequency: float) -> None:
    (speech,) = [take for take in recordings.takes(kind="interference") if take.path.stem[0].isdigit()]
    samples, rate = speech.read()
    assert len(answers(samples[0], rate, open_frequency)) <= 9
