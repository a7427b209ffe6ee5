"""Touches as events: detection delay and false alarms.

An event and an alarm are time spans [begin, end). An alarm belongs to the event in which it begins; an alarm
that begins outside every event is false, even if an event starts during it: a constant alarm detects nothing.
"""

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Seconds
from monochord.metrics._checked import decisions, numbers


def stretches(time: Floats, on: NDArray[np.bool_], hop: Seconds) -> Floats:
    """Return start and end (k, 2) in s of each run of consecutive samples that are on.

    A stretch begins at the time of its first sample and ends one `hop` after its last. A gap of more than one
    and a half hops also ends it.

    Parameters
    ----------
    time
        Time of each sample, (n,), in s, rising; for estimates, the end of the window, when they became
        available.
    on
        Whether the sample is on, (n,).
    hop
        Hop of the series, in s, above 0.

    Raises
    ------
    InputError
        If the shapes differ, a time is not finite or does not rise, or `hop` is not above 0.

    Examples
    --------
    >>> stretches(np.array([0.0, 0.5, 1.0, 1.5]), np.array([False, True, True, False]), 0.5).tolist()
    [[0.5, 1.5]]
    """
    (given,) = decisions(on=on)
    time, _ = numbers(time=time, on=given.astype(np.float64))
    if not hop > 0.0 or (np.diff(time) <= 0.0).any():
        raise InputError(f"times every {hop:g} s", "rising times, a hop above 0 s")
    pause = np.diff(time) > 1.5 * hop
    first = given & ~np.concatenate([[False], given[:-1] & ~pause])
    last = given & ~np.concatenate([given[1:] & ~pause, [False]])
    return np.column_stack([time[first], time[last] + hop])


def detection_delays(events: Floats, alarms: Floats, early: Seconds = 0.0) -> Floats:
    """Return the delay from the start of each event to its first alarm, (k,) in s; NaN if missed.

    Parameters
    ----------
    events, alarms
        Begin and end in s, (k, 2) and (m, 2), each in order and apart; either may be empty, (0, 2).
    early
        How long before its event an alarm may begin, in s: the timing uncertainty of the truth. The delay is
        then negative.

    Raises
    ------
    InputError
        If a span has no length, or spans overlap or are not in order.

    Examples
    --------
    >>> events = np.array([[1.0, 2.0], [3.0, 4.0]])
    >>> detection_delays(events, np.array([[1.25, 2.5], [2.75, 3.5]])).tolist()
    [0.25, nan]
    """
    owner, begins = _owners(events, alarms, early)
    delays = np.full(len(events), np.nan)
    # Written last to first, so that the first alarm of each event stays.
    for event, begin in zip(owner[::-1], begins[::-1], strict=True):
        if event >= 0:
            delays[event] = begin - events[event, 0]
    return delays


def false_alarms(events: Floats, alarms: Floats, early: Seconds = 0.0) -> int:
    """Return the number of alarms that begin outside every event.

    Parameters
    ----------
    events, alarms, early
        As in `detection_delays`.

    Examples
    --------
    >>> false_alarms(np.array([[1.0, 2.0]]), np.array([[0.5, 0.75], [1.25, 1.5], [1.75, 3.0]]))
    1
    """
    return int(np.count_nonzero(_owners(events, alarms, early)[0] < 0))


def _owners(events: Floats, alarms: Floats, early: Seconds) -> tuple[NDArray[np.int64], Floats]:
    """Return for each alarm (m,) the event in which it begins, -1 for none, and the time it begins."""
    events, alarms = _checked(events, "events"), _checked(alarms, "alarms")
    if not early >= 0.0:
        raise InputError(f"early {early:g} s", "0 s or more")
    begins = alarms[:, 0]
    inside = (begins[:, None] >= events[:, 0] - early) & (begins[:, None] < events[:, 1])
    if inside.shape[1] == 0:
        return np.full(len(begins), -1, np.int64), begins
    # An alarm that begins late in one event, and early enough for the next, belongs to the first.
    return np.where(inside.any(axis=1), np.argmax(inside, axis=1), -1).astype(np.int64), begins


def _checked(spans: Floats, name: str) -> Floats:
    spans = np.asarray(spans, np.float64)
    if spans.ndim != 2 or spans.shape[1] != 2:
        raise InputError(f"{name} of shape {spans.shape}", "(k, 2): begin and end")
    rising = np.diff(spans.reshape(-1)) >= 0.0
    if not np.isfinite(spans).all() or not rising.all() or not (spans[:, 1] > spans[:, 0]).all():
        raise InputError(
            f"{name} that overlap, are unordered or not finite", "spans in order, without overlap"
        )
    return spans
