"""What may have made the lines of a window: an untouched string, or one that is touched at x.

A touch at x splits the string into two segments with the stiff partials

    f_n = n f0 L r / l sqrt(1 + beta n^2 / l^2),  l = x - s or L - x - s,

where f0 is the open frequency, r what tension and the contact's give make of it, beta = pi^2 E I / T, and s
the length that a point support takes from each side. Each line is a partial of one segment, a sum or difference
of multiples of the two lines that drivers sustain, or clutter, so that the lines have the likelihood

    prod_k [c_k + d D(f_k) + a sum_i S_i D_i / (sqrt(2 pi) s_k) exp(-(f_k - f_n)^2 / (2 s_k^2))],

against lines anywhere. D_i is the distance of a segment's partials, which weighs every mode alike: a line that
fits a denser comb says less. S_i is how likely its share at microphone 1 is. Two lines with two mode numbers
give x and r, and what the likelihood integrates to near there; one line gives x for every r.
"""

from typing import NamedTuple

import numpy as np

from monochord.core.kernels import kernel, part
from monochord.core.types import Floats
from monochord.core.units import Hertz, Metres
from monochord.perception.physics_reader.lines import FREQUENCY, LEVEL, MIN_LEVEL, OWN, POWER, STD

PARTIAL = 0.67
"""Share of partials among the lines that are no clutter; the others are distortion."""
LEAST_CLUTTER, MOST_CLUTTER = 0.03, 0.75
"""Share of clutter among the strongest lines, and among the faintest."""
NOISE_LEVEL, DECADES = 3.0, 5.0
"""Nepers over which clutter of noise becomes e times as rare, and decades of power in which other lines that
the model leaves out become usual."""
MODEL_STD = 1.5e-3
"""Standard deviation of a partial about its model, as a share: contacts, mounts and ends shift each by itself."""
PITCH_STD = 3.0e-3
"""The same of r: of the open pitch 2e-3 (tuning), and drivers pull what they sustain by 2e-3."""
SOFTEST, HARDEST = 1.0e4, 1.0e7
"""Stiffness in N/m of contact, object and mount, one after the other, drawn evenly in its logarithm."""
LOWEST_RATIO, RATIO_STEP = 0.9, 2.5e-4
RATIOS = LOWEST_RATIO + RATIO_STEP * np.arange(601)
MAX_MODE_1, MAX_MODE_2 = 6, 8
DRIVEN = 4
"""Strongest lines of each end that a driver may sustain."""
MAX_ORDER = 8
"""Highest order of a sum or difference."""
END_MARGIN = 0.04
"""Least distance of a touch from either end, as a share of the length."""
STEPS = 9
"""Values of r at which one line alone is read."""
MAX_EXPLANATIONS = 600

PLACE, RATIO, MODE_1, MODE_2, LINE_1, LINE_2, SCORE = range(7)
"""Columns of explanations: x in m, r, mode numbers (0 for a silent segment), rows of lines, and log evidence."""


class OpenString(NamedTuple):
    """The untouched string: length in m, open frequency without stiffness in Hz, beta in m^2, s in m.

    `prior` is the log density of r, as `ratio_prior` returns it.
    """

    length: Metres
    frequency: Hertz
    stiffness: float
    shortening: Metres
    prior: Floats


def ratio_prior(rise: float, softness: float, pitch_std: float) -> Floats:
    """Return the log density of r on `RATIOS`: tension and give are drawn, and the pitch is off.

    The largest press raises r by a share `rise`, a lesser one by its square, and a contact of 1 N/m would
    lower it by `softness`.
    """
    parts = (np.arange(16.0) + 0.5) / 16.0
    press, stiffness = rise * parts[:, None] ** 2, SOFTEST * (HARDEST / SOFTEST) ** parts
    mean = (1.0 + press - softness / stiffness).reshape(-1, 1)
    density = np.exp(-0.5 * ((RATIOS - mean) / pitch_std) ** 2).mean(axis=0)
    return np.log(density / (np.sqrt(2.0 * np.pi) * pitch_std) + 1e-9)


@part()
def _prior(ratio: float, string: OpenString) -> float:
    at = int((ratio - LOWEST_RATIO) / RATIO_STEP + 0.5)
    return string.prior[min(max(at, 0), string.prior.size - 1)]


@part()
def _of_a_side(own: float) -> float:
    """Return the density of a segment's line over its share of power at its own microphone."""
    return 0.05 + 0.95 * 8.0 * own**7


@part()
def _of_the_whole(own: float) -> float:
    """Return the density of a line of the whole string over its share at microphone 1."""
    return 0.2 + 0.8 * 140.0 * (own * (1.0 - own)) ** 3


