import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.lab.tally import Tally, tally

TIME: Floats = np.arange(2000, dtype=np.float64) * 1e-3


def columns(**told: tuple[float, float, float]) -> dict[str, np.ndarray]:
    """Each column is a value between two times and NaN, or 0 for contact, elsewhere."""
    found = {"contact": 0.0 * TIME, "force": np.nan * TIME, "slip": np.nan * TIME, "settled": 0.0 * TIME}
    for name, (first, last, value) in told.items():
        found[name] = np.where((first - 1e-9 <= TIME) & (last - 1e-9 > TIME), value, found[name])
    return found


def test_kinds_of_windows() -> None:
    told = columns(
        contact=(0.45, 1.65, 1.0), force=(0.45, 1.65, 1.0), slip=(1.05, 1.45, 1.0), settled=(0.6, 1.0, 1.0)
    )
    # Windows from 0.5 to 0.9 are static, of those from 1.0 to 1.4 the first and last slide for a half.
    assert tally(TIME, told, 0.0, 2.0) == Tally(static=6, settled=4, slip=3, clear=7, transition=2, other=2)


def test_a_force_that_moves_is_not_static() -> None:
    told = columns(contact=(0.0, 2.0, 1.0), slip=(0.0, 2.0, 0.0))
    told["force"] = np.where(TIME > 1.05, 3.0, 1.0)
    found = tally(TIME, told, 0.0, 2.0)
    assert (found.static, found.other) == (19, 1)


def test_only_with_the_drivers_on_and_sums() -> None:
    found = tally(TIME, columns(), 0.5, 1.0)
    assert found == Tally(clear=5)
    assert found + found == Tally(clear=10)


def test_too_few_labels_are_refused() -> None:
    with pytest.raises(InputError, match="labels of 1 times"):
        tally(TIME[:1], columns(), 0.0, 1.0)
