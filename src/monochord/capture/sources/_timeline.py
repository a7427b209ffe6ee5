"""Places a device's periods on the stream's own sample clock, and so measures what was lost between them."""

from monochord.capture.jack.ring import FRAME_TIME_SPAN, Period, frames_between
from monochord.core.types import Block, StreamHealth
from monochord.core.units import Samples, Seconds


class Timeline:
    """The stream's sample clock, at `sample_rate` frames a second, and its counters.

    While one device runs, its frame counter is the truth; after `interrupt`, when another counter begins,
    the gap is what the monotonic clock says.
    """

    def __init__(self, sample_rate: int) -> None:
        self._rate = sample_rate
        self._end: Samples = 0  # index after the newest frame
        self._frame_time: Samples | None = None  # the device's count there
        self._time: Seconds | None = None  # the monotonic clock there; None before the first frame
        self._frames = self._dropped = self._gaps = 0

    def interrupt(self) -> None:
        """Note that the device's counter begins anew."""
        self._frame_time = None

    def place(self, period: Period, adc_time: Seconds | None, now: Seconds) -> Block:
        """Return the period as a block.

        Parameters
        ----------
        period
            What the device brought; its `frame_time` counts modulo 2^32.
        adc_time
            Monotonic time of the period's first frame at the converter, None where the device does not say.
        now
            Monotonic time, which stands in for it: the last frame was at the converter just now.
        """
        frames = period.samples.shape[1]
        began = now - frames / self._rate if adc_time is None else adc_time
        lost = self._lost(period.frame_time, began)
        start = self._end + lost
        self._end, self._time = start + frames, began + frames / self._rate
        self._frame_time = (period.frame_time + frames) % FRAME_TIME_SPAN
        self._frames += frames
        self._dropped += lost
        self._gaps += lost > 0
        return Block(
            samples=period.samples,
            start=start,
            dropped=lost,
            adc_time=adc_time,
            frame_time=period.frame_time,
        )

    def health(self, *, xruns: int, reconnects: int, clock_offsets: dict[str, Seconds]) -> StreamHealth:
        """Return the counters so far beside what only the device knows."""
        return StreamHealth(
            frames=self._frames,
            dropped=self._dropped,
            gaps=self._gaps,
            xruns=xruns,
            reconnects=reconnects,
            clock_offsets=clock_offsets,
        )

    def _lost(self, frame_time: Samples, began: Seconds) -> Samples:
        if self._time is None:
            return 0
        if self._frame_time is None:
            lost = round((began - self._time) * self._rate)
        else:
            lost = frames_between(self._frame_time, frame_time)
        return max(lost, 0)  # a count may step back a little after an xrun; indices never do
