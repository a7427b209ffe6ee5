"""The trends figure: simulated ridges lie on theory, and the panels say what they show."""

import re

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.figures._sweep import Sweep, simulated_spectra, simulator
from monochord.figures.trends import Trends
from monochord.physics.strings import load_string
from monochord.physics.theory import split_frequencies

STRING = load_string("appendix").string
MODEL = simulator("split_string")


def ridge_near(frequencies: Floats, levels: Floats, expected: float) -> float:
    """Return the frequency of the strongest bin within a quarter of a fundamental either side."""
    near = np.flatnonzero(np.abs(frequencies - expected) < expected / 4.0)
    return float(frequencies[near[np.argmax(levels[near])]])


@pytest.mark.parametrize("which", [0, 1], ids=["position", "force"])
def test_ridges_of_the_simulated_spectra_lie_on_theory(which: int) -> None:
    sweep = Trends(steps=9).sweeps(STRING)[which]
    frequencies, levels = simulated_spectra(MODEL, STRING, sweep)
    expected = np.array(split_frequencies(STRING, sweep.positions, sweep.forces)).T
    for level, (f1, f2) in zip(levels, expected, strict=True):
        for f, other in ((f1, f2), (f2, f1)):
            if abs(f - other) > 0.3 * f:
                # Within the bin of the padded spectrum, 2.5 Hz, and what the driver pulls.
                assert ridge_near(frequencies, level, f) == pytest.approx(f, abs=3.0)
                assert level[np.argmin(np.abs(frequencies - f))] > -20.0


def test_geometric_law_shows_in_theory_and_simulation() -> None:
    plain = load_string("plain_010").string
    sweep = Trends(steps=3, highest_force=20.0, law="geometric").sweeps(plain)[1]
    frequencies, levels = simulated_spectra(MODEL, plain, sweep)
    f1, _ = sweep.fundamentals(plain)
    assert f1[2] > 1.2 * f1[0]
    assert ridge_near(frequencies, levels[2], f1[2]) == pytest.approx(f1[2], abs=3.0)


def test_levels_are_relative_to_the_strongest_line() -> None:
    sweep = Sweep(positions=np.array([0.2, 0.4]), forces=np.array([1.0, 0.5]))
    frequencies, levels = simulated_spectra(MODEL, STRING, sweep)
    assert levels.shape == (2, frequencies.size)
    np.testing.assert_array_equal(levels.max(axis=1), 0.0)
    assert frequencies[-1] == pytest.approx(22050.0)


def test_mirrored_touches_sound_alike() -> None:
    sweep = Sweep(positions=np.array([0.2, 0.45]), forces=np.array([1.0, 1.0]))
    _, levels = simulated_spectra(MODEL, STRING, sweep)
    loud = levels[0] > -60.0
    np.testing.assert_allclose(levels[0][loud], levels[1][loud], atol=0.1)


def test_panels_are_labelled_with_units() -> None:
    page = Trends(steps=3).draw()
    panels = {axes.get_title(loc="left"): axes for axes in page.axes}
    assert set(panels) == {"A", "B", "D", "E", ""}
    assert panels["B"].get_xlabel() == "position x (mm)"
    assert panels["E"].get_xlabel() == "normal force F (N)"
    for letter in "AB":
        assert panels[letter].get_ylabel() == "frequency (Hz)"
    for letter in "BE":
        assert panels[letter].get_title().startswith("simulated")
    assert panels[""].get_ylabel() == "level (dB)"


def test_curves_of_panel_a_are_theory_in_millimetres() -> None:
    page = Trends(steps=3).draw()
    first = page.axes[0].lines[0]
    x, f = np.asarray(first.get_xdata()), np.asarray(first.get_ydata())
    np.testing.assert_allclose(f, split_frequencies(STRING, x / 1e3, np.ones(3))[0])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"edge": 0.5}, "edge 0.5"),
        ({"position": 1.0}, "position 1"),
        ({"force": -1.0}, "force -1 N"),
        ({"highest": 1.0}, "highest 1"),
        ({"steps": 1}, "steps 1"),
        ({"model": "splitstring"}, "did you mean 'split_string'"),
        ({"route": "modl"}, "did you mean 'modal'"),
        ({"string": "appendx"}, "did you mean 'appendix'"),
    ],
)
def test_options_out_of_range_are_refused(options: dict[str, float | int | str], message: str) -> None:
    with pytest.raises(InputError, match=re.escape(message)):
        Trends(**options).draw()  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("which", [0, 1], ids=["position", "force"])
def test_twin_has_lines_on_the_harmonics_of_both_segments(which: int) -> None:
    plain = load_string("prototype").string
    sweep = Trends(steps=5, edge=0.27, highest_force=2.0, law="geometric").sweeps(plain)[which]
    frequencies, levels = simulated_spectra(simulator("twin"), plain, sweep)
    for level, force, *both in zip(levels, sweep.forces, *sweep.fundamentals(plain), strict=True):
        for f in both if force > 0.0 else ():
            # A light touch yields, a stiff string is up by less than 1 %; a driver holds one of four.
            loud = [
                level[(frequencies > 0.97 * n * f) & (frequencies < 1.01 * n * f)].max() for n in range(1, 5)
            ]
            assert max(loud) > -30.0


def test_the_law_goes_to_every_model() -> None:
    plain = load_string("prototype").string
    linear, geometric = (
        simulated_spectra(
            simulator("twin"), plain, Sweep(positions=np.array([0.09]), forces=np.array([2.0]), law=law)
        )
        for law in ("linear", "geometric")
    )
    first, second = (frequencies[levels[0].argmax()] for frequencies, levels in (linear, geometric))
    # k_T 0.3 against 4 N^2 of stretch: 0.6 N and 1.2 N on 65 N.
    assert second > first + 2.0
