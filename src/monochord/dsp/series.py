"""Fits a stiff harmonic series to spectral peaks, and rates the evidence for it.

The partials of a stiff string are f_n = n f0 sqrt(1 + B n^2) (Fletcher 1964). The series is fitted to the
given peaks that belong to it, then compared with the hypothesis that all peaks are clutter.
"""

from typing import NamedTuple

import numpy as np

from monochord.core.errors import InputError
from monochord.core.kernels import kernel, part
from monochord.core.shapes import alike
from monochord.core.types import Floats
from monochord.core.units import Hertz
from monochord.dsp.spectrum import Peaks

GRID_INHARMONICITY = np.array([0.0, 1e-4, 2.5e-4, 5e-4])
"""Guesses of B."""
RELATIVES = np.array([1 / 5, 1 / 4, 1 / 3, 2 / 5, 1 / 2, 2 / 3, 3 / 4, 4 / 3, 3 / 2, 2.0, 3.0, 4.0])
"""Related series that share many partials with a candidate and must be compared with it."""
PROPOSED, WEIGHED = 10, 4
"""Number of comb maxima examined, and of those whose relatives are examined too."""
CAPTURE = 1.2
"""Initial search range of a peak around its partial, relative to the resolution."""
MATCH = 0.15
"""Standard deviation of a peak about its partial in the comparison, relative to the resolution."""
ROBUST = 0.08
"""Distance at which a peak has a quarter of its weight in the fit, relative to the resolution.
"""
LEAST_B, MOST_B = 0.0, 3.0e-3
MISSING = 0.03
"""Probability that a partial between strong ones is missing."""
NODES, NODE_COST = 5, 4.0
"""Largest k for a pluck at 1/k of the string, which misses every k-th partial, and its cost in nats."""
AROUND = 5
"""Number of partials on each side that determine a partial's expected height."""
DIP = 4.0
"""How far below its weaker side, in nepers of power, a partial counts as missing."""
DISTINCT = 0.0012
"""Series whose f0 differ relatively by less than this are the same."""
COLUMNS = ("frequency", "frequency_std", "inharmonicity", "inharmonicity_std", "evidence")
"""Columns that `search` returns for each series."""


class View(NamedTuple):
    """The spectrum that a search reads, and the limits of the search.

    `salience` is the logarithmic height of the spectrum over its noise floor, (bins,); `spacing` is the bin
    spacing and `resolution` one over the window's duration, in Hz. Peaks count from `bottom` to `top`, in Hz;
    a series has at most `max_partials` partials; for `residual_weight` see `series_evidence`.
    """

    salience: Floats
    spacing: float
    resolution: float
    bottom: float
    top: float
    max_partials: int
    residual_weight: float


@part(inline="always")
def _partial(f0: float, inharmonicity: float, n: float) -> float:
    return f0 * n * np.sqrt(1.0 + inharmonicity * n * n)


@part()
def _nearest(sorted_values: Floats, value: float) -> int:
    i = int(np.searchsorted(sorted_values, value))
    if i == 0:
        return 0
    if i == sorted_values.size or value - sorted_values[i - 1] <= sorted_values[i] - value:
        return i - 1
    return i


@kernel()
def partial_count(f0: Hertz, top: Hertz, max_partials: int) -> int:
    """Return how many partials of `f0` lie below `top`, between 1 and `max_partials`."""
    return max(1, min(max_partials, int(top / f0)))


def fit_series(
    f0: Hertz, inharmonicity: float, prior: tuple[float, float], peaks: Peaks, view: View
) -> tuple[float, float, float, float, int]:
    """Fit f0 and B to the peaks near a guess; return f0, its standard error, B, its standard error, matches.

    The fit takes Gauss-Newton steps of weighted least squares on f_n = n f0 sqrt(1 + B n^2), with a normal
    prior on B, while more partials are included (6, 12, 24, all) and the search range narrows. From the third
    step on, peaks off the series lose weight as under a squared Cauchy error law.

    Parameters
    ----------
    f0, inharmonicity
        Starting guess of f0 in Hz and of B.
    prior
        Prior mean and standard deviation of B.
    peaks, view
        The spectral peaks, and the search limits.
    """
    _check(peaks, view)
    return _fitted(f0, inharmonicity, prior, peaks, view)


