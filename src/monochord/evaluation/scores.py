"""Scores of estimates: errors of position and force, detection of contact and slip.

Only windows without lost samples and with a known label are scored; position and force only during contact.
Abstaining brings no advantage: the share within the tolerance and the accuracy are over all these windows, so
an abstention counts as a miss, and every error is reported with the answered share.

An event begins at the start of the first window that overlaps it, even if the overlap is only the window's
last sample, and it is detected at the end of the first window whose probability reaches
`monochord.metrics.DECISION`: a stated delay is up to a hop too long and never too short.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Flags, Floats, Indices
from monochord.core.units import MetresPerSecond, Seconds
from monochord.evaluation.results import Results
from monochord.metrics import (
    DECISION,
    LIMITS,
    area_under_curve,
    bootstrap_interval,
    decision_accuracy,
    detection_delays,
    detection_score,
    false_alarms,
    finite_rows,
    hit_rate,
    mean_absolute_error,
    pearson_r,
    regression_score,
    stretches,
    time_blocks,
)

MIN_SESSIONS = 5
"""Number of sessions from which the bootstrap draws whole sessions, else blocks of `BLOCK_LENGTH`."""
BLOCK_LENGTH: Seconds = 10.0
DRAWS = 400
"""Bootstrap draws for each interval."""
SPEED_BANDS: tuple[tuple[MetresPerSecond, MetresPerSecond], ...] = (
    (0.0, 0.003),
    (0.003, 0.01),
    (0.01, 0.02),
    (0.02, 0.04),
)
"""Bands of the sliding speed in m/s: [low, high)."""
TRIAL_OFFSET: Seconds = 1e5
"""Time between trials placed on one time axis, in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """A number with its 95 % interval; None where there are too few data."""

    value: float | None = None
    low: float | None = None
    high: float | None = None


NO_SCORE = Score()


@dataclass(frozen=True, slots=True, kw_only=True)
class Regression:
    """Errors of a quantity's estimates, in its SI unit.

    `answered` is the share of the `windows` with an estimate. Over these are `mae` (mean absolute error),
    `bias` (mean error), `median` (absolute error), Pearson's `r`, and `covered` (2,): the shares of truths
    within one and two stated standard errors. `within` is the share of all windows with an error of at most
    `limit`. `blocks` names the units of the bootstrap.
    """

    windows: int
    sessions: int
    blocks: str
    limit: float
    answered: float | None = None
    mae: Score = NO_SCORE
    within: Score = NO_SCORE
    r: Score = NO_SCORE
    bias: float | None = None
    median: float | None = None
    covered: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection:
    """Detection scores of a binary label.

    Of the `windows` with known truth, `positive` are positive, and the share `answered` has an estimate.
    `accuracy` is over all of them; `area` under the curve, `brier` score and `calibration` error are over the
    answered ones. `detected` is the share of the `events` with an alarm that began during the event; `delay`
    holds the median and ninetieth percentile of the detection delay, in s. `false_alarms` counts alarms per
    minute in the `quiet` seconds without an event.
    """

    windows: int
    positive: int
    blocks: str
    answered: float | None = None
    accuracy: Score = NO_SCORE
    area: Score = NO_SCORE
    brier: float | None = None
    calibration: float | None = None
    events: int = 0
    detected: float | None = None
    delay: tuple[Seconds, ...] = ()
    quiet: Seconds = 0.0
    false_alarms: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedBand:
    """Detection of sliding in one band of speeds.

    `detected` is the detected share of its sliding `windows`, an abstention being a miss; `area` is the area
    under the curve of these windows against all windows at rest, over the answered ones.
    """

    windows: int
    detected: Score = NO_SCORE
    area: Score = NO_SCORE


def regression_rows(results: Results, name: str) -> Flags:
    """Return which rows (n,) are scored: in contact, without lost samples, and with a label of this name."""
    return (results.label("contact") == 1.0) & results.usable & finite_rows(results.label(name))


def detection_rows(results: Results, name: str) -> Flags:
    """Return which rows (n,) are scored: without lost samples, with a label of 0 or 1."""
    return results.usable & np.isfinite(results.label(name))


