"""What may have made the lines of a window: an untouched string, or one that is touched at x.

A touch at x splits the string into two segments with the stiff partials

    f_n = n f0 L r / l sqrt(1 + beta n^2 / l^2),  l = x - s or L - x - s,

where f0 is the open frequency, r what tension and the contact's give make of it, beta = pi^2 E I / T, and s
the length that a point support takes from each side. Each line is a partial of one segment, a sum or
difference of multiples of the two lines that drivers sustain, or clutter. Lines have the likelihood

    prod_k [c_k + (1 - c_k) (a sum_i S_i D_i N(f_k - f_n, s_k) + (1 - a) D(f_k))]

against lines anywhere, with N the normal density about the nearest partial n of segment i. D_i is the
distance of its partials, which weighs every mode alike: a line that fits a denser comb says less. S_i is how
likely its share at microphone 1 is. Two lines with two mode numbers give x and r, and the likelihood is
integrated about them; one line gives x for every r.
"""

from typing import NamedTuple

import numpy as np

from monochord.core.kernels import kernel, part
from monochord.core.types import Floats
from monochord.core.units import Hertz, Metres
from monochord.perception.closed_form.lines import FREQUENCY, LEVEL, MIN_LEVEL, OWN, POWER, STD

RANGE = 0.1
"""Largest share by which a string may be tuned off the pitch that it is known at."""
RATIO_STEP = 2.5e-4
RATIOS = np.arange(0.88, 1.12, RATIO_STEP)
"""Values of r at which its density is kept: `RANGE`, and a little for give and press."""
MIN_DENSITY = -14.0
"""Log density of r below which nothing is explained by it."""
PITCH_STD = 3.0e-3
"""Standard deviation of r: of a measured pitch 2e-3, and drivers pull what they sustain by 2e-3."""
SOFTEST, HARDEST = 1.0e4, 1.0e7
"""Stiffness in N/m of contact, object and mount, one after the other, drawn evenly in its logarithm. They are
light mounts with rubber, and steel bolted to steel. The softest matters: 3e4 makes 3 to 10 % fewer places
right."""
MODEL_STD = 2.0e-3
"""Standard deviation of a partial about its model as a share: contact, mount and ends shift each."""
MAX_MODE = 8
"""Highest mode that a driver sustains."""
DRIVEN = 4
"""Strongest lines of each end that a driver may sustain."""
PARTIAL = 0.67
"""Share of partials among the lines that are no clutter; the others are distortion."""
LEAST_CLUTTER, MOST_CLUTTER, STRONGEST_CLUTTER = 0.03, 0.8, 1.0e-3
"""Share of clutter among strong lines, among the faintest, and of a window's strongest, which is driven."""
NOISE_LEVEL, DECADES = 3.0, 5.0
"""Nepers over which clutter of noise becomes e times as rare, and decades of power in which other lines that
the model leaves out become usual."""
SOURCES, MAX_ORDER, TONE_DECAY, TONE_BINS = 3, 6, 0.7, 0.3
"""Most lines whose sums and differences count, the highest order of these, by how much one is rarer than of
one order less, and the error of one in bins."""
END_MARGIN = 0.04
"""Least distance of a touch from either end, as a share of the length."""
STEPS = 9
"""Values of r at which one line alone is read."""
MAX_EXPLANATIONS = 600

PLACE, RATIO, MODE_1, MODE_2, LINE_1, LINE_2, SCORE = range(7)
"""Columns of explanations: x in m, r, modes (0 of a silent segment), rows of lines, and log evidence."""


class OpenString(NamedTuple):
    """The untouched string: length in m, open frequency without stiffness in Hz, beta in m^2, s in m.

    `pitch` and `ratio` are the log densities of r on `RATIOS`, untouched and touched, as `priors` returns
    them.
    """

    length: Metres
    frequency: Hertz
    stiffness: float
    shortening: Metres
    pitch: Floats
    ratio: Floats


def priors(pitch_std: float, elsewhere: float, rise: float, softness: float) -> tuple[Floats, Floats]:
    """Return the log densities of r on `RATIOS`, of the untouched string and of a touched one.

    `pitch_std` is a share; with the probability `elsewhere` the string is tuned anywhere within `RANGE`
    instead. The largest press raises r by the share `rise`, a lesser one by the square of the force; a
    contact of 1 N/m would lower it by the share `softness`.
    """
    pitch = np.exp(-0.5 * ((RATIOS - 1.0) / pitch_std) ** 2) / (np.sqrt(2.0 * np.pi) * pitch_std)
    pitch = (1.0 - elsewhere) * pitch + 0.5 * elsewhere / RANGE * (np.abs(RATIOS - 1.0) < RANGE)
    parts = (np.arange(16.0) + 0.5) / 16.0
    shift = rise * parts[:, None] ** 2 - softness / (SOFTEST * (HARDEST / SOFTEST) ** parts)
    steps = np.rint(shift / RATIO_STEP).astype(int).ravel()
    lowest = min(int(steps.min()), 0)
    counts = np.bincount(steps - lowest, minlength=1 - lowest) / steps.size
    ratio = np.convolve(pitch, counts)[-lowest : RATIOS.size - lowest]
    return np.log(pitch + 1e-9), np.log(ratio + 1e-9)