@part()
def _partial(number: float, side: Metres, ratio: float, string: OpenString) -> Hertz:
    flexible = number * string.frequency * string.length * ratio / side
    return flexible * np.sqrt(1.0 + string.stiffness * (number / side) ** 2)


@part()
def _nearest(frequency: Hertz, side: Metres, ratio: float, string: OpenString) -> tuple[float, float]:
    """Return how far a line is off the nearest partial of a side, in Hz, and their distance there."""
    flexible = string.frequency * string.length * ratio / side
    bend = string.stiffness / side**2
    number = frequency / flexible
    for _ in range(2):
        number = frequency / flexible / np.sqrt(1.0 + bend * number**2)
    number = max(np.rint(number), 1.0)
    stretch = np.sqrt(1.0 + bend * number**2)
    spacing = flexible * (stretch + bend * number**2 / stretch)
    return frequency - number * flexible * stretch, spacing


@kernel()
def clutter_of(lines: Floats) -> Floats:
    """Return of each line (n,) how likely it is clutter: near the floor, or far below the strongest line."""
    clutter = np.exp(-(lines[:, LEVEL] - MIN_LEVEL) / NOISE_LEVEL)
    clutter = np.maximum(
        clutter, np.minimum(np.log10(lines[:, POWER].max() / lines[:, POWER]) / DECADES, 1.0)
    )
    return LEAST_CLUTTER + (MOST_CLUTTER - LEAST_CLUTTER) * clutter


@part()
def _distortion(lines: Floats, a: int, b: int, spacing: Hertz, highest: Hertz, density: Floats) -> None:
    """Fill in of each line (n,) the density of sums and differences of two lines, but for these themselves."""
    fa, fb = lines[a, FREQUENCY], lines[b, FREQUENCY]
    density[:] = 0.0
    total = 0.0
    for p in range(MAX_ORDER + 1):
        for q in range(-MAX_ORDER, MAX_ORDER + 1):
            order = p + abs(q)
            if order < 2 or order > MAX_ORDER or (p == 0 and q < 0) or (a == b and q != 0):
                continue
            tone = abs(p * fa + q * fb)
            if not spacing < tone < highest:
                continue
            weight = 0.7**order
            total += weight
            for k in range(lines.shape[0]):
                std = np.hypot(lines[k, STD], 0.3 * spacing)
                z = (lines[k, FREQUENCY] - tone) / std
                if abs(z) < 4.0:
                    density[k] += weight * highest / (2.5066 * std) * np.exp(-0.5 * z * z)
    if total > 0.0:
        density /= total


@part()
def _evidence(
    lines: Floats,
    clutter: Floats,
    distortion: Floats,
    x: Metres,
    ratio: float,
    a: int,
    b: int,
    string: OpenString,
) -> float:
    """Return the log likelihood of all lines but a and b, at x and r."""
    total = 0.0
    one, other = x - string.shortening, string.length - x - string.shortening
    for k in range(lines.shape[0]):
        if k in (a, b):
            continue
        frequency, own = lines[k, FREQUENCY], lines[k, OWN]
        variance = lines[k, STD] ** 2 + (MODEL_STD * frequency) ** 2
        fits = 0.0
        miss, spacing = _nearest(frequency, one, ratio, string)
        fits += _of_a_side(own) * spacing * np.exp(-0.5 * miss * miss / variance)
        miss, spacing = _nearest(frequency, other, ratio, string)
        fits += _of_a_side(1.0 - own) * spacing * np.exp(-0.5 * miss * miss / variance)
        fits *= 0.5 / np.sqrt(2.0 * np.pi * variance)
        fits = PARTIAL * fits + (1.0 - PARTIAL) * distortion[k]
        total += np.log(clutter[k] + (1.0 - clutter[k]) * fits)
    return total


@kernel()
def untouched_evidence(lines: Floats, spacing: Hertz, highest: Hertz, string: OpenString) -> float:
    """Return the log evidence of the untouched string, whose partials are alike at both ends."""
    clutter, distortion = clutter_of(lines), np.zeros(lines.shape[0])
    strongest = np.argsort(-lines[:, POWER])[:2]
    _distortion(lines, strongest[0], strongest[-1], spacing, highest, distortion)
    best = -np.inf
    for step in range(-6, 7):
        ratio = 1.0 + step / 3.0 * PITCH_STD
        total = -0.5 * (step / 3.0) ** 2
        for k in range(lines.shape[0]):
            frequency, own = lines[k, FREQUENCY], lines[k, OWN]
            variance = lines[k, STD] ** 2 + (MODEL_STD * frequency) ** 2
            miss, apart = _nearest(frequency, string.length, ratio, string)
            fits = _of_the_whole(own) * apart / np.sqrt(2.0 * np.pi * variance)
            fits *= np.exp(-0.5 * miss * miss / variance)
            fits = PARTIAL * fits + (1.0 - PARTIAL) * distortion[k]
            total += np.log(clutter[k] + (1.0 - clutter[k]) * fits)
        best = max(best, total)
    return best


