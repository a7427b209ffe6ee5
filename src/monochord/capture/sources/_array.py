"""Sound in an array, for use from Python; not available on the command line."""

from dataclasses import dataclass

import numpy as np

from monochord.capture.sources._paced_stream import PacedStream
from monochord.capture.sources.base import MAX_CHANNELS, Source, refuse_other_rates
from monochord.core.errors import InputError
from monochord.core.ranges import Count
from monochord.core.shapes import sound
from monochord.core.types import Audio, Signal


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ArraySource(Source):
    """Samples (channels, n) or (n,) in full scale, delivered as fast as they are read.

    `sample_rate` is in Hz; a block has `block` frames, the last one possibly fewer.
    """

    samples: Audio
    sample_rate: float
    block: Count = 441

    def open(self) -> "_ArrayStream":
        """Open at the first frame; raises `InputError` for an invalid shape, type or rate."""
        refuse_other_rates(self.sample_rate, "sound", "resample it")
        if self.sample_rate != round(self.sample_rate):
            raise InputError(f"sound at {self.sample_rate} Hz", "a whole number of Hz")
        given = np.atleast_1d(self.samples)
        samples = sound(given[None] if given.ndim == 1 else given)
        if samples.shape[0] > MAX_CHANNELS:
            shape = f"sound of shape {samples.shape}"
            raise InputError(shape, "(channels, samples)", "transpose (samples, channels)")
        return _ArrayStream(self, samples)


class _ArrayStream(PacedStream):
    def __init__(self, options: ArraySource, samples: Audio) -> None:
        channels, frames = samples.shape
        signal = Signal(sample_rate=int(options.sample_rate), channels=channels)
        super().__init__(signal, block=options.block, speed=0.0, end=frames)
        self._samples = samples

    def _read(self, frames: int) -> Audio:
        return self._samples[:, self._start : self._start + frames].copy()