@part()
def _density(ratio: float, string: OpenString) -> float:
    at = int((ratio - RATIOS[0]) / RATIO_STEP + 0.5)
    return string.ratio[at] if 0 <= at < string.ratio.size else 2.0 * MIN_DENSITY


@part()
def _of_a_side(share: float) -> float:
    """Return the density of a segment's line over its share of power at its own microphone."""
    return 0.05 + 0.95 * 8.0 * share**7


@part()
def _of_the_whole(share: float) -> float:
    """Return the density of a line of the whole string over its share at microphone 1."""
    return 0.2 + 0.8 * 140.0 * (share * (1.0 - share)) ** 3


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
    """Return how likely each line (n,) is clutter: more near the floor, and far below the strongest."""
    clutter = np.exp(-(lines[:, LEVEL] - MIN_LEVEL) / NOISE_LEVEL)
    clutter = np.maximum(
        clutter, np.minimum(np.log10(lines[:, POWER].max() / lines[:, POWER]) / DECADES, 1.0)
    )
    share = LEAST_CLUTTER + (MOST_CLUTTER - LEAST_CLUTTER) * clutter
    share[lines[:, POWER].argmax()] = STRONGEST_CLUTTER
    return share


@kernel()
def distortion_of(lines: Floats, spacing: Hertz, highest: Hertz) -> Floats:
    """Return the density of each line (n,) as a sum or difference of multiples of stronger ones.

    These are the strongest lines that are none of those before them, up to `SOURCES`; of them it is 0. No
    explanation is credited for it: a line that sounds beside another makes the same tones whatever it is.
    """
    density, sources, count = np.zeros(lines.shape[0]), np.zeros(SOURCES), 0
    for k in np.argsort(-lines[:, POWER]):
        of_stronger = _tones(lines[k], sources[:count], spacing, highest)
        if count < SOURCES and (1.0 - PARTIAL) * of_stronger < 1.0:
            sources[count] = lines[k, FREQUENCY]
            count += 1
        else:
            density[k] = of_stronger
    return density


@part()
def _tones(line: Floats, sources: Floats, spacing: Hertz, highest: Hertz) -> float:
    """Return the density of a line among the tones of pairs of sources, likelier the lower their order."""
    frequency, std = line[FREQUENCY], np.hypot(line[STD], TONE_BINS * spacing)
    density = total = 0.0
    for i in range(sources.size):
        for j in range(i, sources.size):
            for p in range(MAX_ORDER + 1):
                for q in range(-MAX_ORDER, MAX_ORDER + 1):
                    order = p + abs(q)
                    alone = q == 0 or p == 0
                    if not 2 <= order <= MAX_ORDER or (p == 0 and q < 0) or (i == j) != (alone and q == 0):
                        continue
                    tone = abs(p * sources[i] + q * sources[j])
                    if spacing < tone < highest:
                        weight = TONE_DECAY**order
                        total += weight
                        z = (frequency - tone) / std
                        density += weight * np.exp(-0.5 * z * z)
    return density / max(total, 1e-9) * highest / (np.sqrt(2.0 * np.pi) * std)


@part()
def _tooth(line: Floats, side: Metres, ratio: float, string: OpenString) -> tuple[float, float]:
    """Return how near a line is to a partial of a side, 0 to 1, and the density that this has."""
    frequency = line[FREQUENCY]
    variance = line[STD] ** 2 + (MODEL_STD * frequency) ** 2
    miss, spacing = _nearest(frequency, side, ratio, string)
    near = np.exp(-0.5 * miss * miss / variance)
    return near, near * spacing / np.sqrt(2.0 * np.pi * variance)


@part()
def _fit(line: Floats, one: Metres, other: Metres, ratio: float, string: OpenString) -> float:
    """Return the density of a line by both segments; one that may be of either is as loud at any end."""
    near_1, density_1 = _tooth(line, one, ratio, string)
    near_2, density_2 = _tooth(line, other, ratio, string)
    own_1, own_2 = _of_a_side(line[OWN]), _of_a_side(1.0 - line[OWN])
    own_1 += near_2 * max(1.0 - own_1, 0.0)
    own_2 += near_1 * max(1.0 - own_2, 0.0)
    return 0.5 * (own_1 * density_1 + own_2 * density_2)


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
        fits = _fit(lines[k], one, other, ratio, string)
        fits = PARTIAL * fits + (1.0 - PARTIAL) * distortion[k]
        total += np.log(clutter[k] + (1.0 - clutter[k]) * fits)
    return total


