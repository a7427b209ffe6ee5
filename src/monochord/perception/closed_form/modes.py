"""The modes that the strongest lines of two microphones are: of both segments, or of the untouched string.

A driver sustains whichever mode of its segment it locked to, so the loudest line of a microphone is mode n of
its segment with n unknown. Two lines a, b and two numbers give a position x and an open frequency f,

    a = n1 f L / x s(n1 / x),  b = n2 f L / (L - x) s(n2 / (L - x)),  s(q) = sqrt(1 + beta q^2),

where beta = pi^3 E d^4 / (64 T) is the string's stiffness (Fletcher 1964). A reading is allowed if f is what
the string's tension can make of it. The best one explains most of the lines.

The estimator and the features share this reader and its constants. They were set by hand on simulated
touches of the prototype, where driver 1 locks to mode 1 in 99 % of touches and driver 2 to modes 1, 2 and 3
in 24, 47 and 28 % (docs/design/0012-features.md). The bundled model and the published results rest on them.
Only how far a force raises the open frequency is an argument: the estimator derives it from the tension law
and its largest force; the features expect no rise beyond `FREE_DEVIATION`, since a press on the prototype
makes less.
"""

from typing import NamedTuple

import numba
import numpy as np

from monochord.core.types import Floats
from monochord.core.units import Hertz, Metres

MAX_MODE_1, MAX_MODE_2 = 4, 6
"""Highest modes that driver 1, tuned low, and driver 2, tuned high, lock to."""
MODE_COST_1, MODE_COST_2 = 0.3, 0.03
"""Cost of the mode that driver 1 or driver 2 sustains, for each e times higher number."""
WEAK_LINE_COST = 0.1
"""Cost of each decade by which a sustained line is weaker than its microphone's strongest."""
CANDIDATE_LINES = 4
"""Strongest lines of each microphone that may be the sustained one."""
MAX_FALL, MAX_RISE = 0.04, 0.02
"""Largest shares by which the open frequency lies below, as a light touch is no clamp, and above expected."""
FREE_DEVIATION = 0.008
"""Share by which it lies below or above at no cost."""
FALL_COST, RISE_COST = 300.0, 1.0e4
"""Costs of the square of the share beyond that, below and above."""
UNTOUCHED_DEVIATION = 0.02
"""Largest share by which the untouched string's frequency lies off nominal."""
END_MARGIN = 0.04
"""Least distance of a touch from either end, as a share of the length."""
SAME_POSITION = 0.01
"""Readings nearer to each other than this share of the length are of the same position."""
NUMBER_COST, OWN_MICROPHONE_GAIN = 0.15, 0.25
"""Cost of a line for each e times higher number; gain for each e times more power at its own microphone."""
UNTOUCHED_GAIN, UNTOUCHED_NUMBER_COST = 0.1, 0.05
"""Gain of the untouched string for being the simpler reading; its own `NUMBER_COST`."""
WEIGHT_DECADES = 4.0
"""Decades of power below the strongest line at which a line's weight is 0."""
TOLERANCE_BINS, TOLERANCE_SHARE = 1.2, 0.003
"""Largest distance of a line from a partial: so many bins plus such a share of its frequency."""
MIN_SHARE = 0.02
"""Least share of a line's power at a microphone that counts."""
MIN_OPPOSITION = 0.4
"""Least difference of two lines' shares at microphone 1 that are clearly of two segments; 0.9 is usual."""

FREQUENCY, WEIGHT, SHARE_1 = range(3)
"""Columns of an array of lines: Hz, 0 to 1, and the share of the power at microphone 1."""
POSITION, OPEN, MODE_1, MODE_2, SCORE, UNEXPLAINED, LINE_1, LINE_2 = range(8)
"""Columns of an array of readings; the lines are ranks by strength, from 0."""


class StringModel(NamedTuple):
    """A string's length in m, nominal open frequency in Hz, stiffness beta in m^2, and what may raise it.

    `rise` is the share by which the largest expected force raises the open frequency, and `slack` the share
    by which it may be tuned off nominal, either way, at no cost: 0 for a string whose tuning is known.
    """

    length: Metres
    nominal: Hertz
    stiffness: float
    rise: float
    slack: float = 0.0


