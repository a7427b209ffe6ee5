"""The maps' cells are the errors of the windows in them; cells with too few are crossed, not drawn."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matplotlib.collections import QuadMesh

from monochord.core.errors import InputError
from monochord.figures.error_map import ErrorMapFigure

Write = Callable[..., Path]


def drawn(figure: ErrorMapFigure, panel: int) -> np.ma.MaskedArray:
    (mesh,) = (one for one in figure.draw().axes[panel].collections if isinstance(one, QuadMesh))
    return np.ma.asarray(mesh.get_array())


def test_cells_are_mean_errors_in_the_units_of_the_axis(write: Write) -> None:
    figure = ErrorMapFigure(results=write(), least=1)
    np.testing.assert_allclose(drawn(figure, 0).compressed(), 1.0)
    np.testing.assert_allclose(drawn(figure, 1).compressed(), 0.05)
    page = figure.draw()
    assert page.axes[0].get_xlabel() == "true x (mm)"
    assert page.axes[0].get_ylabel() == "true F (N)"
    assert page.get_suptitle() == "simulated: made up, clean"
    assert [axes.get_ylabel() for axes in page.axes[2:]] == ["error of position (mm)", "error of force (N)"]


def test_cells_with_too_few_windows_are_crossed(write: Write) -> None:
    figure = ErrorMapFigure(results=write(), least=4)
    told = figure.numbers()["position"]
    few = (np.array(told["answered"]) < 4) & (np.array(told["windows"]) > 0)
    assert 0 < few.sum() < few.size
    assert (drawn(figure, 0).mask == (np.array(told["answered"]) < 4)).all()
    (crosses,) = figure.draw().axes[0].lines
    assert len(np.asarray(crosses.get_xdata())) == few.sum()


def test_numbers_count_every_window_once(write: Write) -> None:
    told = ErrorMapFigure(results=write(), condition="white 10 dB").numbers()
    assert told["estimator"] == "made_up"
    assert np.sum(told["force"]["windows"]) == 320
    assert np.sum(told["force"]["answered"]) == 288
    assert told["force"]["condition"] == "white 10 dB"


def test_what_cannot_be_drawn_is_refused(write: Write) -> None:
    with pytest.raises(InputError, match="least 0: allowed is 1 or more"):
        ErrorMapFigure(results=write(), least=0)
    with pytest.raises(InputError, match="condition 'music': allowed is clean, hum 0 dB"):
        ErrorMapFigure(results=write(), condition="music").draw()
