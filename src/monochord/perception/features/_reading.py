"""Which modes of which segment the lines are: both segments of a touched string, or the whole untouched one.

A driver holds its segment at whichever mode it locked to, so the loudest line of a microphone is mode n of
its segment with n unknown. Two lines a, b and two numbers give a position x and a wave speed c,

    a = n1 c / (2 x) s(n1 / x),  b = n2 c / (2 (L - x)) s(n2 / (L - x)),  s(q) = sqrt(1 + beta q^2),

where beta = pi^3 E d^4 / (64 T) is the string's stiffness (Fletcher 1964). A reading is allowed if c / (2
L) is what the string's tension can make of the open frequency. The best of them explains most of the lines.
"""

from typing import NamedTuple

import numba
import numpy as np

from monochord.core.types import Floats
from monochord.core.units import Hertz, Metres

MODES_1, MODES_2 = 4, 6
"""Highest modes that driver 1, tuned low, and driver 2, tuned high, are thought to hold."""
HELD_1, HELD_2 = 0.3, 0.03
"""What a reading loses for each e times higher mode of driver 1, and of driver 2."""
SOFT = 0.1
"""What it loses for each decade by which a line it takes for held is below its microphone's strongest."""
TRIED = 4
"""Strongest lines of each microphone that are tried as its segment's."""
FALL, RISE = 0.04, 0.02
"""Shares by which the open frequency may lie below and above nominal: below, as a light touch is no clamp."""
USUAL = 0.008
"""Share by which it may lie off for nothing."""
DEAR_FALL, DEAR_RISE = 300.0, 1.0e4
"""What a reading loses for the square of more, below and above."""
DRIFT = 0.02
"""Share by which the untouched string may lie off."""
INSIDE = 0.04
"""Readings nearer to an end than this share of the length are not thought of."""
NEAR = 0.01
"""Readings nearer to each other than this share of the length tell the same position."""
HIGH_MODE, OWN_EAR = 0.15, 0.25
"""What a line loses for each e times higher number; gains for each e times louder at its own microphone."""
REST, REST_MODE = 0.1, 0.05
"""What the untouched string gains for being the plainer reading; its own `HIGH_MODE`."""
FAINT = 4.0
"""Decades of power below the strongest line from which a line counts for nothing."""
TOLERANCE_BINS, TOLERANCE_SHARE = 1.2, 0.003
"""How far a line may lie from its place in a series, in bins and as a share of its frequency, added up."""
LEAST_EAR = 0.02
"""Least share of the power that a microphone is taken to hear."""


class Reading(NamedTuple):
    """What the lines of a window are read as, in the order of the kernel's numbers.

    `position` in m from pickup 1 and `open_frequency` in Hz, as of a clamp; `mode_1`, `mode_2`, the numbers
    of the lines read, and `line_1`, `line_2`, these lines in Hz; `share_1`, `share_2`, the share of their
    power that microphone 1 hears; `score` of this reading, of the best `rival` that puts the touch
    elsewhere, at `rival_position`, and of the string `untouched`; `rest_frequency`, the untouched string's
    as its lines tell it, in Hz; `left_over`, the share of the lines that the reading does not explain;
    `lines`, how many there are. Without any allowed reading the position is 0, without a line all is.
    """

    position: Metres
    open_frequency: Hertz
    mode_1: float
    mode_2: float
    score: float
    rival: float
    rival_position: Metres
    untouched: float
    rest_frequency: Hertz
    line_1: Hertz
    line_2: Hertz
    share_1: float
    share_2: float
    left_over: float
    lines: float


@numba.njit(cache=True, error_model="numpy")
def read(
    frequency: Floats,
    height: Floats,
    power: Floats,
    spacing: Hertz,
    string: tuple[Metres, Hertz, float],
) -> Floats:
    """Return the numbers of a `Reading` of the strongest lines of two microphones.

    `frequency` and `height` (2, lines) are in Hz and in power, strongest first, a frequency of 0 being none;
    `power` (2, bins) are the spectra and `spacing` is the distance of two bins. `string` is its length in m,
    its nominal open frequency in Hz and its stiffness beta in m^2.
    """
    told = np.zeros(15)
    told[4:6] = -1.0
    told[7] = -1.0
    heard = _heard(frequency, height, power, spacing)
    if heard.shape[0] == 0:
        return told
    told[14] = heard.shape[0]
    told[7], told[8] = _at_rest(heard, string)
    readings = _readings(frequency, height, heard, spacing, string)
    if readings.shape[0] == 0:
        return told
    best = readings[readings[:, 4].argmax()]
    told[:5] = best[:5]
    for other in readings:
        if abs(other[0] - best[0]) > NEAR * string[0] and other[4] > told[5]:
            told[5], told[6] = other[4], other[0]
    for m in range(2):
        line = frequency[m, int(best[6 + m])]
        told[9 + m] = line
        told[11 + m] = _share(power, line, spacing)
    told[13] = best[5]
    return told


@numba.njit(cache=True, error_model="numpy")
def _heard(frequency: Floats, height: Floats, power: Floats, spacing: Hertz) -> Floats:
    """Return the lines that count, each with weight 0 to 1 and microphone 1's share of it, (lines, 3)."""
    heard = np.zeros((frequency.size, 3))
    count = 0
    for m in range(2):
        for i in range(frequency.shape[1]):
            if frequency[m, i] <= 0.0:
                break
            weight = 1.0 + np.log10(height[m, i] / height[m, 0]) / FAINT
            if weight > 0.0:
                heard[count] = frequency[m, i], weight, _share(power, frequency[m, i], spacing)
                count += 1
    return heard[:count]


