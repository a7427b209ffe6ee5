"""The open frequency and the partial numbers that fit the lasting lines of an untouched string.

A driver sustains one or two partials of unknown number. Within `RANGE` of the nominal pitch, the first five
partials cannot be confused: n (1 + RANGE) < (n + 1)(1 - RANGE) for n <= 4, and nearly so for n = 5. Higher
partials can be confused, and so can the lines of a string touched at some positions. Then several lines must
agree; otherwise the tuning stays undecided.

A driven partial lies where the loop phase of its driver closes, up to a few thousandths from the string's
free partial (docs/design/simulators.md). Free partials lie at n f0 sqrt(1 + B n^2) (Fletcher 1964).
Multiples, sums and differences of sustained lines are distortion products and carry no further information.
"""

from typing import NamedTuple

import numpy as np

from monochord.core.kernels import kernel, part
from monochord.core.types import Flags, Floats
from monochord.core.units import Hertz
from monochord.perception.tuning.lines import (
    GROWTH_STD,
    LAST_FREQUENCY,
    LAST_GROWTH,
    LAST_POWER_1,
    LAST_POWER_2,
    LAST_STD,
    PRESENCE,
)

RANGE = 0.1
"""Largest relative deviation of the open frequency from the nominal one: 1.6 semitones."""
RIVAL_RANGE = 0.12
"""Largest relative deviation of rival readings, which the best reading has to beat."""
MAX_NUMBER = 16
"""Highest number of a partial."""
MAX_SEED_NUMBER = 8
"""Highest partial that proposes an open frequency."""
TOLERANCE = 0.004
"""Largest relative distance of a line from its partial, in addition to the effect of unknown stiffness."""
WEIGHT_DECADES = 4.0
"""Decades of power below the strongest line at which a line's weight reaches 0."""
NUMBER_COST = 0.1
"""Cost of a line per factor e in its partial number."""
DISTORTION_ORDER = 3
"""Largest multiple of a sustained line in sums and differences."""
SUSTAINED_DECADES = 1.5
"""Decades of power below the strongest line down to which a line counts as sustained by a driver."""
SAME_TUNING = 0.006
"""Readings whose open frequencies differ by less than this share are one reading."""
SUSTAINED_STD, FREE_STD = 2.0e-3, 1.0e-3
"""Relative standard deviation of a sustained partial and of a free partial from the stiff string's
formula."""
MIN_DECAY = 2.0
"""Smallest decay rate in 1/s of a free partial."""
MAINS: tuple[Hertz, Hertz] = (50.0, 60.0)
MAINS_TOLERANCE: Hertz = 0.4
"""Largest distance of a hum line from a multiple of the mains frequency."""


class TuningReading(NamedTuple):
    """The lasting lines, read as partials of one string.

    `frequency` is f0 in Hz and `inharmonicity` is B, each with its standard error. `score` rates the reading.
    `rival_score` and `rival_frequency` (Hz) belong to the best reading at another open frequency; they are -1
    and 0 without a rival. `explained` is the share of the lines' weight, without hum, that the reading
    explains. `numbers` (lines,) are partial numbers: 0 for a line that is not a partial, negative for a
    distortion product. `humming` says that every explained line may be hum. `decay` is the rate in 1/s at
    which free partials die away, with its standard error; NaN without one.
    """

    frequency: Hertz
    frequency_std: Hertz
    inharmonicity: float
    inharmonicity_std: float
    score: float
    rival_score: float
    rival_frequency: Hertz
    explained: float
    numbers: Floats
    humming: bool
    decay: float
    decay_std: float


