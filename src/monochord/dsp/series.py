"""A stiff harmonic series among spectral peaks: its fit, and the evidence for it.

The partials of a stiff string are f_n = n f0 sqrt(1 + B n^2) (Fletcher 1964). Here peaks are given, and the
series is fitted to those that belong to it, then judged against the thought that all of them are clutter.
"""

import numba
import numpy as np

from monochord.types import Floats
from monochord.units import Hertz

PEAK_STD = 0.1
"""Standard deviation of a strong peak's frequency in Hz: partials beat and glide even without noise."""
PEAK_STD_NOISY = 5.5
"""The same for a peak at the noise floor, in Hz for a 0.1 s window."""
MATCH_STD = 1.5
"""Standard deviation of a peak about its partial when series and peaks are compared, in Hz."""
ROBUST_SCALE = 0.8
"""Distance from its partial, in Hz, at which a peak has lost three quarters of its weight in the fit."""
LEAST_B, MOST_B = 0.0, 3.0e-3
MISSING = 0.03
"""Probability that a partial between two strong ones is missing."""
AROUND = 5
"""How many partials on each side tell what height a partial should have."""
DIP = 4.0
"""How far below its weaker neighbour, in nepers of power, a partial counts as missing."""


@numba.njit(cache=True, error_model="numpy", inline="always")
def _partial(f0: float, stiffness: float, n: float) -> float:
    return f0 * n * np.sqrt(1.0 + stiffness * n * n)


@numba.njit(cache=True, error_model="numpy")
def _nearest(sorted_values: Floats, value: float) -> int:
    i = int(np.searchsorted(sorted_values, value))
    if i == 0:
        return 0
    if i == sorted_values.size or value - sorted_values[i - 1] <= sorted_values[i] - value:
        return i - 1
    return i


@numba.njit(cache=True, error_model="numpy")
def partial_count(f0: Hertz, top: Hertz, most: int) -> int:
    """Return how many partials of `f0` lie below `top`, between 1 and `most`."""
    return max(1, min(most, int(top / f0)))


@numba.njit(cache=True, error_model="numpy")
def fit_series(
    f0: Hertz,
    stiffness: float,
    stiffness_prior: tuple[float, float],
    frequency: Floats,
    salience: Floats,
    top: Hertz,
    most: int,
) -> tuple[float, float, float, int]:
    """Fit f0 and B to the peaks near a guess; return f0, B, the standard error of f0, and the matches.

    Gauss-Newton steps of weighted least squares on f_n = n f0 sqrt(1 + B n^2), with a normal prior on B,
    while more partials are let in (6, 12, 24, all) and the search narrows. From the third step on, peaks off
    the series lose weight as under a Cauchy error law squared.

    Parameters
    ----------
    f0, stiffness
        Starting guess of f0 in Hz and of B.
    stiffness_prior
        Mean and standard deviation of B before looking.
    frequency, salience
        Peaks (peaks,), frequencies ascending in Hz.
    top
        Highest frequency to look at, Hz.
    most
        Largest number of partials.
    """
    std, used = np.inf, 0
    for step in range(6):
        count = partial_count(f0, top, min(most, 6 * 2**step))
        prior = 1.0 / stiffness_prior[1] ** 2
        a11, a12, a22 = 0.0, 0.0, prior
        b1, b2 = 0.0, prior * (stiffness_prior[0] - stiffness)
        chi2, weight_sum, used = 0.0, 0.0, 0
        for n in range(1, count + 1):
            stretch = np.sqrt(1.0 + stiffness * n * n)
            k = _nearest(frequency, n * f0 * stretch)
            off = frequency[k] - n * f0 * stretch
            if abs(off) > min(max(12.0, 0.01 * n * f0), 0.3 * f0) / (1.0 + 0.5 * step):
                continue
            variance = PEAK_STD**2 + PEAK_STD_NOISY**2 * np.exp(-salience[k])
            robust = 1.0 / (1.0 + (off / ROBUST_SCALE) ** 2) ** 2 if step > 1 else 1.0
            by_f0, by_stiffness = n * stretch, 0.5 * n**3 * f0 / stretch
            a11 += robust / variance * by_f0 * by_f0
            a12 += robust / variance * by_f0 * by_stiffness
            a22 += robust / variance * by_stiffness * by_stiffness
            b1 += robust / variance * by_f0 * off
            b2 += robust / variance * by_stiffness * off
            chi2 += robust / variance * off * off
            weight_sum += robust
            used += 1
        if used == 0:
            return f0, stiffness, np.inf, 0
        det = a11 * a22 - a12 * a12
        bend = stiffness + (a11 * b2 - a12 * b1) / det
        kept = min(max(bend, LEAST_B), MOST_B)
        f0 += (b1 * a22 - b2 * a12) / det if kept == bend else (b1 - a12 * (kept - stiffness)) / a11
        stiffness = kept
        std = np.sqrt(a22 / det * max(1.0, chi2 / max(weight_sum - 1.0, 1.0)))
    return f0, stiffness, std, used


