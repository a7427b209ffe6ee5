"""The figure of what a string costs."""

import numpy as np
from studies.strings_cost import Strings


def test_the_figure_shows_cost_and_rate() -> None:
    figure = Strings(strings=(1,), seconds=0.8, hop=0.05, processes=(1,))
    left, right = figure.draw().axes
    (run,) = figure.numbers()["runs"]
    drawn = [float(np.ravel(axes.lines[0].get_ydata())[0]) for axes in (left, right)]
    assert drawn == [1e3 * run["cost"], run["rate"]]