@kernel()
def _fitted(
    f0: Hertz, inharmonicity: float, prior: tuple[float, float], peaks: Peaks, view: View
) -> tuple[float, float, float, float, int]:
    std, bend_std, used = np.inf, np.inf, 0
    for step in range(6):
        count = partial_count(f0, view.top, min(view.max_partials, 6 * 2**step))
        weight = 1.0 / prior[1] ** 2
        a11, a12, a22 = 0.0, 0.0, weight
        b1, b2 = 0.0, weight * (prior[0] - inharmonicity)
        chi2, weights, used = 0.0, 0.0, 0
        for n in range(1, count + 1):
            expected = _partial(f0, inharmonicity, n)
            k = _nearest(peaks.frequency, expected)
            off = peaks.frequency[k] - expected
            if abs(off) > min(max(CAPTURE * view.resolution, 0.01 * n * f0), 0.3 * f0) / (1.0 + 0.5 * step):
                continue
            robust = 1.0 / (1.0 + (off / (ROBUST * view.resolution)) ** 2) ** 2 if step > 1 else 1.0
            weight = robust / peaks.variance[k]
            by_f0, by_bend = expected / f0, 0.5 * n**4 * f0**2 / expected
            a11 += weight * by_f0 * by_f0
            a12 += weight * by_f0 * by_bend
            a22 += weight * by_bend * by_bend
            b1 += weight * by_f0 * off
            b2 += weight * by_bend * off
            chi2 += weight * off * off
            weights += robust
            used += 1
        if used == 0:
            return f0, np.inf, inharmonicity, np.inf, 0
        det = a11 * a22 - a12 * a12
        bend = inharmonicity + (a11 * b2 - a12 * b1) / det
        clamped = min(max(bend, LEAST_B), MOST_B)
        f0 += (b1 * a22 - b2 * a12) / det if clamped == bend else (b1 - a12 * (clamped - inharmonicity)) / a11
        inharmonicity = clamped
        excess = np.sqrt(max(1.0, chi2 / max(weights - 1.0, 1.0)))
        std, bend_std = np.sqrt(a22 / det) * excess, np.sqrt(a11 / det) * excess
    return f0, std, inharmonicity, bend_std, used


def series_evidence(f0: Hertz, inharmonicity: float, peaks: Peaks, view: View) -> tuple[float, Floats]:
    """Return the log evidence for a series over clutter alone, in nats, and the power of the peaks it claims.

    It has three parts. (1) Each partial either shows a peak, normally distributed about its frequency, or
    does not; clutter scatters peaks uniformly, and strong clutter is rare: the density of clutter peaks as
    strong as the k-th strongest is k over the band. (2) A partial far weaker than its neighbours on both
    sides counts as missing: on a string this is rare except at the nodes of its pluck, but it holds for all
    odd partials of an octave-too-low guess. (3) The explained power: `residual_weight` ln(total / residual
    power), which is small for a guess that leaves the strongest peak unexplained; the weight is half the
    effective number of independent residuals.
    """
    _check(peaks, view)
    return _evidence(f0, inharmonicity, peaks, view)


@kernel()
def _evidence(f0: Hertz, inharmonicity: float, peaks: Peaks, view: View) -> tuple[float, Floats]:
    count = partial_count(f0, view.top, view.max_partials)
    height = np.empty(count)
    gain = np.empty(count)
    claimed = np.zeros(peaks.frequency.size)
    for n in range(1, count + 1):
        expected = _partial(f0, inharmonicity, n)
        spread = MATCH * view.resolution * (1.0 + 0.05 * n)
        place = min(int(expected / view.spacing), view.salience.size - 2)
        height[n - 1] = max(view.salience[place], view.salience[place + 1])
        k = _nearest(peaks.frequency, expected)
        off = (peaks.frequency[k] - expected) / spread
        if abs(off) < 4.0:
            height[n - 1] = max(height[n - 1], peaks.salience[k])
        shown = min(0.1 + 0.6 * np.exp(-(n - 1) / 12.0), 0.9)
        ratio = np.exp(-0.5 * off * off) / (np.sqrt(2.0 * np.pi) * spread) * (view.top / peaks.rank[k])
        gain[n - 1] = np.log(1.0 - shown + shown * ratio)
        for j in (k - 1, k, k + 1):
            if 0 <= j < peaks.frequency.size and abs(peaks.frequency[j] - expected) < 4.0 * spread:
                claimed[j] = peaks.power[j] if peaks.frequency[j] > view.bottom else 0.0
    evidence = 0.0
    forgiven = np.zeros(NODES + 1)
    for i in range(count):
        evidence += gain[i]
        depth = _neighbours(height, i) - DIP - height[i]
        if depth > 0.0:
            cost = max(gain[i] - np.log(MISSING) + min(0.4 * depth, 3.0), 0.0)
            evidence -= cost
            for k in range(2, NODES + 1):
                forgiven[k] += cost if (i + 1) % k == 0 else 0.0
    evidence += max(forgiven.max() - NODE_COST, 0.0)
    total = np.sum(np.where(peaks.frequency > view.bottom, peaks.power, 0.0))
    if total > 0.0:
        evidence += view.residual_weight * np.log(total / (total - np.sum(claimed) + 1e-4 * total))
        claimed /= total
    return evidence, claimed