class ModeReading(NamedTuple):
    """The modes that the lines of a window are read as.

    `position` of the touch in m from pickup 1 and `open_frequency` in Hz, as of a clamp; the modes `mode_1`
    and `mode_2` of the sustained lines `line_1` and `line_2` in Hz, and the shares `share_1` and `share_2` of
    their power at microphone 1. `score` is of this reading, `rival_score` of the best one elsewhere, at
    `rival_position`, and `untouched_score` of the untouched string, whose frequency is
    `untouched_frequency` in Hz. `unexplained` is the share of the lines outside both series, `lines` their
    count. Without an allowed reading the position is 0; without a line, all but the scores, which are -1.
    """

    position: Metres
    open_frequency: Hertz
    mode_1: float
    mode_2: float
    score: float
    rival_score: float
    rival_position: Metres
    untouched_score: float
    untouched_frequency: Hertz
    line_1: Hertz
    line_2: Hertz
    share_1: float
    share_2: float
    unexplained: float
    lines: float

    @property
    def touched(self) -> bool:
        """Whether two segments are an allowed reading at all."""
        return self.position > 0.0

    @property
    def opposed(self) -> bool:
        """Whether each of the sustained lines is louder at its own microphone, as only two segments' are."""
        return self.touched and self.share_1 - self.share_2 > MIN_OPPOSITION

    @property
    def uneven(self) -> bool:
        """Whether a sustained line is clearly louder at one microphone: none of the untouched string is."""
        return self.touched and max(abs(self.share_1 - 0.5), abs(self.share_2 - 0.5)) > 0.5 * MIN_OPPOSITION

    @property
    def lead(self) -> float:
        """Lead in score over the best reading that puts the touch elsewhere."""
        return self.score - self.rival_score

    @property
    def contact_lead(self) -> float:
        """Lead in score over the untouched string; negative where that is the better reading."""
        return self.score - self.untouched_score


