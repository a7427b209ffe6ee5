"""Where a whole group of taps fits best into what a stream notices."""

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats
from monochord.core.units import Seconds

ALIKE: Seconds = 0.03
"""Shifts closer than this are one."""
CANDIDATES = 4


def shifts_of_group(
    taps: Floats, when: Floats, notice: Floats, reach: Seconds
) -> list[tuple[Seconds, float]]:
    """Return the shifts at which what is noticed at the taps adds up to most, with shares of the best.

    The best comes first, and there is always one more. `when` (n,) is evenly spaced and `notice` (n,) not
    negative.
    """
    step = float(when[1] - when[0])
    # A tap may fall between two frames: the greater counts.
    wide = np.maximum.reduce([notice, np.roll(notice, 1), np.roll(notice, -1)])
    shifts = np.arange(-round(reach / step), round(reach / step) + 1)
    at = np.rint((taps - when[0]) / step).astype(np.int64)
    place: NDArray[np.int64] = at[:, None] + shifts[None, :]
    inside = (place >= 0) & (place < notice.size)
    heard = np.where(inside, wide[np.clip(place, 0, notice.size - 1)], 0.0)
    told = heard.sum(axis=0)
    most = float(told.max())
    if not most > 0.0:
        return [(0.0, 1.0), (0.0, 1.0)]
    found: list[tuple[Seconds, float]] = []
    for _ in range(CANDIDATES):
        best = int(np.argmax(told))
        first = max(best - 8, 0)
        plateau = np.flatnonzero(told[first : best + 9] >= told[best] * (1.0 - 1e-9)) + first
        shift = float(shifts[plateau].mean()) * step
        found.append((shift, float(told[best]) / most))
        told[np.abs(shifts * step - shift) <= ALIKE] = 0.0
    return found