@part(inline="always")
def _neighbours(height: Floats, i: int) -> float:
    """Return the lower of the largest heights within `AROUND` partials on the left and on the right."""
    if i + 1 >= height.size:
        return -np.inf
    right = height[i + 1 : i + 1 + AROUND].max()
    return right if i == 0 else min(right, height[max(i - AROUND, 0) : i].max())


@part()
def _comb(f0: float, inharmonicity: float, view: View) -> float:
    """Return the mean salience at the partials minus that midway between them; low partials weigh more."""
    score, weights = 0.0, 0.0
    limit = view.salience.size - 2
    for n in range(1, view.max_partials + 1):
        at = _partial(f0, inharmonicity, n)
        if at >= view.top:
            break
        weight = 1.0 / np.sqrt(n)
        i, j = at / view.spacing, _partial(f0, inharmonicity, n - 0.5) / view.spacing
        k, low = min(int(i), limit), min(int(j), limit)
        on = view.salience[k] + (i - k) * (view.salience[k + 1] - view.salience[k])
        off = view.salience[low] + (j - low) * (view.salience[low + 1] - view.salience[low])
        score += weight * (on - off)
        weights += weight
    return score / weights if weights > 0.0 else 0.0


def search(grid: Floats, prior: tuple[float, float], peaks: Peaks, view: View) -> tuple[Floats, Floats]:
    """Return the distinct series, best first, as rows of `COLUMNS`, and each one's claims on the peaks.

    Claims (series, peaks) are shares of the power of all peaks.

    Relatives of series found on the grid are searched outside it too, so that the octave of a note outside
    the grid is not mistaken for the note.

    Parameters
    ----------
    grid
        Guesses of f0 in Hz (guesses,), ascending in equal ratios.
    prior
        Prior mean and standard deviation of B at the lowest guess; both grow as f0 squared.
    peaks, view
        The spectral peaks, and the search limits.
    """
    _check(peaks, view)
    alike("guesses", grid)
    return _found(grid, prior, peaks, view)


def _check(peaks: Peaks, view: View) -> None:
    """Raise `InputError` unless there are at least one peak and two bins, as the kernels require."""
    alike("peaks", *peaks)
    if view.salience.ndim != 1 or view.salience.size < 2:
        raise InputError(f"salience of shape {view.salience.shape}", "two bins or more")


@kernel()
def _found(grid: Floats, prior: tuple[float, float], peaks: Peaks, view: View) -> tuple[Floats, Floats]:
    starts = _starts(grid, view)
    rows = np.empty((starts.shape[0], len(COLUMNS)))
    claims = np.empty((starts.shape[0], peaks.frequency.size))
    count = 0
    for start in starts:
        scale = (start[0] / grid[0]) ** 2
        here = (min(prior[0] * scale, 0.5 * MOST_B), prior[1] * scale)
        f0, std, bend, bend_std, used = _fitted(start[0], start[1], here, peaks, view)
        new = used > 0
        for row in rows[:count]:
            new = new and abs(np.log(f0 / row[0])) > DISTINCT
        if new:
            evidence, claims[count] = _evidence(f0, bend, peaks, view)
            rows[count] = (f0, std, bend, bend_std, evidence)
            count += 1
    order = np.argsort(-rows[:count, -1])
    return rows[order], claims[order]


@part()
def _starts(grid: Floats, view: View) -> Floats:
    """Return guesses of (f0, B): the ten highest maxima of the comb, and the relatives of the first four."""
    score, best = np.full(grid.size, -np.inf), np.zeros(grid.size)
    for i in range(grid.size):
        for inharmonicity in GRID_INHARMONICITY:
            value = _comb(grid[i], inharmonicity, view)
            if value > score[i]:
                score[i], best[i] = value, inharmonicity
    inner = np.array([
        i for i in range(1, grid.size - 1) if score[i] > score[i - 1] and score[i] >= score[i + 1]
    ])  # fmt: skip
    if inner.size == 0:
        inner = np.array([np.argmax(score)])
    top = inner[np.argsort(-score[inner])][:PROPOSED]
    starts = np.empty((top.size + WEIGHED * RELATIVES.size, 2))
    count = 0
    for k, i in enumerate(top):
        starts[count] = (grid[i], best[i])
        count += 1
        if k < WEIGHED:
            for relative in RELATIVES:
                if view.resolution < grid[i] * relative < 0.5 * view.top:
                    starts[count] = (grid[i] * relative, best[i])
                    count += 1
    return starts[:count]
