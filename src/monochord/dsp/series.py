"""Fits a stiff harmonic series to spectral peaks, and rates the evidence for it.

The partials of a stiff string are f_n = n f0 sqrt(1 + B n^2) (Fletcher 1964). The series is fitted to the
given peaks that belong to it, then compared with the hypothesis that all peaks are clutter.
"""

from typing import NamedTuple

import numpy as np

from monochord.core.errors import InputError
from monochord.core.kernels import kernel, part
from monochord.core.shapes import alike
from monochord.core.types import Floats, Indices
from monochord.core.units import Hertz
from monochord.dsp.spectrum import Peaks

GRID_INHARMONICITY = np.array([0.0, 1.5e-4, 4.5e-4])
"""Guesses of B."""
COMB_PARTIALS = 20
"""Largest number of partials of the comb."""
RELATIVES = np.array([1 / 5, 1 / 4, 1 / 3, 2 / 5, 1 / 2, 2 / 3, 3 / 4, 4 / 3, 3 / 2, 2.0, 3.0, 4.0])
"""Related series that share many partials with a candidate and must be compared with it."""
PROPOSED, WEIGHED = 10, 4
"""Number of comb maxima examined, and of those whose relatives are examined too."""
RESOLVED = 3.5
"""Least f0 of a relative outside the comb's range, relative to the resolution: denser lines fit any sound."""
SAME_GUESS = 0.004
"""Guesses whose f0 differ relatively by less than this are the same."""
CAPTURE = 0.6
"""Initial search range of a peak around its partial, relative to the resolution. Farther off, another
source's line beside a low partial bends the whole series."""
MATCH, BROADER = 0.15, 0.05
"""Standard deviation of a peak about its partial in the comparison, relative to the resolution; its relative
growth with each partial."""
CLAIM = 4.0
"""Distance within which a partial explains a peak, in those standard deviations."""
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
HIDDEN = -1.0
"""Salience of bins in which a line of another source, such as mains hum, hides whether there is a partial."""
LEAST_RESIDUAL = 1.0e-4
"""Least residual power, as a share of that of all lines."""
MOST_CHANCE = 0.99
"""Largest share of the band that the partials of a series count as covering."""
DISTINCT = 0.0012
"""Series whose f0 differ relatively by less than this are the same."""
COLUMNS = ("frequency", "frequency_std", "inharmonicity", "inharmonicity_std", "evidence")
"""Columns that `weigh` returns for each series."""


class View(NamedTuple):
    """The spectrum that a search reads, and the limits of the search.

    `salience` is the logarithmic height of the spectrum over its noise floor, (bins,), or `HIDDEN`; `spacing`
    is the bin spacing and `resolution` one over the window's duration, in Hz. Peaks count from `bottom` to
    `top`, in Hz; a series has at most `max_partials` partials. `residual_weight` is the weight in nats of
    the power that a series explains, and `others` the power of the lines of other sources.
    """

    salience: Floats
    spacing: float
    resolution: float
    bottom: float
    top: float
    max_partials: int
    residual_weight: float
    others: float = 0.0


class Comb(NamedTuple):
    """Bins and weights by which the comb rates guesses; see `comb`.

    `guesses` holds f0 in Hz and B, (f0s, Bs, 2); `on` and `between` the bins at the partials and midway below
    them, `weight` the share of each partial, all (f0s, Bs, partials).
    """

    guesses: Floats
    on: Indices
    between: Indices
    weight: Floats


@part(inline="always")
def _partial(f0: float, inharmonicity: float, n: float) -> float:
    return f0 * n * np.sqrt(1.0 + inharmonicity * n * n)


@part(inline="always")
def _nearest(ascending: Floats, value: float, k: int) -> int:
    """Return the index of the nearest number, searched from index `k` upward."""
    while k + 1 < ascending.size and abs(ascending[k + 1] - value) <= abs(ascending[k] - value):
        k += 1
    return k