@kernel()
def untouched_evidence(lines: Floats, distortion: Floats, string: OpenString) -> float:
    """Return the log evidence of the untouched string, whose partials are alike at both ends."""
    clutter = clutter_of(lines)
    evidence = -np.inf
    for at in range(0, RATIOS.size, 4):
        if string.pitch[at] < MIN_DENSITY:
            continue
        ratio, total = RATIOS[at], string.pitch[at] + np.log(4.0 * RATIO_STEP)
        for k in range(lines.shape[0]):
            fits = _of_the_whole(lines[k, OWN]) * _tooth(lines[k], string.length, ratio, string)[1]
            fits = PARTIAL * fits + (1.0 - PARTIAL) * distortion[k]
            total += np.log(clutter[k] + (1.0 - clutter[k]) * fits)
        evidence = np.logaddexp(evidence, total)
    return evidence


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
def explanations_of(lines: Floats, distortion: Floats, string: OpenString) -> Floats:
    """Return the explanations (n, 7) of lines by a touch: by the lines of both drivers, then by one alone.

    `distortion` is what `distortion_of` returns of them.
    """
    found = np.zeros((MAX_EXPLANATIONS, 7))
    clutter = clutter_of(lines)
    first = np.argsort(-lines[:, POWER] * lines[:, OWN])[:DRIVEN]
    second = np.argsort(-lines[:, POWER] * (1.0 - lines[:, OWN]))[:DRIVEN]
    count = 0
    for a in first:
        for b in second:
            if a != b:
                count = _explain_by_both(lines, clutter, distortion, a, b, string, found, count)
    for side in range(2):
        a = first[0] if side == 0 else second[0]
        count = _explain_by_one(lines, clutter, distortion, a, side, string, found, count)
    return found[:count]


@part()
def _explain_by_both(
    lines: Floats,
    clutter: Floats,
    distortion: Floats,
    a: int,
    b: int,
    string: OpenString,
    found: Floats,
    count: int,
) -> int:
    """Add what two lines may be; return the number of explanations.

    The integral over x and r of both lines' likelihood is x (L - x) / (n1 n2 L) times the densities there.
    """
    length = string.length
    of_drivers = 0.25 * PARTIAL**2 * (1.0 - clutter[a]) * (1.0 - clutter[b])
    of_drivers *= _of_a_side(lines[a, OWN]) * _of_a_side(1.0 - lines[b, OWN])
    for n1 in range(1, MAX_MODE + 1):
        for n2 in range(1, MAX_MODE + 1):
            x, ratio = _located(lines[a, FREQUENCY], n1, lines[b, FREQUENCY], n2, string)
            density = _density(ratio, string)
            if density > MIN_DENSITY and _is_inside(x, length) and count < MAX_EXPLANATIONS:
                integral = x * (length - x) / (n1 * n2 * length**2)
                score = np.log(of_drivers * integral) + density
                score += _evidence(lines, clutter, distortion, x, ratio, a, b, string)
                _fill(found[count], (x, ratio, float(n1), float(n2), float(a), float(b), score))
                count += 1
    return count


@part()
def _explain_by_one(
    lines: Floats,
    clutter: Floats,
    distortion: Floats,
    a: int,
    side: int,
    string: OpenString,
    found: Floats,
    count: int,
) -> int:
    """Add what one line of a side may be while the other is silent; return the number of explanations.

    The integral over x of its likelihood is l / (n L), at each of some values of r.
    """
    length, short = string.length, string.shortening
    loud = _of_a_side(lines[a, OWN] if side == 0 else 1.0 - lines[a, OWN])
    low, high = 1.0 - 4.0 * PITCH_STD, 1.0 + 4.0 * PITCH_STD
    for n in range(1, MAX_MODE + 1):
        for step in range(STEPS):
            ratio = low + (high - low) * (step + 0.5) / STEPS
            flexible = n * string.frequency * length * ratio / lines[a, FREQUENCY]
            half = flexible
            for _ in range(3):
                half = flexible * np.sqrt(1.0 + string.stiffness * (n / half) ** 2)
            x = half + short if side == 0 else length - half - short
            if not _is_inside(x, length) or count == MAX_EXPLANATIONS:
                continue
            near, _ = _tooth(lines[a], length - half - 2.0 * short, ratio, string)
            of_driver = 0.5 * PARTIAL * (1.0 - clutter[a]) * (loud + near * max(1.0 - loud, 0.0))
            integral = half / (n * length) * (high - low) / STEPS
            score = np.log(of_driver * integral) + _density(ratio, string)
            score += _evidence(lines, clutter, distortion, x, ratio, a, a, string)
            modes = (float(n), 0.0) if side == 0 else (0.0, float(n))
            _fill(found[count], (x, ratio, modes[0], modes[1], float(a), float(a), score))
            count += 1
    return count


@part()
def _is_inside(x: Metres, length: Metres) -> bool:
    return END_MARGIN * length < x < (1.0 - END_MARGIN) * length


@part()
def _fill(row: Floats, values: tuple[float, float, float, float, float, float, float]) -> None:
    for k in range(len(values)):  # one assignment of a row compiles numba's messages about shapes: 6 s
        row[k] = values[k]
