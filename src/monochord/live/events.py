"""Events: when a touch begins and ends, and when it starts and stops sliding."""

from dataclasses import dataclass

from monochord.core.units import Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """A change of what is decided of a touch.

    `name` is what changed, such as ``contact`` or ``slip``, and `on` what it is now. `time` is the onset in
    seconds since the stream began: the end of the first window that showed the change; `adc_time` is the same
    on the monotonic clock, where the source knows it. The change was decided `delay` later, at the end of a
    later window, with probability `confidence`.

    >>> Event(name="contact", on=True, time=1.25, delay=0.03, confidence=0.98).decided
    1.28
    """

    name: str
    on: bool
    time: Seconds
    delay: Seconds
    confidence: float
    adc_time: Seconds | None = None

    @property
    def decided(self) -> Seconds:
        """End of the window after which it was decided, in seconds since the stream began."""
        return self.time + self.delay
