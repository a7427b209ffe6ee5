"""What recorded labels say of a stretch of time."""

from collections.abc import Mapping

import numpy as np

from monochord.core.types import Floats, Truth
from monochord.core.units import Seconds

YES_OR_NO = ("contact", "slip", "settled")
"""Labels that are 0 or 1, of which a stretch has what most of it has."""


class TrackTruth:
    """Labels by column (n,), NaN where not known, at times (n,) in s."""

    def __init__(self, time: Floats, columns: Mapping[str, Floats]) -> None:
        self._time = np.maximum.accumulate(time) if len(time) else time
        self._columns = columns

    def over(self, start: Seconds, stop: Seconds) -> Truth:
        """Return what is known over the time [start, stop): the labels in it, or the latest one before.

        ``contact`` and ``slip`` are what most of the stretch has; all else is the mean over its touched part.
        ``settled`` is 1 where all of it is settled, as far as the labels tell, and no touch begins or ends.
        """
        first, last = np.searchsorted(self._time, [start, stop])
        rows = slice(max(first - 1, 0) if first == last else first, last)
        seen = {name: column[rows] for name, column in self._columns.items()}
        contact = seen.pop("contact", np.zeros(0))
        if not np.isfinite(contact).any():
            return {name: mean for name, column in seen.items() if (mean := _mean(name, column)) is not None}
        touched, known = contact > 0.0, np.isfinite(contact)
        calm = touched.all() or not touched.any()
        settled = seen.pop("settled", np.ones(0))
        truth = {
            "contact": float(2 * touched.sum() >= known.sum()),
            "settled": float(calm and bool((settled[np.isfinite(settled)] > 0.0).all())),
        }
        if truth["contact"]:
            for name, column in seen.items():
                mean = _mean(name, column[touched])
                if mean is not None:
                    truth[name] = mean
        return truth


def _mean(name: str, column: Floats) -> float | None:
    known = column[np.isfinite(column)]
    if not len(known):
        return None
    mean = float(known.mean())
    return float(mean >= 0.5) if name in YES_OR_NO else mean
