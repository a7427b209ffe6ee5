"""A stiff harmonic series among spectral peaks: its fit, and the evidence for it.

The partials of a stiff string are f_n = n f0 sqrt(1 + B n^2) (Fletcher 1964). Here peaks are given, and the
series is fitted to those that belong to it, then judged against the thought that all of them are clutter.
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
"""Series that share many partials with a candidate and must be weighed against it, inside the grid or not."""
PROPOSED, WEIGHED = 10, 4
"""How many maxima of the comb are looked at, and of how many the relatives too."""
CAPTURE = 1.2
"""How far from its partial a peak is looked for at first, as a share of the resolution."""
MATCH = 0.15
"""Standard deviation of a peak about its partial when series and peaks are compared, likewise."""
ROBUST = 0.08
"""Distance from its partial at which a peak has lost three quarters of its weight in the fit, likewise."""
LEAST_B, MOST_B = 0.0, 3.0e-3
MISSING = 0.03
"""Probability that a partial between strong ones is missing."""
NODES, NODE_COST = 5, 4.0
"""A pluck at a k-th of the string leaves out every k-th partial: up to which k, and its price in nats."""
AROUND = 5
"""How many partials on each side tell what height a partial should have."""
DIP = 4.0
"""How far below its weaker side, in nepers of power, a partial counts as missing."""
DISTINCT = 0.0012
"""Series whose f0 differ by less than this share are one."""
COLUMNS = ("frequency", "frequency_std", "inharmonicity", "inharmonicity_std", "evidence")
"""What `search` returns of each series."""


class View(NamedTuple):
    """The spectrum that a search reads, and the series it looks for.

    `salience` is the logarithmic height of the spectrum over its noise floor, (bins,); `spacing` the distance
    of two bins and `resolution` one over the window's duration, in Hz. Peaks count from `bottom` to `top`, in
    Hz; a series has at most `most` partials; for `residual_weight` see `series_evidence`.
    """

    salience: Floats
    spacing: float
    resolution: float
    bottom: float
    top: float
    most: int
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
def partial_count(f0: Hertz, top: Hertz, most: int) -> int:
    """Return how many partials of `f0` lie below `top`, between 1 and `most`."""
    return max(1, min(most, int(top / f0)))


def fit_series(
    f0: Hertz, inharmonicity: float, prior: tuple[float, float], peaks: Peaks, view: View
) -> tuple[float, float, float, float, int]:
    """Fit f0 and B to the peaks near a guess; return f0, its standard error, B, its standard error, matches.

    Gauss-Newton steps of weighted least squares on f_n = n f0 sqrt(1 + B n^2), with a normal prior on B,
    while more partials are let in (6, 12, 24, all) and the search narrows. From the third step on, peaks off
    the series lose weight as under a Cauchy error law squared.

    Parameters
    ----------
    f0, inharmonicity
        Starting guess of f0 in Hz and of B.
    prior
        Mean and standard deviation of B before looking.
    peaks, view
        What is there, and where to look.
    """
    _check(peaks, view)
    return _fitted(f0, inharmonicity, prior, peaks, view)


@kernel()
def _fitted(
    f0: Hertz, inharmonicity: float, prior: tuple[float, float], peaks: Peaks, view: View
) -> tuple[float, float, float, float, int]:
    std, bend_std, used = np.inf, np.inf, 0
    for step in range(6):
        count = partial_count(f0, view.top, min(view.most, 6 * 2**step))
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

    Three parts. (1) Each partial either shows a peak, spread about its place as a normal law, or does not;
    clutter scatters peaks uniformly, and the stronger a peak, the rarer its like in clutter: the density of
    clutter peaks as strong as the k-th strongest is k over the band. (2) A partial that is far weaker than
    partials on both sides counts as missing, which a string seldom has but at the nodes of its pluck, and
    which all odd partials of an octave-too-low guess are. (3) What the series explains: `residual_weight`
    ln(total / residual power), which a guess that leaves the strongest peak over cannot have; the weight is
    half the effective number of independent residuals.
    """
    _check(peaks, view)
    return _evidence(f0, inharmonicity, peaks, view)


@kernel()
def _evidence(f0: Hertz, inharmonicity: float, peaks: Peaks, view: View) -> tuple[float, Floats]:
    count = partial_count(f0, view.top, view.most)
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
    """Return the lower of the greatest heights within `AROUND` partials on the left and on the right."""
    if i + 1 >= height.size:
        return -np.inf
    right = height[i + 1 : i + 1 + AROUND].max()
    return right if i == 0 else min(right, height[max(i - AROUND, 0) : i].max())


@part()
def _comb(f0: float, inharmonicity: float, view: View) -> float:
    """Return the mean salience at the partials less that midway between them, low partials weighing more."""
    score, weights = 0.0, 0.0
    limit = view.salience.size - 2
    for n in range(1, view.most + 1):
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
    """Return the distinct series found, best first, as rows of `COLUMNS`, and each one's claims on the peaks.

    Claims (series, peaks) are shares of the power of all peaks.

    Relatives of what is found on the grid are found outside it too, so that the octave of a note that lies
    outside does not pass for the note.

    Parameters
    ----------
    grid
        Guesses of f0 in Hz (guesses,), ascending in equal ratios.
    prior
        Mean and standard deviation of B at the lowest guess; both grow as f0 squared.
    peaks, view
        What is there, and where to look.
    """
    _check(peaks, view)
    alike("guesses", grid)
    return _found(grid, prior, peaks, view)


def _check(peaks: Peaks, view: View) -> None:
    """Raise `InputError` unless the kernels can read them: one peak or more, and two bins or more."""
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
