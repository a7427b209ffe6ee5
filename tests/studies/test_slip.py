"""How well sliding is detected, and one touch that sticks and slips."""

from typing import Any

import numpy as np
import pytest
from studies.slip import Slip

from monochord.core.errors import InputError

FEW_TOUCHES = Slip(runs=3, speeds=(0.01, 0.1), seconds=0.12)


@pytest.mark.slow
def test_slip_has_areas_with_intervals_and_draws_four_panels() -> None:
    numbers = FEW_TOUCHES.numbers()
    assert numbers["simulated"] is True
    for key in ("areas", "areas in noise"):
        assert [(one["feature"], one["speed"]) for one in numbers[key]] == [
            (feature, speed) for feature in ("rumble", "filled gaps") for speed in FEW_TOUCHES.speeds
        ]
        assert all(0.0 <= one["low"] <= one["area"] <= one["high"] <= 1.0 for one in numbers[key])
    panels = {axes.get_title(loc="left"): axes for axes in FEW_TOUCHES.draw().axes}
    areas = [np.asarray(line.get_ydata()).tolist() for line in panels["A"].lines[:2]]
    expected = [one["area"] for one in numbers["areas"]]
    np.testing.assert_allclose(np.ravel(areas), expected)


def test_a_slow_drag_sticks_and_then_slips() -> None:
    drag = FEW_TOUCHES.dragged(drivers=False)
    early, late = drag.time < 0.02, drag.time > 0.08
    # For 20 ms at 5 mm/s the string moves with the object: at most a few micrometres are lost to the bristle.
    np.testing.assert_allclose(drag.string[early], drag.object[early], atol=1e-5)
    assert not drag.slip[early].any()
    assert drag.slip[late].mean() > 0.5
    assert set(np.unique(drag.state[late])) >= {2.0, 3.0}
    # Friction pulls with the force that the string's lateral stiffness returns.
    assert np.corrcoef(drag.string, drag.force)[0, 1] > 0.95


@pytest.mark.parametrize("options", [{"speeds": (0.0,)}, {"runs": 1}, {"seconds": 0.01}])
def test_options_out_of_range_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        Slip(**options).draw()
