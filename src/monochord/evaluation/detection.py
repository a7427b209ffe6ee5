"""How well contact and sliding are told: window by window, and as events.

A window for which an estimator abstains counts as told wrong. An event begins where the first window does
that it reaches into, though it may be that window's last moment, and it is told at the end of the first
window whose probability is above one half: so a delay is up to a hop too long, and never too short.
"""

from dataclasses import dataclass, replace

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import MetresPerSecond, Seconds
from monochord.evaluation.regression import DRAWS, NONE, Blocks, Rows, Score, blocks_of, score_of
from monochord.evaluation.results import Results
from monochord.metrics import (
    DECISION,
    area_under_curve,
    decision_accuracy,
    detection_delays,
    detection_score,
    false_alarms,
    known,
    stretches,
)

SPEEDS: tuple[tuple[MetresPerSecond, MetresPerSecond], ...] = (
    (0.0, 0.003),
    (0.003, 0.01),
    (0.01, 0.02),
    (0.02, 0.04),
)
"""Bands of the sliding speed: [low, high)."""
APART: Seconds = 1e5
"""How far trials are set apart to be counted as one run of time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection:
    """How well a yes or no is told.

    Of `windows` of known truth, `positive` are yes, and the share `answered` was told at all; `accuracy` is
    of all of them, `area` under the curve, `brier` score and `calibration` error of the answered ones.
    `found` is the share of the `events` that were told while they lasted; `delay` has the median and the
    ninetieth percentile of how long that took, in s, of those found. `false_alarms` are alarms a minute of
    the `quiet` seconds in which there was nothing to tell.
    """

    windows: int
    positive: int
    blocks: str
    answered: float | None = None
    accuracy: Score = NONE
    area: Score = NONE
    brier: float | None = None
    calibration: float | None = None
    events: int = 0
    found: float | None = None
    delay: tuple[Seconds, ...] = ()
    quiet: Seconds = 0.0
    false_alarms: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """How well one band of speeds is told: of its sliding `windows` the share `found`, abstentions not.

    `area` is under the curve of these against all windows at rest, as far as they were answered.
    """

    windows: int
    found: Score = NONE
    area: Score = NONE


def judged(results: Results, name: str) -> Rows:
    """Return the rows (n,) whose answer is known: recorded whole, with a label of 0 or 1."""
    return results.usable & np.isfinite(results.label(name))


def detection(results: Results, name: str, rows: Rows | None = None, *, draws: int = DRAWS) -> Detection:
    """Return how well a yes or no is told; the module tells the rules.

    Parameters
    ----------
    results
        Estimates beside the truth.
    name
        Of label and estimate: "contact" or "slip"; the estimate is a probability.
    rows
        Trials or windows that are looked at (n,); all by default.
    draws
        For each interval; 0 for none.

    Raises
    ------
    InputError
        If an estimate of this name is no probability.

    Examples
    --------
    ``monochord evaluate`` prints what this tells.
    """
    within = np.ones(len(results), bool) if rows is None else rows
    part = results.where(judged(results, name) & within)
    blocks, what = blocks_of(part)
    truth, told = part.label(name) == 1.0, part.estimate(name)
    blank = Detection(windows=len(part), positive=int(truth.sum()), blocks=what)
    if not len(part) or name not in results.value:
        return blank
    answered = known(told)
    if answered.any() and not (told[answered].min() >= 0.0 and told[answered].max() <= 1.0):
        given = f"estimates of {name} from {told[answered].min():g} to {told[answered].max():g}"
        raise InputError(given, "probabilities of 0 to 1")
    score = detection_score(truth, told)
    share = replace(
        _as_events(results.where(within), name, blank),
        answered=score.answered,
        accuracy=score_of(lambda at: decision_accuracy(truth[at], told[at]), blocks, draws),
    )
    if not answered.any():
        return share
    true, said = truth[answered], told[answered]
    return replace(
        share,
        area=area(true, said, blocks[answered], draws),
        brier=score.brier,
        calibration=score.calibration,
    )


def by_speed(results: Results, *, draws: int = DRAWS) -> dict[str, Band]:
    """Return how well sliding is told from rest, by bands of its speed in m/s; empty bands are left out.

    Each band's sliding windows stand beside all windows at rest.

    Examples
    --------
    ``monochord evaluate`` prints what this tells.
    """
    part = results.where(judged(results, "slip"))
    if "slip" not in results.value or not len(part):
        return {}
    fast, slides, told = speed(part), part.label("slip") == 1.0, part.estimate("slip")
    found: dict[str, Band] = {}
    for low, high in SPEEDS:
        within = slides & (fast >= low) & (fast < high)
        if not within.any():
            continue
        beside = (within | ~slides) & np.isfinite(told)
        band, both = part.where(within), part.where(beside)
        right = band.estimate("slip") >= DECISION
        found[f"{low:g} to {high:g}"] = Band(
            windows=len(band),
            found=score_of(lambda at, right=right: float(right[at].mean()), blocks_of(band)[0], draws),
            area=area(slides[beside], told[beside], blocks_of(both)[0], draws),
        )
    return found


def speed(results: Results) -> Floats:
    """Return how fast the touch slides (n,) in m/s, by its labels; NaN where neither direction is known."""
    across, along = results.label("slip_across"), results.label("slip_along")
    unknown = np.isnan(across) & np.isnan(along)
    return np.where(unknown, np.nan, np.hypot(np.nan_to_num(across), np.nan_to_num(along)))


def area(truth: Rows, told: Floats, blocks: Blocks, draws: int) -> Score:
    """Return the area under the curve with its interval; without a value where there is one kind only."""

    def statistic(at: Blocks) -> float:
        return area_under_curve(told[at][truth[at]], told[at][~truth[at]])

    return NONE if truth.all() or not truth.any() else score_of(statistic, blocks, draws)


def _as_events(results: Results, name: str, blank: Detection) -> Detection:
    """Add what is told as events, over all trials set apart from each other."""
    label, contact = results.label(name), results.label("contact")
    # A window with the begin or the end of an event has no label, but belongs to it.
    unknown = {"contact": results.label("transition") == 1.0}
    partly = unknown.get(name, np.isnan(label) & (contact == 1.0))
    watched = results.usable & (np.isfinite(label) | partly)
    if not watched.any():
        return blank
    part = results.where(watched)
    on = (part.label(name) == 1.0) | partly[watched]
    begin = part.start + APART * part.trial
    events = stretches(begin, on, part.hop)
    events[:, 1] += part.window - part.hop
    events[:-1, 1] = np.minimum(events[:-1, 1], events[1:, 0])
    alarms = stretches(begin + part.window, part.estimate(name) >= DECISION, part.hop)
    delays = detection_delays(events, alarms)
    quiet = float(part.hop * np.count_nonzero(~on))
    found = np.isfinite(delays)
    return replace(
        blank,
        events=len(events),
        found=float(found.mean()) if len(events) else None,
        delay=tuple(np.quantile(delays[found], [0.5, 0.9]).round(6).tolist()) if found.any() else (),
        quiet=quiet,
        false_alarms=60.0 * false_alarms(events, alarms) / quiet if quiet > 0.0 else None,
    )
