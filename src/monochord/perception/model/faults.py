"""Faults and unusual touches: which kind of windows the reader hears.

The reader, which remembers the windows before, gives each window the log odds of every fault over an ordinary
window (`monochord.perception.reader.network.KINDS`).
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from monochord.core.reasons import Reason
from monochord.core.types import Floats

MAX_ODDS = 10.0
"""Largest magnitude of log odds."""


class ReportedFault(NamedTuple):
    """How a fault is reported.

    A fault `of_touch` is detected in touched windows alone. Contact stays reliable where `contact_reliable`
    says so, and all estimates, where the position is certain, with `place_reliable`.
    """

    reason: Reason
    of_touch: bool = False
    contact_reliable: bool = False
    place_reliable: bool = False


FAULTS: Mapping[str, ReportedFault] = {
    "microphone 1 dead": ReportedFault(Reason.MICROPHONE_1_SILENT),
    "microphone 2 dead": ReportedFault(Reason.MICROPHONE_2_SILENT),
    "microphones swapped": ReportedFault(Reason.MICROPHONES_SWAPPED, contact_reliable=True),
    "clipping": ReportedFault(Reason.MOSTLY_CLIPPED),
    "hum": ReportedFault(Reason.HUM),
    "second string": ReportedFault(Reason.TWO_STRINGS),
    "two touches": ReportedFault(Reason.TWO_TOUCHES),
    "driver dead": ReportedFault(
        Reason.DRIVER_SILENT, of_touch=True, contact_reliable=True, place_reliable=True
    ),
    "detuned": ReportedFault(Reason.OUT_OF_TUNE, of_touch=True),
}
"""All faults by the names of their kinds of windows."""
NAMES = tuple(FAULTS)
_OF_TOUCH = np.array([fault.of_touch for fault in FAULTS.values()])
OF_REASON: Mapping[str, ReportedFault] = {fault.reason: fault for fault in FAULTS.values()}


def log_odds(kinds: Floats, *, touched: bool) -> Floats:
    """Return the log odds (faults,) of each fault from the logits of the kinds (1 + faults,).

    >>> log_odds(np.array([0.0, *[-9.0] * 7, 4.0, -20.0]), touched=True)[6:].tolist()
    [-9.0, 4.0, -10.0]
    """
    odds = np.minimum(np.maximum(kinds[1:] - kinds[0], -MAX_ODDS), MAX_ODDS)
    if not touched:
        odds[_OF_TOUCH] = -MAX_ODDS
    return odds


def fault_reason(odds: Floats, limits: Floats) -> Reason:
    """Return why to abstain from log odds (faults,); empty if none is above its limit (faults,).

    >>> fault_reason(np.array([-5.0, 6.0, *[-5.0] * 7]), np.full(9, 3.0))
    'microphone 2 is silent'
    """
    above = odds - limits
    best = int(above.argmax())
    return FAULTS[NAMES[best]].reason if above[best] > 0.0 else Reason.NONE