@numba.njit(cache=True, error_model="numpy")
def read_modes(
    frequency: Floats, height: Floats, power: Floats, spacing: Hertz, string: StringModel
) -> ModeReading:
    """Return the best reading of the strongest lines of two microphones.

    Parameters
    ----------
    frequency, height
        Lines (2, n) in Hz and in power, strongest first; a frequency of 0 is none.
    power
        Power spectra (2, bins).
    spacing
        Distance of two bins in Hz.
    string
        The string.
    """
    lines = _weighted_lines(frequency, height, power, spacing)
    count = float(lines.shape[0])
    if lines.shape[0] == 0:
        return ModeReading(0.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    rest_score, rest = _untouched(lines, string)
    readings = _readings(frequency, height, lines, spacing, string)
    if readings.shape[0] == 0:
        return ModeReading(
            0.0, 0.0, 0.0, 0.0, -1.0, -1.0, 0.0, rest_score, rest, 0.0, 0.0, 0.0, 0.0, 0.0, count
        )
    best = readings[readings[:, SCORE].argmax()]
    rival_score, rival_position = -1.0, 0.0
    for other in readings:
        elsewhere = abs(other[POSITION] - best[POSITION]) > SAME_POSITION * string.length
        if elsewhere and other[SCORE] > rival_score:
            rival_score, rival_position = other[SCORE], other[POSITION]
    line_1, line_2 = frequency[0, int(best[LINE_1])], frequency[1, int(best[LINE_2])]
    return ModeReading(
        best[POSITION],
        best[OPEN],
        best[MODE_1],
        best[MODE_2],
        best[SCORE],
        rival_score,
        rival_position,
        rest_score,
        rest,
        line_1,
        line_2,
        _share_1(power, line_1, spacing),
        _share_1(power, line_2, spacing),
        best[UNEXPLAINED],
        count,
    )


@numba.njit(cache=True, error_model="numpy")
def _weighted_lines(frequency: Floats, height: Floats, power: Floats, spacing: Hertz) -> Floats:
    """Return the lines (lines, 3) of either microphone whose weight is above 0."""
    lines = np.zeros((frequency.size, 3))
    count = 0
    for m in range(2):
        for i in range(frequency.shape[1]):
            if frequency[m, i] <= 0.0:
                break
            weight = 1.0 + np.log10(height[m, i] / height[m, 0]) / WEIGHT_DECADES
            if weight > 0.0:
                lines[count, FREQUENCY], lines[count, WEIGHT] = frequency[m, i], weight
                lines[count, SHARE_1] = _share_1(power, frequency[m, i], spacing)
                count += 1
    return lines[:count]


@numba.njit(cache=True, error_model="numpy")
def _share_1(power: Floats, frequency: Hertz, spacing: Hertz) -> float:
    k = int(np.rint(frequency / spacing))
    return power[0, k] / (power[0, k] + power[1, k])


@numba.njit(cache=True, error_model="numpy")
def _untouched(lines: Floats, string: StringModel) -> tuple[float, Hertz]:
    """Return the untouched string's score and frequency; low and loud partials weigh most in the latter."""
    score = upper = lower = 0.0
    for q in range(lines.shape[0]):
        f, weight, share = lines[q, FREQUENCY], lines[q, WEIGHT], lines[q, SHARE_1]
        number = max(np.rint(f / string.nominal), 1.0)
        base = f / number / np.sqrt(1.0 + string.stiffness * (number / string.length) ** 2)
        if abs(base / string.nominal - 1.0) < UNTOUCHED_DEVIATION:
            balance = np.log(max(4.0 * share * (1.0 - share), MIN_SHARE))
            score += weight * (1.0 - UNTOUCHED_NUMBER_COST * np.log(number) + OWN_MICROPHONE_GAIN * balance)
            upper += weight**2 / number**4 * base
            lower += weight**2 / number**4
        else:
            score -= weight
    frequency = upper / lower if lower > 0.0 else 0.0
    return score / lines[:, WEIGHT].sum() + UNTOUCHED_GAIN, frequency


@numba.njit(cache=True, error_model="numpy")
def _readings(
    frequency: Floats, height: Floats, lines: Floats, spacing: Hertz, string: StringModel
) -> Floats:
    """Return the allowed readings (readings, 8)."""
    length = string.length
    readings = np.zeros((CANDIDATE_LINES * CANDIDATE_LINES * MAX_MODE_1 * MAX_MODE_2, 8))
    count = 0
    for pair in range(CANDIDATE_LINES * CANDIDATE_LINES):
        i, j = pair // CANDIDATE_LINES, pair % CANDIDATE_LINES
        if frequency[0, i] <= 0.0 or frequency[1, j] <= 0.0:
            continue
        weakness = -np.log10(height[0, i] / height[0, 0] * height[1, j] / height[1, 0])
        if weakness > WEIGHT_DECADES:
            continue
        for modes in range(MAX_MODE_1 * MAX_MODE_2):
            n1, n2 = modes // MAX_MODE_2 + 1.0, modes % MAX_MODE_2 + 1.0
            x, own = _located(frequency[0, i], n1, frequency[1, j], n2, string)
            off = own / string.nominal - 1.0
            if not -MAX_FALL - string.slack < off < string.rise + MAX_RISE + string.slack:
                continue
            if not END_MARGIN * length < x < (1.0 - END_MARGIN) * length:
                continue
            sustained = (frequency[0, i] / n1, frequency[1, j] / n2)
            score, unexplained = _explained(lines, x, own, sustained, spacing, string)
            score -= MODE_COST_1 * np.log(n1) + MODE_COST_2 * np.log(n2) + WEAK_LINE_COST * weakness
            if off < 0.0:
                score -= FALL_COST * max(-off - FREE_DEVIATION - string.slack, 0.0) ** 2
            else:
                score -= RISE_COST * max(off - string.rise - FREE_DEVIATION - string.slack, 0.0) ** 2
            row = (x, own, n1, n2, score, unexplained, float(i), float(j))
            for k in range(len(row)):  # one assignment of a row compiles numba's messages about shapes: 6 s
                readings[count, k] = row[k]
            count += 1
    return readings[:count]


@numba.njit(cache=True, error_model="numpy")
def _located(a: Hertz, n1: float, b: Hertz, n2: float, string: StringModel) -> tuple[Metres, Hertz]:
    """Return position and open frequency of a pair of modes, by fixed-point iteration over the stiffness."""
    length, beta = string.length, string.stiffness
    f1, f2 = a / n1, b / n2
    x = length * f2 / (f1 + f2)
    for _ in range(4):
        f1 = a / n1 / np.sqrt(1.0 + beta * (n1 / x) ** 2)
        f2 = b / n2 / np.sqrt(1.0 + beta * (n2 / (length - x)) ** 2)
        x = length * f2 / (f1 + f2)
    return x, f1 * f2 / (f1 + f2)


@numba.njit(cache=True, error_model="numpy")
def _explained(
    lines: Floats,
    x: Metres,
    own: Hertz,
    sustained: tuple[Hertz, Hertz],
    spacing: Hertz,
    string: StringModel,
) -> tuple[float, float]:
    """Return how well two series explain the lines, from -1 to about 1, and the share outside both.

    A line fits a series as a stiff partial, or as a multiple of what its driver sustains: drivers distort.
    """
    length, beta = string.length, string.stiffness
    score = unexplained = 0.0
    for q in range(lines.shape[0]):
        f, weight, share = lines[q, FREQUENCY], lines[q, WEIGHT], lines[q, SHARE_1]
        best = -1.0
        for segment in range(2):
            side = x if segment == 0 else length - x
            own_share = share if segment == 0 else 1.0 - share
            number = max(np.rint(f * side / (own * length)), 1.0)
            partial = number * own * length / side * np.sqrt(1.0 + beta * (number / side) ** 2)
            miss = min(abs(f - partial), abs(f - number * sustained[segment]))
            if miss < TOLERANCE_BINS * spacing + TOLERANCE_SHARE * f:
                gain = OWN_MICROPHONE_GAIN * np.log(2.0 * max(own_share, MIN_SHARE))
                best = max(best, 1.0 - NUMBER_COST * np.log(number) + gain)
        score += weight * best
        unexplained += weight if best == -1.0 else 0.0
    total = lines[:, WEIGHT].sum()
    return score / total, unexplained / total