@part()
def partial_count(f0: Hertz, top: Hertz, max_partials: int) -> int:
    """Return how many partials of `f0` lie below `top`, between 1 and `max_partials`."""
    return max(1, min(max_partials, int(top / f0)))


@part()
def _fitted(
    f0: Hertz, inharmonicity: float, mean: float, deviation: float, peaks: Peaks, view: View
) -> tuple[float, float, float, float, int]:
    """Return f0, its standard error, B, its standard error and the number of matches, fitted near a guess.

    The fit takes Gauss-Newton steps of weighted least squares on f_n = n f0 sqrt(1 + B n^2), with a normal
    prior on B, while more partials are included (6, 12, 24, all) and the search range narrows. From the third
    step on, peaks off the series lose weight as under a squared Cauchy error law.
    """
    std, bend_std, used = np.inf, np.inf, 0
    for step in range(6):
        count = partial_count(f0, view.top, min(view.max_partials, 6 * 2**step))
        weight = 1.0 / deviation**2
        a11, a12, a22 = 0.0, 0.0, weight
        b1, b2 = 0.0, weight * (mean - inharmonicity)
        chi2, weights, used, k = 0.0, 0.0, 0, 0
        for n in range(1, count + 1):
            expected = _partial(f0, inharmonicity, n)
            k = _nearest(peaks.frequency, expected, k)
            off = peaks.frequency[k] - expected
            if abs(off) > min(max(CAPTURE * view.resolution, 0.01 * n * f0), 0.3 * f0) / (1.0 + 0.5 * step):
                continue
            spread = off / (ROBUST * view.resolution)
            robust = 1.0 / ((1.0 + spread * spread) * (1.0 + spread * spread)) if step > 1 else 1.0
            weight = robust / peaks.variance[k]
            by_f0, by_bend = expected / f0, 0.5 * n * n * n * n * f0 * f0 / expected
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


@part()
def _evidence(
    f0: Hertz, inharmonicity: float, peaks: Peaks, view: View, height: Floats, gain: Floats, claimed: Floats
) -> float:
    """Return the log evidence for a series over clutter alone, in nats.

    It has three parts. (1) Each partial either shows a peak, normally distributed about its frequency, or
    does not. Clutter scatters peaks evenly over octaves, as music does, and strong clutter is rare: there are
    k clutter peaks as strong as the k-th strongest. (2) A partial far weaker than its neighbours on both
    sides counts as missing: on a string this is rare except at the nodes of its pluck, but it holds for all
    odd partials of an octave-too-low guess. (3) The explained power, `residual_weight` ln((1 - c) total /
    residual power), where c is the share that an equally dense series explains by chance. It is small for a
    guess that leaves the strongest peak unexplained; the weight is half the effective number of independent
    residuals. Where another source's line hides a partial, the partial is absent, but does not count as
    missing.

    `height`, `gain` and `claimed` are memory for partials and peaks.
    """
    count = partial_count(f0, view.top, view.max_partials)
    for j in range(claimed.size):
        claimed[j] = 0.0
    evidence, k = 0.0, 0
    octaves = np.log(view.top / view.bottom)
    for i in range(count):
        expected = _partial(f0, inharmonicity, i + 1.0)
        spread = MATCH * view.resolution * (1.0 + BROADER * (i + 1.0))
        place = min(int(expected / view.spacing), view.salience.size - 2)
        height[i] = max(view.salience[place], view.salience[place + 1])
        k = _nearest(peaks.frequency, expected, k)
        off = (peaks.frequency[k] - expected) / spread
        shown = min(0.1 + 0.6 * np.exp(-i / 12.0), 0.9)
        gain[i] = np.log(1.0 - shown)
        if abs(off) < 8.0:
            apart = min(expected * octaves, view.top) / peaks.rank[k]
            ratio = np.exp(-0.5 * off * off) / (np.sqrt(2.0 * np.pi) * spread) * apart
            gain[i] = np.log(1.0 - shown + shown * ratio)
        if abs(off) < CLAIM:
            height[i] = max(height[i], peaks.salience[k])
        evidence += gain[i]
        for j in range(max(k - 1, 0), min(k + 2, claimed.size)):
            if abs(peaks.frequency[j] - expected) < CLAIM * spread and peaks.frequency[j] > view.bottom:
                claimed[j] = peaks.power[j]
    evidence -= _missing_cost(height, gain, count)
    return evidence + _power_evidence(f0, count, claimed, peaks, view)


