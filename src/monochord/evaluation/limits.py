"""Limits of every estimator: the Cramer-Rao bound, and the noise of the force sensor behind the labels."""

import math
from dataclasses import dataclass

import numpy as np

from monochord.core.types import Contact, StringParams
from monochord.core.units import Metres, Newtons, Seconds
from monochord.evaluation.results import Results
from monochord.evaluation.scores import regression_rows
from monochord.physics.theory import contact_bound
from monochord.sessions import SessionReader

MAX_BOUND_WINDOWS = 200
"""The bound is computed for this many windows, spread evenly over all."""
TENSION_KNOWN, ENDS_KNOWN = 1e-3, 1e-4
"""Assumed accuracy of a sensor's tension (relative) and of its ends' positions (m)."""
SAMPLE_RATE = 44100.0
MEDIAN_OF_NORMAL = 0.6745
"""Median absolute value of a normal variable of unit standard deviation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BoundComparison:
    """Errors beside the smallest possible ones for a window, both as medians, in m or N.

    `ratio` is the assumed signal-to-noise ratio of each partial in dB. `error` is the standard deviation of a
    normal error with the measured median absolute error. `times` is `error` over `bound`, the bound from
    white noise alone. `times_built` is `error` over `bound_built`, the bound from two pitches where tension
    and ends are known to `TENSION_KNOWN` and `ENDS_KNOWN`. Neither includes the untouched pitch, which lowers
    `bound_built`, nor the lengthening of the segments by contact and mount, which raises it.
    """

    ratio: float
    windows: int
    bound: float
    bound_built: float
    error: float
    times: float
    times_built: float


def compare_with_bound(
    results: Results,
    string: StringParams,
    name: str,
    *,
    ratio: float = 20.0,
) -> BoundComparison | None:
    """Compare the errors of "position" or "force" with the Cramer-Rao bound; None if there are no errors.

    The bound is `monochord.physics.theory.contact_bound` for the clamped string at each window's true
    position and force: for a perfectly known sensor, and for one with tension and ends known as assumed. An
    error far above the first bound is not due to noise; see `BoundComparison` for what the second omits.

    `ratio` is the signal-to-noise ratio of each partial in dB.
    """
    rows = regression_rows(results, "position") & regression_rows(results, "force")
    part = results.where(rows & np.isfinite(results.error_of(name)))
    if not len(part):
        return None
    chosen = np.unique(np.linspace(0, len(part) - 1, min(MAX_BOUND_WINDOWS, len(part))).round().astype(int))
    touches = zip(part.label("position")[chosen].tolist(), part.label("force")[chosen].tolist(), strict=True)
    contacts = [
        Contact(position=position, force=force)
        for position, force in touches
        if 0.0 < position < string.length and force > 0.0
    ]
    if not contacts:
        return None

    def bound(tension_std: Newtons, end_std: Metres) -> float:
        each = [
            contact_bound(
                string,
                contact,
                10.0 ** (0.1 * ratio),
                duration=part.window,
                sample_rate=SAMPLE_RATE,
                law="geometric",
                tension_std=tension_std,
                end_std=end_std,
            )[("position", "force").index(name)]
            for contact in contacts
        ]
        return float(np.median(each))

    error = float(np.median(np.abs(part.error_of(name)))) / MEDIAN_OF_NORMAL
    exact, built = bound(0.0, 0.0), bound(TENSION_KNOWN * string.tension, ENDS_KNOWN)
    return BoundComparison(
        ratio=ratio,
        windows=len(part),
        bound=exact,
        bound_built=built,
        error=error,
        times=_ratio(error, exact),
        times_built=_ratio(error, built),
    )


def _ratio(error: float, bound: float) -> float:
    return error / bound if 0.0 < bound < math.inf else math.nan


def force_floor(session: SessionReader, window: Seconds) -> Newtons | None:
    """Return the mean absolute error of the mean force reading of a window of `window` s, in N.

    Measured in a session's stretches without contact, by its labels: 0.8 standard deviations of the windows'
    means, minus their slow drift. It limits the accuracy of measured labels, so no estimate can score better.
    None where there is no stream ``wrench``, no reading or no such stretch.
    """
    if "wrench" not in session.streams or "contact" not in session.labels.columns:
        return None
    track, labels = session.readings("wrench"), session.labels
    force, time = track.column("fz"), track.time
    begins = np.arange(time[0], time[-1] - window, window) if len(time) else np.zeros(0)
    means: list[float] = []
    for begin in begins.tolist():
        first, last = np.searchsorted(labels.time, [begin - window, begin + 2 * window])
        free = labels.columns["contact"][first:last]
        rows = slice(*np.searchsorted(time, [begin, begin + window]).tolist())
        untouched = free.size and (free == 0.0).all() and force[rows].size
        means.append(float(force[rows].mean()) if untouched else math.nan)
    # Differences of neighbours have twice the variance, and none of the drift.
    steps = np.diff(means)
    steps = steps[np.isfinite(steps)]
    return math.sqrt(2.0 / math.pi) * float(np.std(steps)) / math.sqrt(2.0) if steps.size > 1 else None