@numba.njit(cache=True, error_model="numpy")
def series_evidence(
    f0: Hertz,
    stiffness: float,
    frequency: Floats,
    power: Floats,
    rank: Floats,
    salience: Floats,
    spectrum: Floats,
    spacing: Hertz,
    bottom: Hertz,
    top: Hertz,
    most: int,
    residual_weight: float,
) -> float:
    """Return the log evidence for a series over clutter alone, in nats.

    Three parts. (1) Each partial either shows a peak, spread about its place as a normal law, or does not;
    clutter scatters peaks uniformly, and the stronger a peak, the rarer its like in clutter: the density of
    clutter peaks as strong as the k-th strongest is k over the band. (2) A partial that is far weaker than
    partials on both sides counts as missing, which a string seldom does, and which all odd partials of an
    octave-too-low guess do. (3) What the series explains: `residual_weight` ln(total / residual power), which
    a guess that leaves the strongest peak over cannot have.

    Parameters
    ----------
    f0, stiffness
        The series: f0 in Hz and B.
    frequency, power, rank, salience
        Peaks (peaks,): ascending frequency in Hz, power, rank by power from 1, salience.
    spectrum, spacing
        Salience at every bin (bins,) and the distance of two bins in Hz.
    bottom, top
        The band in Hz.
    most
        Largest number of partials.
    residual_weight
        Weight of part (3): half the effective number of independent residuals.
    """
    count = partial_count(f0, top, most)
    height = np.empty(count)
    gain = np.empty(count)
    claimed = np.zeros(frequency.size, np.bool_)
    for n in range(1, count + 1):
        expected = _partial(f0, stiffness, n)
        spread = MATCH_STD * (1.0 + 0.05 * n)
        place = min(int(expected / spacing), spectrum.size - 2)
        height[n - 1] = max(spectrum[place], spectrum[place + 1])
        k = _nearest(frequency, expected)
        off = (frequency[k] - expected) / spread
        if abs(off) < 4.0:
            height[n - 1] = max(height[n - 1], salience[k])
        shown = min(0.1 + 0.6 * np.exp(-(n - 1) / 12.0), 0.9)
        ratio = np.exp(-0.5 * off * off) / (2.5066282746 * spread) * (top / rank[k])
        gain[n - 1] = np.log(1.0 - shown + shown * ratio)
        for j in (k - 1, k, k + 1):
            if 0 <= j < frequency.size and abs(frequency[j] - expected) < 4.0 * spread:
                claimed[j] = True
    evidence = 0.0
    for i in range(count):
        depth = _neighbours(height, i) - DIP - height[i]
        evidence += min(gain[i], np.log(MISSING) - min(0.4 * depth, 3.0)) if depth > 0.0 else gain[i]
    total, residual = 0.0, 0.0
    for j in range(frequency.size):
        if frequency[j] > bottom:
            total += power[j]
            residual += 0.0 if claimed[j] else power[j]
    if total > 0.0:
        evidence += residual_weight * np.log(total / (residual + 1e-4 * total))
    return evidence