@kernel()
def read_tuning(
    lines: Floats, nominal: Hertz, stiffness: tuple[float, float], least_share: float
) -> TuningReading:
    """Return the best reading of lasting lines (n, 9), the strongest first.

    `stiffness` is the mean and standard deviation of the prior for the inharmonicity B, at the nominal pitch.
    `least_share` is the smallest share of a partial's power at either microphone; 0 if one microphone is dead
    or absent.
    """
    weight, hum = _weights(lines), _hums(lines)
    alike = _are_alike(lines, least_share)
    best = second = -1.0
    leading = rival = 0.0
    for seed in range(lines.shape[0]):
        if weight[seed] <= 0.0:
            continue
        for n in range(1, MAX_SEED_NUMBER + 1):
            f0 = lines[seed, LAST_FREQUENCY] / _partial(1.0, stiffness[0], n)
            off = abs(f0 / nominal - 1.0)
            if off > RIVAL_RANGE:
                continue
            score = _score(lines, weight, alike, hum, f0, stiffness)
            if score > best and off <= RANGE:
                if abs(f0 / leading - 1.0) > SAME_TUNING:
                    second, rival = best, leading
                best, leading = score, f0
            elif score > second and abs(f0 / leading - 1.0) > SAME_TUNING:
                second, rival = score, f0
    if best <= -1.0:
        numbers = np.zeros(lines.shape[0])
        return TuningReading(
            0.0, np.inf, stiffness[0], stiffness[1], -1.0, second, rival, 0.0, numbers, False, np.nan, np.nan
        )
    numbers = _numbers(lines, weight, alike, leading, stiffness)
    explained = weight[numbers != 0.0].sum() / weight[(numbers != 0.0) | ~hum].sum()
    humming = weight[hum & (numbers == 0.0)].sum() > weight[numbers != 0.0].sum()
    humming = humming and not ((numbers != 0.0) & (~hum)).any()
    f0, std, bend, bend_std = _fitted(lines, numbers, leading, nominal, stiffness)
    decay, decay_std = _decay(lines, numbers)
    return TuningReading(
        f0, std, bend, bend_std, best, second, rival, explained, numbers, humming, decay, decay_std
    )


@part(inline="always")
def _partial(f0: Hertz, inharmonicity: float, n: float) -> Hertz:
    return f0 * n * np.sqrt(1.0 + inharmonicity * n * n)


@part()
def _weights(lines: Floats) -> Floats:
    """Return the weight (n,) of each line: its power in decades, and how lasting it is."""
    weight = np.zeros(lines.shape[0])
    power = lines[:, LAST_POWER_1] + lines[:, LAST_POWER_2]
    for i in range(lines.shape[0]):
        decades = 1.0 + np.log10(power[i] / power[0]) / WEIGHT_DECADES
        weight[i] = max(decades, 0.0) * lines[i, PRESENCE] ** 2
    return weight


@part()
def _are_alike(lines: Floats, least_share: float) -> Flags:
    """Return which lines (n,) have this share of their power or more at either microphone."""
    alike = np.zeros(lines.shape[0], np.bool_)
    for i in range(lines.shape[0]):
        less = min(lines[i, LAST_POWER_1], lines[i, LAST_POWER_2])
        alike[i] = less >= least_share * (lines[i, LAST_POWER_1] + lines[i, LAST_POWER_2])
    return alike


@part()
def _hums(lines: Floats) -> Flags:
    """Return which lines (n,) lie at a multiple of the mains' frequency."""
    hums = np.zeros(lines.shape[0], np.bool_)
    for i in range(lines.shape[0]):
        for mains in MAINS:
            f = lines[i, LAST_FREQUENCY]
            hums[i] |= abs(f - mains * np.rint(f / mains)) < MAINS_TOLERANCE
    return hums


@part()
def _score(
    lines: Floats, weight: Floats, alike: Flags, hum: Flags, f0: Hertz, stiffness: tuple[float, float]
) -> float:
    """Return how well the partials of `f0` explain the lines, from -1 to 1; hum costs nothing."""
    numbers = _numbers(lines, weight, alike, f0, stiffness)
    score = total = 0.0
    for i in range(lines.shape[0]):
        number = abs(numbers[i])
        if number > 0.0:
            score += weight[i] * max(1.0 - NUMBER_COST * np.log(number), 0.2)
        elif not hum[i]:
            score -= weight[i]
        total += weight[i] if number > 0.0 or not hum[i] else 0.0
    return score / total if total > 0.0 else -1.0


@part()
def _numbers(
    lines: Floats, weight: Floats, alike: Flags, f0: Hertz, stiffness: tuple[float, float]
) -> Floats:
    """Return the number (n,) of each line's partial; negative where distortion makes it, 0 for none."""
    numbers = np.zeros(lines.shape[0])
    bend, bend_std = stiffness
    power = lines[:, LAST_POWER_1] + lines[:, LAST_POWER_2]
    for i in range(lines.shape[0]):
        if weight[i] <= 0.0 or not alike[i]:
            continue
        f, reach = lines[i, LAST_FREQUENCY], 3.0 * lines[i, LAST_STD]
        if power[i] < power[0] and _is_distortion(lines, numbers, i, reach):
            numbers[i] = -max(np.rint(f / f0), 1.0)
            continue
        flexible = np.rint(f / f0)
        for n in range(max(flexible - 2.0, 1.0), flexible + 1.0):
            allowed = (TOLERANCE + n * n * bend_std) * f + reach
            if n <= MAX_NUMBER and abs(f - _partial(f0, bend, n)) < min(allowed, 0.25 * f0):
                numbers[i] = n
    return numbers


