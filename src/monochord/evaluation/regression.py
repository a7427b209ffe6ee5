"""How far estimates of position and force are off, with intervals and with what was left out told.

Only touched windows whose every sample was recorded and whose label is known are scored. An estimator that
abstains cannot gain by it: the shares that are near enough are of all windows, so that an abstention counts
as a miss, and the share that was answered stands beside every error.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.units import Seconds
from monochord.evaluation.results import Results
from monochord.metrics import (
    LIMITS,
    bootstrap_interval,
    hit_rate,
    known,
    mean_absolute_error,
    pearson_r,
    regression_score,
    time_blocks,
)

Rows: TypeAlias = NDArray[np.bool_]
Blocks: TypeAlias = NDArray[np.int64]
"""Numbers of blocks, or of rows (n,)."""
ENOUGH_SESSIONS = 5
"""From so many sessions on, whole sessions are drawn for an interval; else stretches of `STRETCH`."""
STRETCH: Seconds = 10.0
DRAWS = 400


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """A number with its 95 % interval; None where there is too little to tell it from."""

    value: float | None = None
    low: float | None = None
    high: float | None = None


NONE = Score()


@dataclass(frozen=True, slots=True, kw_only=True)
class Regression:
    """How well a quantity is told, in its SI unit.

    Of `windows` that were to be told the share `answered` was. Of those are `mae` (mean absolute error),
    `bias` (mean error), `median` (absolute error), Pearson's `r`, and `covered` (2,): the shares of truths
    within one and two stated standard errors. `within` is the share of all windows that were told to within
    `limit`. `blocks` says what was drawn anew for the intervals.
    """

    windows: int
    sessions: int
    blocks: str
    limit: float
    answered: float | None = None
    mae: Score = NONE
    within: Score = NONE
    r: Score = NONE
    bias: float | None = None
    median: float | None = None
    covered: tuple[float, ...] = ()


def scored(results: Results, name: str) -> Rows:
    """Return which rows (n,) are to be told: touched, recorded whole, and with a label of this name."""
    touched = results.label("contact") == 1.0
    return touched & results.usable & known(results.label(name))


def regression(results: Results, name: str, rows: Rows | None = None, *, draws: int = DRAWS) -> Regression:
    """Return how well a quantity is told in the rows (n,) that are asked for; the module tells the rules.

    Parameters
    ----------
    results
        Estimates beside the truth.
    name
        Of label and estimate: "position" or "force".
    rows
        To be scored, of those that `scored` gives; all of them by default.
    draws
        For each interval; 0 for none.

    Raises
    ------
    InputError
        For a quantity without a limit of its own.

    Examples
    --------
    ``examples/evaluate_an_estimator.py`` scores an estimator.
    """
    if name not in LIMITS:
        raise InputError(f"quantity '{name}'", ", ".join(LIMITS))
    part = results.where(scored(results, name) if rows is None else rows & scored(results, name))
    truth, told = part.label(name), part.estimate(name)
    std = part.std.get(name, np.full(len(part), np.nan))
    blocks, what = blocks_of(part)
    sessions = len(np.unique(part.of_trials("session")))
    blank = Regression(windows=len(part), sessions=sessions, blocks=what, limit=LIMITS[name])
    if not len(part):
        return blank
    answered, score = known(told), regression_score(truth, told, std, limit=LIMITS[name])
    some = replace(
        blank,
        answered=score.answered,
        within=score_of(lambda at: hit_rate(truth[at], told[at], LIMITS[name]), blocks, draws),
    )
    if not answered.any():
        return some
    true, said, number = truth[answered], told[answered], blocks[answered]
    return replace(
        some,
        mae=score_of(lambda at: mean_absolute_error(true[at], said[at]), number, draws),
        r=score_of(lambda at: pearson_r(true[at], said[at]), number, draws),
        bias=score.bias,
        median=score.median,
        covered=score.coverage,
    )


def blocks_of(results: Results) -> tuple[Blocks, str]:
    """Return the number of the block (n,) of each row that intervals draw, and what blocks are.

    Whole sessions, whatever their condition, where there are `ENOUGH_SESSIONS`; else stretches of time.
    """
    names, number = np.unique(results.of_trials("session"), return_inverse=True)
    if len(names) >= ENOUGH_SESSIONS or not len(results):
        return number.astype(np.int64), "sessions"
    return time_blocks(number, results.start, STRETCH), f"stretches of {STRETCH:g} s"


def score_of(statistic: Callable[[Blocks], float], blocks: Blocks, draws: int = DRAWS) -> Score:
    """Return a statistic of row numbers with its 95 % interval, where there are blocks enough for one.

    Examples
    --------
    >>> error = np.array([1.0, 2.0, 3.0, 4.0])
    >>> score_of(lambda at: float(error[at].mean()), np.array([0, 0, 0, 0]))
    Score(value=2.5, low=None, high=None)
    """
    value = statistic(np.arange(len(blocks)))
    if np.isnan(value):
        return NONE
    try:
        low, high = bootstrap_interval(statistic, blocks, seed=0, draws=draws) if draws > 0 else (None, None)
    except InputError:
        low, high = None, None
    return Score(value=value, low=low, high=high)