@part()
def _power_evidence(f0: Hertz, count: int, claimed: Floats, peaks: Peaks, view: View) -> float:
    """Return the evidence of the claimed power, less what an equally dense series claims by chance."""
    total = explained = chance = 0.0
    for j in range(claimed.size):
        if peaks.frequency[j] <= view.bottom:
            continue
        explained += claimed[j]
        total += peaks.power[j]
        number = peaks.frequency[j] / f0
        if number < count + 0.5:
            reach = CLAIM * MATCH * view.resolution * (1.0 + BROADER * number)
            chance += peaks.power[j] * min(2.0 * reach / f0, MOST_CHANCE)
    if total == 0.0:
        return 0.0
    least = LEAST_RESIDUAL * (total + view.others)
    share = (1.0 - chance / total) * (total + least) / (total - explained + least)
    return view.residual_weight * np.log(share)


@part()
def _missing_cost(height: Floats, gain: Floats, count: int) -> float:
    """Return the cost in nats of the missing partials, less that of a node of the pluck."""
    total = 0.0
    forgiven = np.zeros(NODES + 1)
    for i in range(count - 1):
        if height[i] == HIDDEN:
            continue
        left, right = -np.inf, -np.inf
        for j in range(i + 1, min(i + 1 + AROUND, count)):
            right = max(right, height[j])
        for j in range(max(i - AROUND, 0), i):
            left = max(left, height[j])
        depth = (right if i == 0 else min(left, right)) - DIP - height[i]
        if depth <= 0.0:
            continue
        cost = max(gain[i] - np.log(MISSING) + min(0.4 * depth, 3.0), 0.0)
        total += cost
        for k in range(2, NODES + 1):
            forgiven[k] += cost if (i + 1) % k == 0 else 0.0
    most = NODE_COST
    for k in range(2, NODES + 1):
        most = max(most, forgiven[k])
    return total - (most - NODE_COST)


def comb(lowest: Hertz, highest: Hertz, ratio: float, view: View) -> Comb:
    """Return the comb for f0 between two bounds in steps of `ratio`, for spectra like that of `view`.

    The comb rates a guess by the mean salience at its partials minus that midway between them; low partials
    weigh more, as 1 / sqrt(n).
    """
    count = int(np.log(highest / lowest) / np.log(ratio)) + 2
    f0, bend = np.meshgrid(lowest * ratio ** np.arange(-1.0, count), GRID_INHARMONICITY, indexing="ij")
    n = np.arange(1.0, min(view.max_partials, COMB_PARTIALS) + 1.0)

    def bins(numbers: Floats) -> Indices:
        stretch = np.sqrt(1.0 + bend[..., np.newaxis] * numbers**2)
        return np.rint(f0[..., np.newaxis] * numbers * stretch / view.spacing).astype(np.int64)

    on, between = bins(n), bins(n - 0.5)
    weight = np.where(on * view.spacing < view.top, 1.0 / np.sqrt(n), 0.0)
    weight /= np.maximum(weight.sum(axis=2, keepdims=True), 1e-30)
    return Comb(np.stack((f0, bend), axis=2), on, between, weight)


