"""The modes that the strongest lines of two microphones are: of both segments, or of the untouched string.

A driver sustains whichever mode of its segment it locked to, so the loudest line of a microphone is mode n
of its segment with n unknown. `hypotheses` lists what the lines may be, `place_density` tells how probable
each place is by the spectra alone, and `ranking` how probable each hypothesis is; both are trained across
builds. Hypotheses of one place add up to the most probable place.

Whether anything touches is another question, and two scores set by hand answer it: how well two segments
explain the lines, and how well the untouched string does. They were set on simulated touches of the prototype
(docs/design/features.md), and expect lower modes and an open pitch nearer to nominal than the ranking.

The estimator and the features share this reader. Only how far a force raises the open frequency is an
argument: the estimator derives it from the tension law and its largest force; the features expect no rise
beyond `FREE_DEVIATION`, since a press on the prototype makes less.
"""

from typing import NamedTuple

import numpy as np

from monochord.core.kernels import kernel, part
from monochord.core.types import Floats
from monochord.core.units import Hertz, Metres
from monochord.perception.closed_form import hypotheses, place_density, prominence, ranking
from monochord.perception.closed_form.hypotheses import (
    FREQUENCY,
    GAIN_1,
    LINE_1,
    LINE_2,
    MIN_SHARE,
    MODE_1,
    MODE_2,
    OPEN,
    POSITION,
    SHARE_1,
    TOLERANCE_BINS,
    TOLERANCE_SHARE,
    WEAKNESS_1,
    WEAKNESS_2,
    WEIGHT,
    StringModel,
)
from monochord.perception.closed_form.place_density import PlaceNetwork
from monochord.perception.closed_form.ranking import Ranking

USUAL_MODE_1, USUAL_MODE_2 = 4, 6
"""Highest modes of drivers 1 and 2 that count for contact."""
USUAL_LINES = 4
"""Strongest lines of each microphone that do."""
MODE_COST_1, MODE_COST_2 = 0.3, 0.03
"""Cost of the mode that driver 1 or driver 2 sustains, for each e times higher number."""
WEAK_LINE_COST = 0.1
"""Cost of each decade by which a sustained line is weaker than its microphone's strongest."""
USUAL_FALL, USUAL_RISE = 0.04, 0.02
"""Largest shares by which the open frequency lies below and above expected, to count for contact."""
FREE_DEVIATION = 0.008
"""Share by which it lies below or above at no cost."""
FALL_COST, RISE_COST = 300.0, 1.0e4
"""Costs of the square of the share beyond that, below and above."""
UNTOUCHED_DEVIATION = 0.02
"""Largest share by which the untouched string's frequency lies off nominal."""
SAME_POSITION = 0.012
"""Hypotheses nearer to each other than this share of the length are of the same position."""
SAME_SEGMENTS = 0.003
"""Share within which they differ in little but which multiple of a segment's line is the sustained one."""
MAX_LEAD = 10.0
"""Largest logarithm of the odds of a place."""
NUMBER_COST, OWN_MICROPHONE_GAIN = 0.15, 0.25
"""Cost of a line for each e times higher number; gain for each e times more power at its own microphone."""
UNTOUCHED_GAIN, UNTOUCHED_NUMBER_COST = 0.1, 0.05
"""Gain of the untouched string for being the simpler reading; its own `NUMBER_COST`."""
MIN_OPPOSITION = 0.4
"""Least difference of two lines' shares at microphone 1 that are clearly of two segments; 0.9 is usual."""


