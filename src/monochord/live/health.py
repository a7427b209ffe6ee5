"""The health of a sensor while it runs, in sentences that say what to do."""

from dataclasses import dataclass
from typing import Literal

from monochord.core.units import Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Note:
    """Something that a person should know of the sensor.

    `key` is stable, for programs; `sentence` says what is the case and `remedy` what to do. `since` is when
    it began, in seconds since the stream began. An ``error`` is one that estimates abstain from or that makes
    them wrong, a ``warning`` costs some of them, an ``info`` explains.
    """

    key: str
    level: Literal["info", "warning", "error"]
    sentence: str
    remedy: str
    since: Seconds
