"""The untouched reference: what the string did when nothing touched it last.

Tension drifts by itself as much as a touch changes it, so a touch is read relative to the untouched string.
The reference is a fold over the windows of one stream, in order and causal: each window is looked at once,
with the probability that something touches it, and updates the state. Training, evaluation and the live
loop all use this fold.

A window enters the reference when it is believed untouched, the string has had time to settle since the last
touch, and no touch begins right after it, which the window may already contain the start of. Times are those
of the windows' starts, so that the same sound gives much the same reference at another hop.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from monochord.core.types import Audio
from monochord.core.units import Samples, Seconds
from monochord.perception.model.anomaly import INITIAL_STATE, AnomalyState
from monochord.perception.model.definition import Reference

TIME_TOLERANCE: Seconds = 1e-6
"""Times that differ by less are the same."""
PRESENT: Audio = np.ones(1, np.float32)
"""Last column of a reference that there is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelState:
    """The state of a model on one stream of windows, passed in and out; it begins as ``ModelState()``.

    `start` is the first frame of the last window. `rows` are the windows of the reference, oldest first, and
    `median` is theirs, None before any. `pending` are those that enter if no touch begins right after
    them; `accepted` is the time of the newest of all, `touched` that of the last window that was not
    believed untouched. `known` is the state of the detector of sound unlike that of the training.
    """

    start: Samples = -1
    rows: tuple[Audio, ...] = ()
    median: Audio | None = None
    pending: tuple[tuple[Seconds, Audio], ...] = ()
    accepted: Seconds = -math.inf
    touched: Seconds = -math.inf
    anomaly: AnomalyState = INITIAL_STATE


def step(
    state: ModelState, rule: Reference, time: Seconds, contact: float, row: Callable[[], Audio]
) -> ModelState:
    """Return the state after one more window.

    Parameters
    ----------
    state
        The state before it.
    rule
        How the reference is updated.
    time
        Start of the window in s; not before those of earlier windows.
    contact
        Probability that something touches, 0 to 1; 1 where that is not known.
    row
        Returns the features (d,) of the window that the reference is made of; called only where needed.

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
        return replace(state, pending=(), touched=time)
    entering = [each for each in state.pending if each[0] + rule.guard <= time + TIME_TOLERANCE]
    pending = state.pending[len(entering) :]
    accepted = state.accepted
    is_due = time - accepted >= rule.every - TIME_TOLERANCE
    if is_due and time - state.touched >= rule.settle - TIME_TOLERANCE:
        pending, accepted = (*pending, (time, row())), time
    if not entering:
        return replace(state, pending=pending, accepted=accepted)
    rows = (*state.rows, *(each for _, each in entering))[-rule.keep :]
    median = np.median(np.stack(rows), axis=0).astype(np.float32)
    return replace(state, rows=rows, median=median, pending=pending, accepted=accepted)


def context_row(state: ModelState, width: int) -> Audio:
    """Return the reference (width,) with a last column that is 1 where there is one; zeros before any.

    >>> context_row(ModelState(), 3).tolist()
    [0.0, 0.0, 0.0]
    """
    if state.median is None:
        return np.zeros(width, np.float32)
    return np.concatenate((state.median, PRESENT))
