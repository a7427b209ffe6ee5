"""The slip figure: its numbers are areas with intervals, and its slow drag sticks and slips."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.figures.slip import Slip

FEW = Slip(runs=3, speeds=(0.01, 0.1), seconds=0.12)


def test_numbers_are_what_the_panel_shows() -> None:
    numbers = FEW.numbers()
    assert numbers["simulated"] is True
    for where in ("areas", "areas in noise"):
        assert [(one["feature"], one["speed"]) for one in numbers[where]] == [
            (feature, speed) for feature in ("rumble", "filled gaps") for speed in FEW.speeds
        ]
        assert all(0.0 <= one["low"] <= one["area"] <= one["high"] <= 1.0 for one in numbers[where])


def test_the_drag_sticks_first_and_then_slides_at_times() -> None:
    dragged = FEW.dragged(drivers=False)
    early, late = dragged.time < 0.02, dragged.time > 0.08
    # For 20 ms at 5 mm/s the string goes with the object: at most a few micrometres are lost to the bristle.
    np.testing.assert_allclose(dragged.string[early], dragged.object[early], atol=1e-5)
    assert not dragged.slip[early].any()
    assert dragged.slip[late].mean() > 0.5
    assert set(np.unique(dragged.state[late])) >= {2.0, 3.0}
    # What friction pulls is what the string's lateral stiffness gives back.
    assert np.corrcoef(dragged.string, dragged.force)[0, 1] > 0.95


def test_panels_say_that_they_are_simulated_and_carry_units() -> None:
    page = FEW.draw()
    panels = {axes.get_title(loc="left"): axes for axes in page.axes}
    assert set("ABCD") <= set(panels)
    assert "simulated" in panels["A"].get_title()
    assert "simulated" in panels["B"].get_title()
    assert panels["A"].get_xlabel() == "sliding speed (mm/s)"
    assert panels["D"].get_xlabel() == "time (ms)"
    assert panels["D"].get_ylabel() == "friction (N)"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"speeds": (0.0,)}, "speeds"),
        ({"runs": 1}, "runs 1: allowed is 2 to 1000"),
        ({"seconds": 0.01}, "seconds 0.01"),
    ],
)
def test_options_out_of_range_are_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Slip(**options)  # pyright: ignore[reportArgumentType]