class ModeReading(NamedTuple):
    """The modes that the lines of a window are read as.

    `position` of the touch in m from pickup 1 and `open_frequency` in Hz, as of a clamp; the modes `mode_1`
    and `mode_2` of the sustained lines `line_1` and `line_2` in Hz, and the shares `share_1` and `share_2` of
    their power at microphone 1. `lead` is the logarithm of the odds of this place against all others, the
    most probable of which is `rival_position` in m, 0 for none. `score` is how well two segments in usual
    modes explain the lines, and `untouched_score` how well the untouched string does, whose frequency is
    `untouched_frequency` in Hz. `unexplained` is the share of the lines outside both series, `lines` their
    count. Without an allowed reading the position is 0; without a line, all but the scores, which are -1.
    """

    position: Metres
    open_frequency: Hertz
    mode_1: float
    mode_2: float
    score: float
    lead: float
    rival_position: Metres
    seen_position: Metres
    seen_lead: float
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
    def contact_lead(self) -> float:
        """Lead in score over the untouched string; negative where that is the better reading."""
        return self.score - self.untouched_score


NO_READING = ModeReading(
    position=0.0,
    open_frequency=0.0,
    mode_1=0.0,
    mode_2=0.0,
    score=-1.0,
    lead=0.0,
    rival_position=0.0,
    seen_position=0.0,
    seen_lead=0.0,
    untouched_score=-1.0,
    untouched_frequency=0.0,
    line_1=0.0,
    line_2=0.0,
    share_1=0.0,
    share_2=0.0,
    unexplained=0.0,
    lines=0.0,
)
"""Of a window without a line."""


def read_modes(
    frequency: Floats,
    height: Floats,
    power: Floats,
    spacing: Hertz,
    string: StringModel,
    networks: tuple[PlaceNetwork, Ranking],
) -> ModeReading:
    """Return the most probable reading of the strongest lines of two microphones.

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
    networks
        Give places and hypotheses their probabilities. Where the pitch may be another one than in training,
        by slack or rise, only hypotheses have some.
    """
    lines = hypotheses.weighted_lines(frequency, height, power, spacing)
    if not len(lines):
        return NO_READING
    rest_score, rest = _untouched(lines, string)
    above, places = prominence.prominences(power, height), place_density.UNIFORM
    if string.slack == 0.0 and string.rise <= hypotheses.TRAINED_RISE:
        cells = place_density.cells_of(power, height, above, spacing, string)
        places = place_density.density(cells, networks[0])
    seen, probable = place_density.most_probable_place(places)
    nothing = NO_READING._replace(
        seen_position=seen * string.length,
        seen_lead=_log_odds(probable),
        untouched_score=rest_score,
        untouched_frequency=rest,
        lines=float(len(lines)),
    )
    candidates = hypotheses.find_hypotheses(frequency, height, string)
    if not len(candidates):
        return nothing
    position = candidates[:, POSITION] / string.length
    measures = hypotheses.measure_hypotheses(candidates, frequency, height, power, above, spacing, string)
    place_density.measure_places(measures, position, places)
    place, lead, rival = most_probable(position, ranking.probabilities(measures, networks[1]))
    best, score, unexplained = _best_of_place(lines, candidates, place, frequency, spacing, string)
    row: list[float] = candidates[best].tolist()
    line_1, line_2 = float(frequency[0, int(row[LINE_1])]), float(frequency[1, int(row[LINE_2])])
    return nothing._replace(
        position=row[POSITION],
        open_frequency=row[OPEN],
        mode_1=row[MODE_1],
        mode_2=row[MODE_2],
        score=score,
        lead=lead,
        rival_position=float(candidates[rival, POSITION]) if rival >= 0 else 0.0,
        line_1=line_1,
        line_2=line_2,
        share_1=hypotheses.share_1(power, line_1, spacing),
        share_2=hypotheses.share_1(power, line_2, spacing),
        unexplained=unexplained,
    )


@kernel()
def _best_of_place(
    lines: Floats, candidates: Floats, place: int, frequency: Floats, spacing: Hertz, string: StringModel
) -> tuple[int, float, float]:
    """Return the hypothesis that is best by hand of the same segments, the best score, and what it leaves.

    Training tells places apart, not which multiple of a line is sustained. With another the open frequency is
    some per mille off, and so is force.
    """
    position = candidates[:, POSITION] / string.length
    best, best_score, score, unexplained = place, -np.inf, -1.0, 0.0
    for k in range(candidates.shape[0]):
        usual, near = _is_usual(candidates[k], string), abs(position[k] - position[place]) < SAME_SEGMENTS
        if near or usual:
            x, own = candidates[k, POSITION], candidates[k, OPEN]
            sustained = (frequency[0, int(candidates[k, LINE_1])], frequency[1, int(candidates[k, LINE_2])])
            explained, outside = _explained(lines, x, own, sustained, spacing, string)
            explained -= _cost(candidates[k], string)
            score = max(score, explained) if usual else score
            if near and explained > best_score:
                best, best_score, unexplained = k, explained, outside
    return best, score, unexplained


