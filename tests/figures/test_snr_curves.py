"""The curves are the scores of each noise at each ratio; without noise there is nothing to draw."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.figures.snr_curves import SnrCurves

Write = Callable[..., Path]


def curve(axes: Any, name: str) -> tuple[np.ndarray, np.ndarray]:
    (held,) = (one for one in axes.containers if one.get_label() == name)
    return np.asarray(held[0].get_xdata(), np.float64), np.asarray(held[0].get_ydata(), np.float64)


def test_curves_are_the_scores_at_each_ratio(write: Write) -> None:
    page = SnrCurves(results=write()).draw()
    position, force, contact, slip = page.axes[:4]
    for axes, factor in ((position, 1.0), (force, 0.05)):
        for noise in ("white", "hum"):
            ratio, error = curve(axes, noise)
            assert ratio.tolist() == [0.0, 10.0, 20.0]
            np.testing.assert_allclose(error, factor * (1.0 + 10.0 * 10.0 ** (-ratio / 20.0)))
        (clean,) = (line for line in axes.lines if line.get_label() == "clean")
        np.testing.assert_allclose(np.asarray(clean.get_ydata(), np.float64), factor)
    assert curve(contact, "hum")[1].tolist() == [100.0, 100.0, 100.0]
    np.testing.assert_allclose(curve(slip, "hum")[1], 0.75)
    assert position.get_ylabel() == "error of x (mm)"
    assert slip.get_xlabel() == "ratio of signal to noise (dB)"
    assert page.get_suptitle() == "simulated: made up"


def test_what_is_never_told_is_said_to_be(write: Write) -> None:
    panels = SnrCurves(results=write(quiet=("slip",))).draw().axes
    assert [[text.get_text() for text in axes.texts] for axes in panels] == [[], [], [], ["not told"]]


def test_intervals_hold_their_value(write: Write) -> None:
    told = SnrCurves(results=write(), draws=20).numbers()["curves"]
    assert [(one["noise"], one["ratio"]) for one in told[:3]] == [
        ("clean", None),
        ("white", 0.0),
        ("white", 10.0),
    ]
    assert len(told) == 7
    for one in told:
        assert one["slip"]["low"] <= one["slip"]["value"] <= one["slip"]["high"]
        assert one["position"]["answered"] == pytest.approx(0.9)


def test_what_cannot_be_drawn_is_refused(write: Write) -> None:
    with pytest.raises(InputError, match=r"results\.npz without added noise: allowed is results of a"):
        SnrCurves(results=write(noises=False)).draw()
    with pytest.raises(InputError, match="draws -1"):
        SnrCurves(results=write(), draws=-1)