@numba.njit(cache=True, error_model="numpy", inline="always")
def _neighbours(height: Floats, i: int) -> float:
    """Return the lower of the greatest heights within `AROUND` partials on the left and on the right."""
    if i + 1 >= height.size:
        return -np.inf
    right = height[i + 1 : i + 1 + AROUND].max()
    return right if i == 0 else min(right, height[max(i - AROUND, 0) : i].max())


@numba.njit(cache=True, error_model="numpy")
def _comb(f0: float, stiffness: float, salience: Floats, spacing: float, top: float, most: int) -> float:
    """Return the mean salience at the partials less that midway between them, low partials weighing more."""
    score, weights = 0.0, 0.0
    limit = salience.size - 2
    for n in range(1, most + 1):
        at = f0 * n * np.sqrt(1.0 + stiffness * n * n)
        if at >= top:
            break
        m = n - 0.5
        between = f0 * m * np.sqrt(1.0 + stiffness * m * m)
        weight = 1.0 / np.sqrt(n)
        i, j = at / spacing, between / spacing
        k, low = min(int(i), limit), min(int(j), limit)
        on = salience[k] + (i - k) * (salience[k + 1] - salience[k])
        off = salience[low] + (j - low) * (salience[low + 1] - salience[low])
        score += weight * (on - off)
        weights += weight
    return score / weights if weights > 0.0 else 0.0


@numba.njit(cache=True, error_model="numpy")
def search(
    grid: Floats,
    stiffnesses: Floats,
    relatives: Floats,
    frequency: Floats,
    power: Floats,
    rank: Floats,
    stands: Floats,
    salience: Floats,
    spacing: float,
    top: float,
    most: int,
    residual_weight: float,
    stiffness_prior: tuple[float, float],
) -> Floats:
    """Return the distinct refined candidates as rows of f0, its standard error, B and evidence."""
    score = np.empty(grid.size)
    best = np.empty(grid.size)
    for i in range(grid.size):
        score[i], best[i] = -np.inf, 0.0
        for stiffness in stiffnesses:
            value = _comb(grid[i], stiffness, salience, spacing, top, most)
            if value > score[i]:
                score[i], best[i] = value, stiffness
    starts = _starts(grid, score, best, relatives)
    rows = np.empty((starts.shape[0], 4))
    count = 0
    for start in starts:
        scale = (start[0] / grid[0]) ** 2
        prior = (stiffness_prior[0] * scale, stiffness_prior[1] * scale)
        f0, stiffness, std, used = fit_series(start[0], start[1], prior, frequency, stands, top, most)
        new = used > 0 and grid[0] <= f0 <= grid[-1]
        for row in rows[:count]:
            new = new and abs(np.log(f0 / row[0])) > 0.0012
        if new:
            evidence = series_evidence(
                f0, stiffness, frequency, power, rank, stands, salience, spacing,
                0.5 * grid[0], top, most, residual_weight,
            )  # fmt: skip
            rows[count] = (f0, std, stiffness, evidence)
            count += 1
    return rows[:count]


@numba.njit(cache=True, error_model="numpy")
def _starts(grid: Floats, score: Floats, best: Floats, relatives: Floats) -> Floats:
    """Return guesses of (f0, B): the ten highest maxima of the comb, and the relatives of the first four."""
    inner = np.array([
        i for i in range(1, grid.size - 1) if score[i] > score[i - 1] and score[i] >= score[i + 1]
    ])  # fmt: skip
    if inner.size == 0:
        inner = np.array([np.argmax(score)])
    top = inner[np.argsort(-score[inner])][:10]
    starts = np.empty((top.size + 4 * relatives.size, 2))
    count = 0
    for k, i in enumerate(top):
        starts[count] = (grid[i], best[i])
        count += 1
        if k < 4:
            for relative in relatives:
                if grid[0] <= grid[i] * relative <= grid[-1]:
                    starts[count] = (grid[i] * relative, 1e-4)
                    count += 1
    return starts[:count]