def regression(results: Results, name: str, rows: Flags | None = None, *, draws: int = DRAWS) -> Regression:
    """Return the errors of a quantity's estimates; the module states the rules.

    Parameters
    ----------
    results
        Estimates beside the truth.
    name
        Name of label and estimate: "position" or "force".
    rows
        Subset (n,) of `regression_rows` to score; all by default.
    draws
        Bootstrap draws for each interval; 0 for no intervals.

    Raises
    ------
    InputError
        If the quantity has no tolerance.

    Examples
    --------
    ``examples/evaluate_an_estimator.py`` scores an estimator.
    """
    if name not in LIMITS:
        raise InputError(f"quantity '{name}'", ", ".join(LIMITS))
    limit, scored = LIMITS[name], regression_rows(results, name)
    part = results.where(scored if rows is None else rows & scored)
    truth, estimate = part.label(name), part.estimate(name)
    blocks, what = blocks_of(part)
    sessions = len(np.unique(part.of_trials("session")))
    empty = Regression(windows=len(part), sessions=sessions, blocks=what, limit=limit)
    if not len(part):
        return empty
    answered, score = (
        finite_rows(estimate),
        regression_score(truth, estimate, part.std.get(name), limit=limit),
    )
    counted = replace(
        empty,
        answered=score.answered,
        within=score_of(lambda at: hit_rate(truth[at], estimate[at], limit), blocks, draws),
    )
    if not answered.any():
        return counted
    reference, given, number = truth[answered], estimate[answered], blocks[answered]
    return replace(
        counted,
        mae=score_of(lambda at: mean_absolute_error(reference[at], given[at]), number, draws),
        r=score_of(lambda at: pearson_r(reference[at], given[at]), number, draws),
        bias=score.bias,
        median=score.median,
        covered=score.coverage,
    )


def detection(results: Results, name: str, rows: Flags | None = None, *, draws: int = DRAWS) -> Detection:
    """Return the detection scores of a binary label; the module states the rules.

    Parameters
    ----------
    results
        Estimates beside the truth.
    name
        Name of label and estimate: "contact" or "slip"; the estimate is a probability.
    rows
        Rows (n,) to score; all by default.
    draws
        Bootstrap draws for each interval; 0 for no intervals.

    Raises
    ------
    InputError
        If an estimate of this name is not a probability.

    Examples
    --------
    ``monochord evaluate`` prints these scores.
    """
    chosen = np.ones(len(results), bool) if rows is None else rows
    part = results.where(detection_rows(results, name) & chosen)
    blocks, what = blocks_of(part)
    truth, estimate = part.label(name) == 1.0, part.estimate(name)
    empty = Detection(windows=len(part), positive=int(truth.sum()), blocks=what)
    if not len(part) or name not in results.value:
        return empty
    answered = finite_rows(estimate)
    if answered.any() and not (estimate[answered].min() >= 0.0 and estimate[answered].max() <= 1.0):
        given = f"estimates of {name} from {estimate[answered].min():g} to {estimate[answered].max():g}"
        raise InputError(given, "probabilities from 0 to 1")
    score = detection_score(truth, estimate)
    counted = replace(
        _with_events(empty, results.where(chosen), name),
        answered=score.answered,
        accuracy=score_of(lambda at: decision_accuracy(truth[at], estimate[at]), blocks, draws),
    )
    if not answered.any():
        return counted
    return replace(
        counted,
        area=area(truth[answered], estimate[answered], blocks[answered], draws),
        brier=score.brier,
        calibration=score.calibration,
    )


