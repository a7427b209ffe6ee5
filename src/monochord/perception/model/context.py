"""The untouched reference: what the string did when nothing touched it last.

Tension drifts by itself as much as a touch changes it, so a touch is read relative to the untouched string.
The reference is a fold over the windows of one stream, in order and causal: each window is looked at once,
with the probability that something touches it, and moves the memory on. Training, evaluation and the live
loop all use this fold.

A window enters the reference when it is believed untouched, the string has had time to settle since the last
touch, and no touch begins right after it, which the window may already hold the begin of. Times are those of
the windows' starts, so that the same sound gives much the same reference at another hop.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from monochord.core.types import Audio
from monochord.core.units import Seconds
from monochord.perception.model.definition import Reference

NEVER: Seconds = float("-inf")


@dataclass(frozen=True, slots=True, kw_only=True)
class Memory:
    """What is known of the untouched string: state, passed in and out.

    `rows` are the windows of the reference, oldest first, and `middle` is their median, None before any.
    `waiting` are those of which it is not yet known whether a touch begins right after them; `taken` is the
    time of the newest of all, `touched` that of the last window that was not believed untouched.
    """

    rows: tuple[Audio, ...] = ()
    middle: Audio | None = None
    waiting: tuple[tuple[Seconds, Audio], ...] = ()
    taken: Seconds = NEVER
    touched: Seconds = NEVER


def step(memory: Memory, rule: Reference, time: Seconds, contact: float, row: Callable[[], Audio]) -> Memory:
    """Return the memory after one more window.

    Parameters
    ----------
    memory
        The memory before it.
    rule
        How the reference is kept.
    time
        Start of the window in s; not before those of earlier windows.
    contact
        Probability that something touches, 0 to 1; 1 where that is not known.
    row
        Gives the numbers (d,) that are kept of the window; called only where they are needed.

    Examples
    --------
    >>> from monochord.perception.model.definition import FeatureRecord
    >>> feature = FeatureRecord(name="untouched", options={}, columns=("tension",))
    >>> memory, rule = Memory(), Reference(feature=feature)
    >>> for k, contact in enumerate([0.0, 0.0, 0.0, 1.0]):
    ...     memory = step(memory, rule, 0.1 * k, contact, lambda k=k: np.array([k], np.float32))
    >>> memory.middle.tolist()
    [0.5]
    """
    if not contact < rule.below:
        return Memory(rows=memory.rows, middle=memory.middle, taken=memory.taken, touched=time)
    sure = [waiter for waiter in memory.waiting if waiter[0] + rule.guard <= time + TINY]
    waiting = memory.waiting[len(sure) :]
    taken = memory.taken
    if time - taken >= rule.every - TINY and time - memory.touched >= rule.settle - TINY:
        waiting, taken = (*waiting, (time, row())), time
    if not sure:
        return Memory(
            rows=memory.rows, middle=memory.middle, waiting=waiting, taken=taken, touched=memory.touched
        )
    rows = (*memory.rows, *(kept for _, kept in sure))[-rule.keep :]
    middle = np.median(np.stack(rows), axis=0).astype(np.float32)
    return Memory(rows=rows, middle=middle, waiting=waiting, taken=taken, touched=memory.touched)


TINY: Seconds = 1e-6
"""Times that differ by less are the same."""


def context_row(memory: Memory, width: int) -> Audio:
    """Return the reference (width,) with a last column that marks that there is one; zeros before any.

    >>> context_row(Memory(), 3).tolist()
    [0.0, 0.0, 0.0]
    """
    found = np.zeros(width, np.float32)
    if memory.middle is not None:
        found[:-1] = memory.middle
        found[-1] = 1.0
    return found
