"""A stream at the sample rate that its reader needs."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from monochord.capture.sources.base import Controls, Stream
from monochord.core.types import Block, Signal, StreamHealth, Truth
from monochord.core.units import Samples, Seconds


def at_rate(stream: Stream, sample_rate: int | None) -> Stream:
    """Return a stream at a rate in Hz, or at its own if that is lower or the rate is None.

    Indices of frames, blocks' times and truth are those of the new rate; `health` counts the device's frames.
    """
    if sample_rate is None or stream.signal.sample_rate <= sample_rate:
        return stream
    return _ResampledStream(stream, sample_rate)


class _ResampledStream(Stream):
    def __init__(self, stream: Stream, sample_rate: int) -> None:
        from monochord.dsp.resample import Conversion  # noqa: PLC0415 (loads numba)

        signal = stream.signal
        self._delay = Conversion.between(signal.sample_rate, sample_rate).delay
        self._stream, self._rates = stream, (signal.sample_rate, sample_rate)
        self._signal = replace(signal, sample_rate=sample_rate)
        silence = np.zeros((signal.channels, 1), np.float32)
        list(self._converted(iter([Block(samples=silence, start=0)])))  # compiles

    @property
    def signal(self) -> Signal:
        return self._signal

    def __iter__(self) -> Iterator[Block]:
        return self._converted(iter(self._stream))

    def in_time(self) -> Iterator[Block]:
        return self._converted(self._stream.in_time())

    def close(self) -> None:
        self._stream.close()

    @property
    def pending(self) -> Samples:
        old, new = self._rates
        return self._stream.pending * new // old

    @property
    def delay(self) -> Seconds:
        return self._stream.delay + self._delay

    @property
    def paced(self) -> bool:
        return self._stream.paced

    @property
    def health(self) -> StreamHealth:
        return self._stream.health

    @property
    def controls(self) -> Controls | None:
        return self._stream.controls

    @property
    def simulated(self) -> bool:
        return self._stream.simulated

    def truth(self, start: Samples, stop: Samples) -> Truth:
        old, new = self._rates
        return self._stream.truth(round(start * old / new), round(stop * old / new))

    def _converted(self, blocks: Iterator[Block]) -> Iterator[Block]:
        from monochord.dsp.resample import resampled  # noqa: PLC0415 (loads numba)

        old, new = self._rates
        return resampled(blocks, sample_rate=old, new_rate=new)