@numba.njit(cache=True, error_model="numpy")
def _share(power: Floats, frequency: Hertz, spacing: Hertz) -> float:
    k = int(np.rint(frequency / spacing))
    return power[0, k] / (power[0, k] + power[1, k])


@numba.njit(cache=True, error_model="numpy")
def _at_rest(heard: Floats, string: tuple[Metres, Hertz, float]) -> tuple[float, Hertz]:
    """Return the score of the untouched string, and its frequency: low and loud partials tell it best."""
    length, nominal, beta = string
    score = upper = lower = 0.0
    for q in range(heard.shape[0]):
        f, weight, share = heard[q, 0], heard[q, 1], heard[q, 2]
        number = max(np.rint(f / nominal), 1.0)
        base = f / number / np.sqrt(1.0 + beta * (number / length) ** 2)
        if abs(base / nominal - 1.0) < DRIFT:
            ear = np.log(max(4.0 * share * (1.0 - share), LEAST_EAR))
            score += weight * (1.0 - REST_MODE * np.log(number) + OWN_EAR * ear)
            upper += weight**2 / number**4 * base
            lower += weight**2 / number**4
        else:
            score -= weight
    return score / heard[:, 1].sum() + REST, upper / lower if lower > 0.0 else 0.0


@numba.njit(cache=True, error_model="numpy")
def _readings(
    frequency: Floats,
    height: Floats,
    heard: Floats,
    spacing: Hertz,
    string: tuple[Metres, Hertz, float],
) -> Floats:
    """Return the allowed readings: position, open frequency, modes, score, left over, places of the lines."""
    length, nominal, _ = string
    readings = np.zeros((TRIED * TRIED * MODES_1 * MODES_2, 8))
    found = 0
    for pair in range(TRIED * TRIED):
        i, j = pair // TRIED, pair % TRIED
        if frequency[0, i] <= 0.0 or frequency[1, j] <= 0.0:
            continue
        soft = -np.log10(height[0, i] / height[0, 0] * height[1, j] / height[1, 0])
        if soft > FAINT:
            continue
        for modes in range(MODES_1 * MODES_2):
            n1, n2 = modes // MODES_2 + 1.0, modes % MODES_2 + 1.0
            x, own = _located(frequency[0, i], n1, frequency[1, j], n2, string)
            off = own / nominal - 1.0
            if not (-FALL < off < RISE and INSIDE * length < x < (1.0 - INSIDE) * length):
                continue
            held = (frequency[0, i] / n1, frequency[1, j] / n2)
            score, left = _explained(heard, x, own, held, spacing, string)
            score -= HELD_1 * np.log(n1) + HELD_2 * np.log(n2) + SOFT * soft
            score -= (DEAR_FALL if off < 0.0 else DEAR_RISE) * max(abs(off) - USUAL, 0.0) ** 2
            readings[found] = x, own, n1, n2, score, left, float(i), float(j)
            found += 1
    return readings[:found]


@numba.njit(cache=True, error_model="numpy")
def _located(
    a: Hertz, n1: float, b: Hertz, n2: float, string: tuple[Metres, Hertz, float]
) -> tuple[Metres, Hertz]:
    """Return position and open frequency of a pair of modes, by fixed-point iteration over the stiffness."""
    length, _, beta = string
    f1, f2 = a / n1, b / n2
    x = length * f2 / (f1 + f2)
    for _ in range(4):
        f1 = a / n1 / np.sqrt(1.0 + beta * (n1 / x) ** 2)
        f2 = b / n2 / np.sqrt(1.0 + beta * (n2 / (length - x)) ** 2)
        x = length * f2 / (f1 + f2)
    return x, f1 * f2 / (f1 + f2)


@numba.njit(cache=True, error_model="numpy")
def _explained(
    heard: Floats,
    x: Metres,
    own: Hertz,
    held: tuple[Hertz, Hertz],
    spacing: Hertz,
    string: tuple[Metres, Hertz, float],
) -> tuple[float, float]:
    """Return how well two series explain the lines, from -1 to about 1, and the share they leave over.

    A line fits a series as a stiff partial, or as a multiple of what its driver holds: drivers distort.
    """
    length, _, beta = string
    score = left = 0.0
    for q in range(heard.shape[0]):
        f, weight, share = heard[q, 0], heard[q, 1], heard[q, 2]
        best = -1.0
        for segment in range(2):
            side = x if segment == 0 else length - x
            ear = share if segment == 0 else 1.0 - share
            number = max(np.rint(f * side / (own * length)), 1.0)
            stiff = number * own * length / side * np.sqrt(1.0 + beta * (number / side) ** 2)
            miss = min(abs(f - stiff), abs(f - number * held[segment]))
            if miss < TOLERANCE_BINS * spacing + TOLERANCE_SHARE * f:
                gain = OWN_EAR * np.log(2.0 * max(ear, LEAST_EAR))
                best = max(best, 1.0 - HIGH_MODE * np.log(number) + gain)
        score += weight * best
        left += weight if best == -1.0 else 0.0
    total = heard[:, 1].sum()
    return score / total, left / total
