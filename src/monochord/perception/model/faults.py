"""Faults and unusual touches: which kind of window the reader sees, averaged over time.

The reader gives each window the log odds of every fault over an ordinary window
(`monochord.perception.reader.network.KINDS`). One window is not enough for some faults, so the log odds are
averaged: over seconds for a lasting fault, and over less than the length of a touch for an unusual touch. A
silent driver is detected during a touch, when its segment hardly rings; without a touch, a string of another
design may sound the same.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from monochord.core.kernels import kernel
from monochord.core.reasons import Reason
from monochord.core.types import Flags, Floats
from monochord.core.units import Seconds

MAX_ODDS = 10.0
"""Largest log odds of a window; the limit lets the average fall soon after a clear fault ends."""
SILENT_DRIVER = "driver dead"
LINES = tuple(f"level line {line} mic {mic}" for line in (1, 2) for mic in (1, 2))
"""Columns of the levels of both segments' lines at both microphones, in log10 of power."""
DRIVEN = 0.5
"""Excess of a segment's line over the other's, at its own microphone, that a silent driver never leaves, in
log10 of power: 0 of 1,000 windows of the plan `odd` that look like one, with either driver silent."""


class Fault(NamedTuple):
    """How a fault is reported.

    `memory` is the averaging time in s. A fault `of_touch` is detected in touched windows alone. Contact
    stays reliable where `contact_reliable` says so.
    """

    reason: Reason
    memory: Seconds = 2.0
    of_touch: bool = False
    contact_reliable: bool = False


FAULTS: Mapping[str, Fault] = {
    "microphone 1 dead": Fault(Reason.MICROPHONE_1_SILENT),
    "microphone 2 dead": Fault(Reason.MICROPHONE_2_SILENT),
    "microphones swapped": Fault(Reason.MICROPHONES_SWAPPED, contact_reliable=True),
    "clipping": Fault(Reason.MOSTLY_CLIPPED),
    "hum": Fault(Reason.HUM),
    "second string": Fault(Reason.TWO_STRINGS),
    "two touches": Fault(Reason.TWO_TOUCHES, memory=0.2),
    SILENT_DRIVER: Fault(Reason.DRIVER_SILENT, of_touch=True, contact_reliable=True),
    "very soft": Fault(Reason.SOFT_TOUCH, memory=0.2),
    "detuned": Fault(Reason.OUT_OF_TUNE, memory=0.2, of_touch=True),
}
"""All faults by the names of their kinds of windows."""
NAMES = tuple(FAULTS)
_SILENT_DRIVER = NAMES.index(SILENT_DRIVER)
OF_REASON: Mapping[str, Fault] = {fault.reason: fault for fault in FAULTS.values()}
_MEMORY = np.array([fault.memory for fault in FAULTS.values()])
_COUNTS = tuple(
    np.array([touched or not fault.of_touch for fault in FAULTS.values()]) for touched in (False, True)
)


class FaultState(NamedTuple):
    """The averages on one stream, after the window that starts at `time` (s).

    `odds` (faults,) are the averaged log odds; None before the first window. `weight` (faults,) is the total
    weight of the windows that count for each fault; it approaches 1 in a long stream. It is NaN after the
    first window, because the hop is unknown until the second window; None before any window.
    """

    odds: Floats | None = None
    weight: Floats | None = None
    time: Seconds = -math.inf


INITIAL_STATE = FaultState()


def log_odds(kinds: Floats, lines: Floats) -> Floats:
    """Return the log odds (faults,) of a window from its kinds (1 + faults,) and the levels of `LINES` (4,).

    No driver is silent where each microphone hears its own segment louder than the other one.

    >>> kinds = np.array([0.0, *[-9.0] * 7, 4.0, -9.0, -9.0])
    >>> float(log_odds(kinds, np.array([-4.0, -4.0, -1.5, 0.0]))[7])
    4.0
    >>> float(log_odds(kinds, np.array([0.0, -1.5, -1.0, 0.0]))[7])
    -10.0
    """
    odds = kinds[1:] - kinds[0]
    if min(lines[0] - lines[2], lines[3] - lines[1]) > DRIVEN:
        odds[_SILENT_DRIVER] = -MAX_ODDS
    return odds


def step(state: FaultState, odds: Floats, time: Seconds, *, touched: bool) -> FaultState:
    """Return the state after a window with log odds (faults,) that starts at `time` in s.

    Weights fall by a factor e in each fault's memory, at any hop. The first windows of a stream count like
    all others, although the drivers may only be starting. `touched` says whether something touches the string
    in the window.

    >>> state = step(FaultState(), np.full(10, 2.0), 0.0, touched=True)
    >>> step(state, np.zeros(10), 0.5, touched=True).odds[[0, 6]].round(2).tolist()
    [0.88, 0.15]
    """
    counts = _COUNTS[touched]
    if state.odds is None or state.weight is None:
        clipped = np.clip(odds, -MAX_ODDS, MAX_ODDS)
        return FaultState(
            odds=np.where(counts, clipped, -MAX_ODDS), weight=np.where(counts, np.nan, 0.0), time=time
        )
    elapsed = max(time - state.time, 1e-9)
    averaged, weight = _averaged(state.odds, state.weight, odds, elapsed, _MEMORY, counts)
    return FaultState(odds=averaged, weight=weight, time=time)


@kernel()
def _averaged(
    odds: Floats, weight: Floats, own: Floats, elapsed: Seconds, memory: Floats, counts: Flags
) -> tuple[Floats, Floats]:
    """Return the averaged log odds and their weights once one more window counts."""
    odds, weight = odds.copy(), weight.copy()
    for k in range(odds.size):
        if counts[k]:
            value = min(max(own[k], -MAX_ODDS), MAX_ODDS)
            share = np.exp(-elapsed / memory[k])
            before = share * (1.0 - share if np.isnan(weight[k]) else weight[k])
            weight[k] = before + 1.0 - share
            odds[k] = (before * odds[k] + (1.0 - share) * value) / weight[k]
    return odds, weight


def fault_reason(odds: Floats | None, limits: Floats) -> Reason:
    """Return why to abstain from averaged log odds (faults,); empty if none is above its limit (faults,).

    >>> fault_reason(np.array([-5.0, 6.0, *[-5.0] * 8]), np.full(10, 3.0))
    'microphone 2 is silent'
    """
    if odds is None:
        return Reason.NONE
    above = odds - limits
    best = int(above.argmax())
    return FAULTS[NAMES[best]].reason if above[best] > 0.0 else Reason.NONE