@part()
def _is_distortion(lines: Floats, numbers: Floats, i: int, reach: Hertz) -> bool:
    """Return whether a line is a multiple of stronger partials, or a sum or difference of two of them."""
    f = lines[i, LAST_FREQUENCY]
    for a in range(i):
        if numbers[a] <= 0.0:
            continue
        first = lines[a, LAST_FREQUENCY]
        order = np.rint(f / first)
        if order > 1.0 and abs(f - order * first) < reach + order * 3.0 * lines[a, LAST_STD]:
            return True
        for b in range(i):
            if b == a or numbers[b] <= 0.0:
                continue
            for p in range(1, DISTORTION_ORDER + 1):
                left = abs(f - p * first)
                allowed = reach + 3.0 * (p * lines[a, LAST_STD] + lines[b, LAST_STD])
                if abs(left - lines[b, LAST_FREQUENCY]) < allowed:
                    return True
    return False


@part()
def _fitted(
    lines: Floats, numbers: Floats, start: Hertz, nominal: Hertz, stiffness: tuple[float, float]
) -> tuple[float, float, float, float]:
    """Return f0 and B with their standard errors: least squares on f_n / n = f0 (1 + B n^2 / 2)."""
    power = lines[:, LAST_POWER_1] + lines[:, LAST_POWER_2]
    scale = (nominal / start) ** 2  # the same wire under another tension
    f0, bend = start, stiffness[0] * scale
    std = bend_std = np.inf
    for _ in range(3):
        weight = 1.0 / (stiffness[1] * scale) ** 2
        a11, a12, a22 = 0.0, 0.0, weight
        b1, b2, chi2, used = 0.0, weight * (stiffness[0] * scale - bend), 0.0, 0
        for i in range(lines.shape[0]):
            n = numbers[i]
            if n <= 0.0:
                continue
            sustained = power[i] > power[0] * 10.0**-SUSTAINED_DECADES
            model_std = (SUSTAINED_STD if sustained else FREE_STD) * lines[i, LAST_FREQUENCY]
            weight = 1.0 / (model_std**2 + lines[i, LAST_STD] ** 2)
            expected = _partial(f0, bend, n)
            off, by_f0, by_bend = (
                lines[i, LAST_FREQUENCY] - expected,
                expected / f0,
                0.5 * n**4 * f0**2 / expected,
            )
            weight /= 1.0 + 0.25 * off * off * weight  # one line off its partial moves the rest little
            a11 += weight * by_f0 * by_f0
            a12 += weight * by_f0 * by_bend
            a22 += weight * by_bend * by_bend
            b1 += weight * by_f0 * off
            b2 += weight * by_bend * off
            chi2 += weight * off * off
            used += 1
        if used == 0:
            return f0, np.inf, bend, np.inf
        det = a11 * a22 - a12 * a12
        change = (a11 * b2 - a12 * b1) / det
        clamped = max(bend + change, 0.0)
        f0 += (b1 * a22 - b2 * a12) / det if clamped == bend + change else (b1 - a12 * (clamped - bend)) / a11
        bend = clamped
        excess = np.sqrt(max(1.0, chi2 / max(used - 1.0, 1.0)))
        std, bend_std = np.sqrt(a22 / det) * excess, np.sqrt(a11 / det) * excess
    return f0, std, bend, bend_std


@part()
def _decay(lines: Floats, numbers: Floats) -> tuple[float, float]:
    """Return the rate in 1/s at which free partials die away, and its standard error; NaN for none."""
    power = lines[:, LAST_POWER_1] + lines[:, LAST_POWER_2]
    growth, std = lines[:, LAST_GROWTH], lines[:, GROWTH_STD]
    free = (numbers > 0.0) & (power < power[0] * 10.0**-SUSTAINED_DECADES)
    free &= (growth < -MIN_DECAY) & (growth < -3.0 * std)
    if not free.any():
        return np.nan, np.nan
    weight = free / (std**2 + (0.1 * growth) ** 2)
    mean = (weight * growth).sum() / weight.sum()
    spread = (weight * (growth - mean) ** 2).sum() / weight.sum() / free.sum()
    return -mean, np.hypot(weight.sum() ** -0.5, spread**0.5)