def by_speed(results: Results, *, draws: int = DRAWS) -> dict[str, SpeedBand]:
    """Return the detection of sliding by bands of its speed in m/s, without empty bands.

    The sliding windows of each band are compared with all windows at rest.

    Examples
    --------
    ``monochord evaluate --out FOLDER`` shows them in its report.
    """
    part = results.where(detection_rows(results, "slip"))
    if "slip" not in results.value or not len(part):
        return {}
    speeds, slides, estimate = speed(part), part.label("slip") == 1.0, part.estimate("slip")
    bands: dict[str, SpeedBand] = {}
    for low, high in SPEED_BANDS:
        within = slides & (speeds >= low) & (speeds < high)
        if not within.any():
            continue
        compared = (within | ~slides) & np.isfinite(estimate)
        band = part.where(within)
        right = band.estimate("slip") >= DECISION
        blocks = blocks_of(part.where(compared))[0]
        bands[f"{low:g} to {high:g}"] = SpeedBand(
            windows=len(band),
            detected=score_of(lambda at, right=right: float(right[at].mean()), blocks_of(band)[0], draws),
            area=area(slides[compared], estimate[compared], blocks, draws),
        )
    return bands


def speed(results: Results) -> Floats:
    """Return the labelled sliding speed (n,) in m/s; NaN where neither direction is known."""
    across, along = results.label("slip_across"), results.label("slip_along")
    unknown = np.isnan(across) & np.isnan(along)
    return np.where(unknown, np.nan, np.hypot(np.nan_to_num(across), np.nan_to_num(along)))


def area(truth: Flags, probability: Floats, blocks: Indices, draws: int) -> Score:
    """Return the area under the curve with its interval; no value where only one class occurs."""

    def statistic(at: Indices) -> float:
        return area_under_curve(probability[at][truth[at]], probability[at][~truth[at]])

    return NO_SCORE if truth.all() or not truth.any() else score_of(statistic, blocks, draws)


def blocks_of(results: Results) -> tuple[Indices, str]:
    """Return each row's bootstrap block number (n,), and the kind of block.

    Blocks are whole sessions, over all conditions, from `MIN_SESSIONS` sessions on; else stretches of time.
    """
    names, number = np.unique(results.of_trials("session"), return_inverse=True)
    if len(names) >= MIN_SESSIONS or not len(results):
        return number.astype(np.int64), "sessions"
    return time_blocks(number, results.start, BLOCK_LENGTH), f"stretches of {BLOCK_LENGTH:g} s"


def score_of(statistic: Callable[[Indices], float], blocks: Indices, draws: int = DRAWS) -> Score:
    """Return a statistic of row numbers with its 95 % interval, if there are enough blocks.

    Examples
    --------
    >>> error = np.array([1.0, 2.0, 3.0, 4.0])
    >>> score_of(lambda at: float(error[at].mean()), np.array([0, 0, 0, 0]))
    Score(value=2.5, low=None, high=None)
    """
    value = statistic(np.arange(len(blocks)))
    if np.isnan(value):
        return NO_SCORE
    try:
        low, high = bootstrap_interval(statistic, blocks, seed=0, draws=draws) if draws > 0 else (None, None)
    except InputError:
        low, high = None, None
    return Score(value=value, low=low, high=high)


def _with_events(detection: Detection, results: Results, name: str) -> Detection:
    """Return a detection with its event scores, over all trials on one time axis."""
    label, contact = results.label(name), results.label("contact")
    # A window that holds the start or the end of an event has no label, but belongs to the event.
    transition = {"contact": results.label("transition") == 1.0}
    partly = transition.get(name, np.isnan(label) & (contact == 1.0))
    watched = results.usable & (np.isfinite(label) | partly)
    if not watched.any():
        return detection
    part = results.where(watched)
    on = (part.label(name) == 1.0) | partly[watched]
    begin = part.start + TRIAL_OFFSET * part.trial
    events = stretches(begin, on, part.hop)
    events[:, 1] += part.window - part.hop
    events[:-1, 1] = np.minimum(events[:-1, 1], events[1:, 0])
    alarms = stretches(begin + part.window, part.estimate(name) >= DECISION, part.hop)
    delays = detection_delays(events, alarms)
    quiet = float(part.hop * np.count_nonzero(~on))
    detected = np.isfinite(delays)
    return replace(
        detection,
        events=len(events),
        detected=float(detected.mean()) if len(events) else None,
        delay=tuple(np.quantile(delays[detected], [0.5, 0.9]).round(6).tolist()) if detected.any() else (),
        quiet=quiet,
        false_alarms=60.0 * false_alarms(events, alarms) / quiet if quiet > 0.0 else None,
    )