def propose(teeth: Comb, view: View) -> Floats:
    """Return guesses of f0 in Hz and B (guesses, 2): the highest maxima of the comb, and their relatives.

    Relatives of the best are guessed outside the comb's range too, so that the octave of a note outside the
    range is not mistaken for the note.
    """
    rise = view.salience.take(teeth.on, mode="clip")
    rise -= view.salience.take(teeth.between, mode="clip")
    rates = np.einsum("ijn,ijn->ij", rise, teeth.weight)
    rate = rates.max(axis=1)
    inner = 1 + np.flatnonzero((rate[1:-1] > rate[:-2]) & (rate[1:-1] >= rate[2:]))
    inner = inner if inner.size else np.array([rate.argmax()])
    top = inner[np.argsort(-rate[inner], kind="stable")][:PROPOSED]
    best = teeth.guesses[top, rates[top].argmax(axis=1)]
    related = best[:WEIGHED, np.newaxis].repeat(RELATIVES.size, axis=1)
    related[:, :, 0] *= RELATIVES
    lowest = min(RESOLVED * view.resolution, float(teeth.guesses[0, 0, 0]))
    inside = (related[:, :, 0] > lowest) & (related[:, :, 0] < 0.5 * view.top)
    return np.concatenate((best, related[inside]))


def weigh(guesses: Floats, prior: tuple[float, float, float], peaks: Peaks, view: View) -> Floats:
    """Return the distinct series near the guesses, best first, as rows of `COLUMNS`.

    Parameters
    ----------
    guesses
        f0 in Hz and B (guesses, 2).
    prior
        A frequency in Hz, and the prior mean and standard deviation of B of a note of that frequency; both
        grow as f0 squared.
    peaks, view
        The spectral peaks, and the search limits.
    """
    rows, used = _weighed(*_checked(guesses, prior, peaks, view))
    rows = rows[used > 0]
    return rows[np.argsort(-rows[:, -1], kind="stable")]


def _checked(
    guesses: Floats, prior: tuple[float, float, float], peaks: Peaks, view: View
) -> tuple[Floats, tuple[float, float, float], Peaks, View]:
    """Return the arguments; raise `InputError` unless there are one peak and two bins, as kernels require."""
    alike("peaks", *peaks)
    if view.salience.ndim != 1 or view.salience.size < 2:
        raise InputError(f"salience of shape {view.salience.shape}", "two bins or more")
    if guesses.ndim != 2 or guesses.shape[1] != 2:
        raise InputError(f"guesses of shape {guesses.shape}", "f0 and B of each")
    return guesses, prior, peaks, view


@kernel()
def _weighed(
    guesses: Floats, prior: tuple[float, float, float], peaks: Peaks, view: View
) -> tuple[Floats, Indices]:
    """Return a row of `COLUMNS` for each guess, and its number of matches: 0 if it is no new series."""
    rows = np.zeros((guesses.shape[0], 5))
    used = np.zeros(guesses.shape[0], np.int64)
    height, gain = np.empty(view.max_partials), np.empty(view.max_partials)
    claimed = np.empty(peaks.frequency.size)
    for i in range(guesses.shape[0]):
        is_new = True
        for j in range(i):
            is_new = is_new and abs(guesses[i, 0] / guesses[j, 0] - 1.0) > SAME_GUESS
        if not is_new:
            continue
        scale = (guesses[i, 0] / prior[0]) ** 2
        mean, deviation = min(prior[1] * scale, 0.5 * MOST_B), prior[2] * scale
        f0, std, bend, bend_std, matches = _fitted(guesses[i, 0], guesses[i, 1], mean, deviation, peaks, view)
        for j in range(i):
            is_new = is_new and (used[j] == 0 or abs(f0 / rows[j, 0] - 1.0) > DISTINCT)
        if is_new and matches > 0:
            rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3] = f0, std, bend, bend_std
            rows[i, 4] = _evidence(f0, bend, peaks, view, height, gain, claimed)
            used[i] = matches
    return rows, used
