"""The vocabulary of a bring-up: what is recorded in a step, and what a check says."""

from dataclasses import dataclass, replace

from monochord.core.reasons import Reason
from monochord.core.types import Audio
from monochord.core.units import Seconds

MICROPHONES = 1, 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Take:
    """The sound of one step, (2, n) in full scale.

    `elapsed` is the time in s that a live source took for it, by the machine's clock; None for a recording.
    `source` names where it comes from, `dropped` counts the frames that were lost. `simulated` is whether a
    virtual sensor made it.
    """

    samples: Audio
    sample_rate: int
    source: str = ""
    elapsed: Seconds | None = None
    dropped: int = 0
    simulated: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """The result of one check.

    `value` is in `unit`, None where nothing could be measured. `passed` is None where the check was left out.
    `advice` says what to change, or why it was left out. `fault` names the diagnosis of a check that failed,
    and `microphone` the one that it is about, 0 for none.
    """

    step: str
    name: str
    value: float | None = None
    unit: str = ""
    passed: bool | None = True
    advice: str = ""
    fault: str = Reason.NONE
    microphone: int = 0

    def failed(self, fault: str, advice: str) -> "Check":
        """Return this check as failed, with the diagnosis and what to change."""
        return replace(self, passed=False, fault=fault, advice=advice)


def left_out(step: str, name: str, reason: str) -> Check:
    """Return a check that was left out.

    >>> left_out("loopback", "latency", "no loop-back").passed is None
    True
    """
    return Check(step=step, name=name, passed=None, advice=reason)