@part()
def _located(a: Hertz, n1: float, b: Hertz, n2: float, string: OpenString) -> tuple[Metres, float]:
    """Return x and r of two lines by their mode numbers, by fixed-point iteration over the stiffness."""
    room = string.length - 2.0 * string.shortening
    one, first, second = 0.5 * room, a / n1, b / n2
    stretch = 1.0
    for _ in range(5):
        other = room - one
        stretch = np.sqrt(1.0 + string.stiffness * (n1 / one) ** 2)
        ratio = stretch / np.sqrt(1.0 + string.stiffness * (n2 / other) ** 2)
        one = room * second * ratio / (first + second * ratio)
    ratio = first / stretch * one / (string.frequency * string.length)
    return one + string.shortening, ratio


@kernel()
def explanations_of(lines: Floats, spacing: Hertz, highest: Hertz, string: OpenString) -> Floats:
    """Return the explanations (n, 7) of lines by a touch, by both drivers' lines or by one."""
    found = np.zeros((MAX_EXPLANATIONS, 7))
    count = 0
    clutter, distortion = clutter_of(lines), np.zeros(lines.shape[0])
    first = np.argsort(-lines[:, POWER] * lines[:, OWN])[:DRIVEN]
    second = np.argsort(-lines[:, POWER] * (1.0 - lines[:, OWN]))[:DRIVEN]
    nearest_end = END_MARGIN * string.length
    for a in first:
        for b in second:
            if a == b:
                continue
            filled = False
            own, other = lines[a, OWN], 1.0 - lines[b, OWN]
            for n1 in range(1, MAX_MODE_1 + 1):
                for n2 in range(1, MAX_MODE_2 + 1):
                    x, ratio = _located(lines[a, FREQUENCY], n1, lines[b, FREQUENCY], n2, string)
                    if not 0.9 < ratio < 1.05 or not nearest_end < x < string.length - nearest_end:
                        continue
                    if count == MAX_EXPLANATIONS:
                        continue
                    if not filled:
                        _distortion(lines, a, b, spacing, highest, distortion)
                        filled = True
                    score = np.log(
                        0.25
                        * PARTIAL**2
                        * (1.0 - clutter[a])
                        * (1.0 - clutter[b])
                        * _of_a_side(own)
                        * _of_a_side(other)
                        * x
                        * (string.length - x)
                        / (n1 * n2 * string.length**2)
                    ) + _prior(ratio, string)
                    score += _evidence(lines, clutter, distortion, x, ratio, a, b, string)
                    row = (x, ratio, float(n1), float(n2), float(a), float(b), score)
                    for column in range(len(row)):
                        found[count, column] = row[column]
                    count += 1
    low, high = 1.0 - 4.0 * PITCH_STD, 1.0 + 4.0 * PITCH_STD
    for side in range(2):
        a = first[0] if side == 0 else second[0]
        own = lines[a, OWN] if side == 0 else 1.0 - lines[a, OWN]
        _distortion(lines, a, a, spacing, highest, distortion)
        for n in range(1, MAX_MODE_2 + 1):
            for step in range(STEPS):
                ratio = low + (high - low) * (step + 0.5) / STEPS
                half = n * string.frequency * string.length * ratio / lines[a, FREQUENCY]
                for _ in range(3):
                    stretch = np.sqrt(1.0 + string.stiffness * (n / half) ** 2)
                    half = n * string.frequency * string.length * ratio / lines[a, FREQUENCY] * stretch
                x = half + string.shortening if side == 0 else string.length - half - string.shortening
                if not nearest_end < x < string.length - nearest_end or count == MAX_EXPLANATIONS:
                    continue
                score = np.log(
                    0.5
                    * PARTIAL
                    * (1.0 - clutter[a])
                    * _of_a_side(own)
                    * half
                    / (n * string.length)
                    * (high - low)
                    / STEPS
                ) + _prior(ratio, string)
                score += _evidence(lines, clutter, distortion, x, ratio, a, a, string)
                row = (x, ratio, float(n * (1 - side)), float(n * side), float(a), float(a), score)
                for column in range(len(row)):
                    found[count, column] = row[column]
                count += 1
    return found[:count]
