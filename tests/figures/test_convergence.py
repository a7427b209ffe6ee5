"""The convergence figure: what it computes settles on theory, and its panels say what they show."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Contact
from monochord.figures.convergence import (
    STEADY,
    TRANSIENT,
    Convergence,
    Segment,
    envelope,
    spectrogram,
    spectrum,
)
from monochord.physics.split_string import SplitString, simulate
from monochord.physics.strings import load_string
from monochord.physics.theory import segment_frequencies


@pytest.fixture(scope="module")
def segments() -> list[Segment]:
    string = load_string("appendix").string
    contact = Contact(position=0.35 * string.length, force=0.0)
    heard = simulate(SplitString(string=string, contact=contact), 0.4, route="modal")
    both = zip(heard.segments, segment_frequencies(string, contact), strict=True)
    return [Segment(velocity=v, rate=float(heard.sample_rate), expected=f) for v, f in both]


def test_steady_spectrum_peaks_on_theory(segments: list[Segment]) -> None:
    for segment in segments:
        frequencies, levels = spectrum(segment, STEADY)
        assert frequencies[np.argmax(levels)] == pytest.approx(segment.expected, rel=2e-3)


def test_spectrum_sharpens_from_transient_to_steady(segments: list[Segment]) -> None:
    # What is not the fundamental loses at least 20 dB against it.
    for segment in segments:
        others: list[float] = []
        for span in (TRANSIENT, STEADY):
            frequencies, levels = spectrum(segment, span)
            others.append(levels[(frequencies > 1.6 * segment.expected) & (frequencies < 8000.0)].max())
        assert others[1] < others[0] - 20.0


def test_spectrogram_has_its_ridge_on_theory(segments: list[Segment]) -> None:
    for segment in segments:
        times, frequencies, levels = spectrogram(segment, 3000.0)
        assert levels.shape == (frequencies.size, times.size)
        assert times[0] == pytest.approx(0.015, abs=1e-4)
        assert times[-1] == pytest.approx(0.385, abs=3e-3)
        ridge = frequencies[np.argmax(levels, axis=0)]
        np.testing.assert_allclose(ridge, segment.expected, atol=frequencies[1])


def test_envelope_of_a_decaying_tone_is_its_amplitude() -> None:
    t = np.arange(0.0, 0.2, 1e-4)
    amplitude = np.exp(-t / 0.5)
    tone = Segment(velocity=amplitude * np.sin(2 * np.pi * 200.0 * t), rate=1e4, expected=200.0)
    np.testing.assert_allclose(envelope(tone)[50:-50], amplitude[50:-50], rtol=0.02)


def test_a_string_that_needs_a_finer_step_is_drawn_as_it_comes() -> None:
    assert len(Convergence(string="prototype", seconds=0.35).draw().axes) > 6


def test_panels_are_labelled_with_units() -> None:
    page = Convergence(route="modal").draw()
    panels = {axes.get_title(loc="left"): axes for axes in page.axes}
    assert set("ABCDEF") <= set(panels)
    assert panels["A"].get_ylabel() == "velocity (mm/s)"
    assert panels["C"].get_xlabel() == "time (ms)"
    assert panels["E"].get_xlabel() == "frequency (Hz)"
    assert "simulated" in panels["A"].get_title()
    assert "695.0 Hz" in panels["A"].get_title()
    assert "374.2 Hz" in panels["B"].get_title()
    low, high = panels["A"].get_xlim()
    assert (low, high) == pytest.approx((0.0, 400.0))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"position": 0.0}, "position 0"),
        ({"seconds": 0.3}, r"seconds 0.3: allowed is 0.35 to 60 s"),
        ({"highest": 0.0}, "highest 0: allowed is above 1"),
    ],
)
def test_options_out_of_range_are_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Convergence(**options)  # pyright: ignore[reportArgumentType]