@kernel()
def most_probable(position: Floats, probability: Floats) -> tuple[int, float, int]:
    """Return the best hypothesis of the most probable place, the place's lead, and the best elsewhere or -1.

    `position` (n,) is over the string's length, `probability` (n,) of each hypothesis.
    """
    count = position.size
    together = np.zeros(count)
    for k in range(count):
        for q in range(count):
            if abs(position[k] - position[q]) < SAME_POSITION:
                together[k] += probability[q]
    place = position[together.argmax()]
    best, rival, rest = -1, -1, 0.0
    for k in range(count):
        if abs(position[k] - place) < SAME_POSITION:
            if best < 0 or probability[k] > probability[best]:
                best = k
        else:
            rest += probability[k]
            if rival < 0 or together[k] > together[rival]:
                rival = k
    return best, _log_odds(1.0 - rest), rival


@kernel()
def _log_odds(probability: float) -> float:
    odds = max(probability, 1.0e-9) / max(1.0 - probability, 1.0e-9)
    return min(max(np.log(odds), -MAX_LEAD), MAX_LEAD)


@part()
def _is_usual(hypothesis: Floats, string: StringModel) -> bool:
    off = hypothesis[OPEN] / string.nominal - 1.0
    return (
        hypothesis[MODE_1] <= USUAL_MODE_1
        and hypothesis[MODE_2] <= USUAL_MODE_2
        and max(hypothesis[LINE_1], hypothesis[LINE_2]) < USUAL_LINES
        and -USUAL_FALL - string.slack < off < string.rise + USUAL_RISE + string.slack
    )


@part()
def _cost(hypothesis: Floats, string: StringModel) -> float:
    """Return what a hypothesis loses in score for its modes, its weak lines, and its open frequency."""
    off = hypothesis[OPEN] / string.nominal - 1.0
    modes = MODE_COST_1 * np.log(hypothesis[MODE_1]) + MODE_COST_2 * np.log(hypothesis[MODE_2])
    weakness = WEAK_LINE_COST * (hypothesis[WEAKNESS_1] + hypothesis[WEAKNESS_2])
    if off < 0.0:
        return modes + weakness + FALL_COST * max(-off - FREE_DEVIATION - string.slack, 0.0) ** 2
    return modes + weakness + RISE_COST * max(off - string.rise - FREE_DEVIATION - string.slack, 0.0) ** 2


@kernel()
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


@part()
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
    length = string.length
    sides = (x, length - x)
    fundamentals = (own * length / sides[0], own * length / sides[1])
    betas = (string.stiffness / sides[0] ** 2, string.stiffness / sides[1] ** 2)
    score = unexplained = total = 0.0
    for q in range(lines.shape[0]):
        f, weight = lines[q, FREQUENCY], lines[q, WEIGHT]
        best = -1.0
        for segment in range(2):
            number = max(np.rint(f / fundamentals[segment]), 1.0)
            partial = number * fundamentals[segment] * np.sqrt(1.0 + betas[segment] * number**2)
            miss = min(abs(f - partial), abs(f - number * sustained[segment]))
            if miss < TOLERANCE_BINS * spacing + TOLERANCE_SHARE * f:
                gain = OWN_MICROPHONE_GAIN * lines[q, GAIN_1 + segment]
                best = max(best, 1.0 - NUMBER_COST * np.log(number) + gain)
        score += weight * best
        unexplained += weight if best == -1.0 else 0.0
        total += weight
    return score / total, unexplained / total
