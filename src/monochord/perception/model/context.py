"""The untouched reference: the features of the string when it was last untouched.

Tension drifts by as much as a touch changes it, so a touch is measured relative to the untouched string. The
reference is a causal fold over the windows of one stream: each window updates the state once, with its
probability of contact. Training, evaluation and the live loop all use this fold.

A window enters the reference under three conditions: it is believed untouched; the string has had time to
settle since the last touch; and no touch begins shortly after, because the window may contain the touch's
onset. Times are window starts, so the same sound gives nearly the same reference at another hop.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from monochord.core.types import Audio
from monochord.core.units import Samples, Seconds
from monochord.perception.model.definition import Reference
from monochord.perception.model.faults import INITIAL_STATE, FaultState

TIME_TOLERANCE: Seconds = 1e-6
"""Times that differ by less than this are equal."""
PRESENT: Audio = np.ones(1, np.float32)
"""Last column of a reference, which marks it as present."""


class ModelState(NamedTuple):
    """The state of a model on one stream of windows, passed in and out; initially ``ModelState()``.

    `start` is the first frame of the last window. `rows` holds the features of the reference's windows, the
    oldest first, and `median` is their median; None without rows. `pending` holds (time, features) of windows
    that enter the reference unless a touch begins shortly after. `accepted` is the time of the newest window
    in `rows` or `pending`, in s. `touched` is the time of the last window that was not believed untouched, in
    s. `faults` is the average over windows of the odds of faults.
    """

    start: Samples = -1
    rows: tuple[Audio, ...] = ()
    median: Audio | None = None
    pending: tuple[tuple[Seconds, Audio], ...] = ()
    accepted: Seconds = -math.inf
    touched: Seconds = -math.inf
    faults: FaultState = INITIAL_STATE


def step(
    state: ModelState, rule: Reference, time: Seconds, contact: float, row: Callable[[], Audio]
) -> ModelState:
    """Return the state after one more window.

    Parameters
    ----------
    state
        The state before the window.
    rule
        The rule that updates the reference.
    time
        Start of the window in s; never earlier than the start of a previous window.
    contact
        Probability of contact, 0 to 1; 1 if unknown.
    row
        Function that returns the window's features (d,) for the reference; called only if the window may
        enter.

    Examples
    --------
    >>> from monochord.perception.model.definition import FeatureRecord
    >>> feature = FeatureRecord(name="untouched", options={}, columns=("tension",))
    >>> state, rule = ModelState(), Reference(feature=feature)
    >>> for k, contact in enumerate([0.0, 0.0, 0.0, 1.0]):
    ...     state = step(state, rule, 0.1 * k, contact, lambda k=k: np.array([k], np.float32))
    >>> state.median.tolist()
    [0.5]
    """
    if not contact < rule.below:
        return state._replace(pending=(), touched=time)
    entering = [each for each in state.pending if each[0] + rule.guard <= time + TIME_TOLERANCE]
    pending = state.pending[len(entering) :]
    accepted = state.accepted
    is_due = time - accepted >= rule.every - TIME_TOLERANCE
    if is_due and time - state.touched >= rule.settle - TIME_TOLERANCE:
        pending, accepted = (*pending, (time, row())), time
    if not entering:
        return state._replace(pending=pending, accepted=accepted)
    rows = (*state.rows, *(each for _, each in entering))[-rule.keep :]
    ranked = np.sort(np.stack(rows), axis=0)
    median = np.float32(0.5) * (ranked[(len(rows) - 1) // 2] + ranked[len(rows) // 2])
    return state._replace(rows=rows, median=median, pending=pending, accepted=accepted)


def context_row(state: ModelState, width: int) -> Audio:
    """Return the reference (width,), whose last column is 1; zeros without a reference.

    >>> context_row(ModelState(), 3).tolist()
    [0.0, 0.0, 0.0]
    """
    if state.median is None:
        return np.zeros(width, np.float32)
    return np.concatenate((state.median, PRESENT))
