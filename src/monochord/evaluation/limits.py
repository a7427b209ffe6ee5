"""What no estimator can beat: the Cramer-Rao bound, and the noise of the force sensor that gave the truth."""

import math
from dataclasses import dataclass

import numpy as np

from monochord.core.types import Contact, StringParams
from monochord.core.units import Newtons, Seconds
from monochord.evaluation.regression import scored
from monochord.evaluation.results import Results
from monochord.physics.theory import TensionLaw, contact_bound
from monochord.sessions import Session

MOST = 200
"""Windows that the bound is worked out for, spread evenly over all."""
NORMAL = 0.6745
"""Median absolute deviation of a normal error of unit standard deviation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Bound:
    """Errors beside the least that a window allows, both as medians, in m and N.

    `ratio` is in dB, of each partial to the noise, and assumed. `error` is the standard deviation of a normal
    error with the median absolute error that was found; `times` is how often the `bound` goes into it.
    """

    ratio: float
    windows: int
    bound: float
    error: float
    times: float


def against_bound(
    results: Results,
    string: StringParams,
    name: str,
    *,
    ratio: float = 20.0,
    law: TensionLaw = "geometric",
    sample_rate: float = 44100.0,
) -> Bound | None:
    """Return the errors of "position" or "force" against the Cramer-Rao bound; None where there are none.

    The bound is that of `monochord.physics.theory.contact_bound` for the clamped string at each window's true
    position and force. Near a ratio of one nothing is left to gain from the pitch; far above it, what limits
    is not noise but what the estimator does not know of the touch.

    Parameters
    ----------
    results
        Estimates beside the truth.
    string
        Of the sensor.
    name
        "position" or "force".
    ratio
        Of each partial to the noise, in dB.
    law
        How force raises tension.
    sample_rate
        In Hz.

    Examples
    --------
    ``monochord evaluate`` prints what this tells.
    """
    rows = scored(results, "position") & scored(results, "force") & np.isfinite(results.error_of(name))
    part = results.where(rows)
    if not len(part):
        return None
    chosen = np.unique(np.linspace(0, len(part) - 1, min(MOST, len(part))).round().astype(int))
    touches = zip(part.label("position")[chosen].tolist(), part.label("force")[chosen].tolist(), strict=True)
    bounds = [
        contact_bound(
            string,
            Contact(position=place, force=force),
            10.0 ** (0.1 * ratio),
            duration=part.window,
            sample_rate=sample_rate,
            law=law,
        )[("position", "force").index(name)]
        for place, force in touches
        if 0.0 < place < string.length and force > 0.0
    ]
    if not bounds:
        return None
    bound = float(np.median(bounds))
    error = float(np.median(np.abs(part.error_of(name)))) / NORMAL
    times = error / bound if 0.0 < bound < math.inf else math.nan
    return Bound(ratio=ratio, windows=len(part), bound=bound, error=error, times=times)


def force_floor(session: Session, window: Seconds) -> Newtons | None:
    """Return how far the mean of the force readings over a window is off by itself, as a mean absolute error.

    From stretches in which nothing touches, by the session's labels: 0.8 standard deviations of the windows'
    means, less their slow drift. The truth is no better known than this where it was measured, so no estimate
    can be. None where there are no readings or no such stretch.

    Parameters
    ----------
    session
        With a stream ``wrench`` and labels.
    window
        Length in s.

    Examples
    --------
    ``monochord evaluate --sessions`` prints what this tells.
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
        calm = free.size and (free == 0.0).all() and force[rows].size
        means.append(float(force[rows].mean()) if calm else math.nan)
    # Differences of neighbours hold twice the variance, and nothing of the drift.
    steps = np.diff(means)
    steps = steps[np.isfinite(steps)]
    return math.sqrt(2.0 / math.pi) * float(np.std(steps)) / math.sqrt(2.0) if steps.size > 1 else None
