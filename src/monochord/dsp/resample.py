"""Changes the sample rate of a stream."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from math import ceil, gcd

import numpy as np

from monochord.core.errors import InputError
from monochord.core.kernels import kernel
from monochord.core.types import Audio, Block
from monochord.core.units import Samples, Seconds

KEPT_BAND, SUPPRESSION = 0.907, 100.0
"""Share of half the lower rate up to which a stream's sound is kept, and suppression above in dB."""
PIECE: Samples = 4096
"""Most lost frames that are taken at once."""


def resampled(blocks: Iterable[Block], *, sample_rate: int, new_rate: int) -> Iterator[Block]:
    """Yield a stream of blocks at another sample rate, as soon as each frame is determined.

    Frame k of the result is the sound at time k / `new_rate`. It is a sum over the frames within
    `Conversion.delay` of that time, weighted by a sinc under a Kaiser window (Kaiser 1974): 0.8 ms between
    44.1 kHz and higher rates, by which blocks are late. Each frame has the same bits whatever the block
    sizes. Lost frames stay lost, at the same times; the sum has zeros in their place, and before and after
    the stream.

    Up to 0.907 of half the lower rate (20 kHz at 44.1 kHz), the sound is kept to 1e-5 of its amplitude; what
    lies above its mirror image, 24.1 kHz, is suppressed by 100 dB.

    Parameters
    ----------
    blocks
        Blocks of one stream, in order.
    sample_rate, new_rate
        In Hz, whole numbers.

    Yields
    ------
    Block
        Frames (channels, n) at the new rate; `adc_time` is that of its first frame.

    Raises
    ------
    InputError
        If a rate is not above zero.

    Examples
    --------
    >>> time = np.arange(960) / 48000
    >>> tone = np.sin(2.0 * np.pi * 1000.0 * time, dtype=np.float32)[None]
    >>> (block, end) = resampled([Block(samples=tone, start=0)], sample_rate=48000, new_rate=44100)
    >>> block.samples.shape[1] + end.samples.shape[1]
    882
    >>> error = block.samples[0, 40:] - np.sin(2.0 * np.pi * 1000.0 * np.arange(40, 848) / 44100)
    >>> bool(np.abs(error).max() < 1e-5)
    True
    """
    conversion, tape = Conversion.between(sample_rate, new_rate), None
    for block in blocks:
        if tape is None:
            tape = _Tape(conversion, block.samples.shape[0])
        yield from tape.convert(block)
    if tape is not None:
        yield from tape.rest()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Conversion:
    """The weights (phases, 2 `half`) of a conversion: output k lies at input frame k `step` / phases."""

    sample_rate: int
    step: int
    half: Samples
    weights: Audio

    @property
    def delay(self) -> Seconds:
        """How long after its own time a frame is determined, in s."""
        return self.half / self.sample_rate

    @classmethod
    @cache
    def between(cls, sample_rate: int, new_rate: int) -> "Conversion":
        """Return the conversion between two rates; raises `InputError` for one that is not above zero.

        >>> round(1e3 * Conversion.between(48000, 44100).delay, 2)
        0.79
        """
        _refuse_rates(sample_rate, new_rate)
        shared = gcd(sample_rate, new_rate)
        phases, step = new_rate // shared, sample_rate // shared
        # In cycles per frame; Kaiser's formulas for the length and shape of a window.
        top = 0.5 * min(sample_rate, new_rate) / sample_rate
        half = ceil((SUPPRESSION - 7.95) / (2.285 * 2.0 * np.pi * 2.0 * (1.0 - KEPT_BAND) * top) / 2.0)
        places = np.arange(1 - half, half + 1) - (np.arange(phases) / phases)[:, None]
        beta = 0.1102 * (SUPPRESSION - 8.7)
        taper = np.i0(beta * np.sqrt(np.maximum(1.0 - (places / half) ** 2, 0.0)))
        weights = np.sinc(2.0 * top * places) * taper
        weights /= weights.sum(axis=1, keepdims=True)
        return cls(sample_rate=sample_rate, step=step, half=half, weights=weights.astype(np.float32))

    def outputs(self, frames: Samples) -> Samples:
        """Return the number of output frames that lie before an input frame."""
        return -(-frames * len(self.weights) // self.step)


class _Tape:
    """The newest frames of a stream, lost ones as marked zeros, with the next output frame."""

    def __init__(self, conversion: Conversion, channels: int) -> None:
        self._conversion = conversion
        self._first = 1 - conversion.half  # index of the oldest frame
        self._samples = np.zeros((channels, conversion.half - 1), np.float32)
        self._lost = np.zeros(conversion.half - 1, np.bool_)
        self._next = self._given = 0  # output frames: the next one, and the end of the last block

    @property
    def _end(self) -> Samples:
        return self._first + len(self._lost)

    def convert(self, block: Block) -> Iterator[Block]:
        """Yield what a block determines."""
        missing, channels = block.start - self._end, len(self._samples)
        for done in range(0, missing, PIECE):
            zeros = np.zeros((channels, min(PIECE, missing - done)), np.float32)
            yield from self._append(zeros, block, lost=True)
        yield from self._append(block.samples, block)
        if not block.samples.shape[1] and self._next > self._given:
            empty, lost = np.zeros((channels, 0), np.float32), self._next - self._given
            self._given = self._next
            yield Block(samples=empty, start=self._next, dropped=lost)

    def rest(self) -> Iterator[Block]:
        """Yield the frames up to the end of the stream."""
        half = self._conversion.half
        end = Block(samples=np.zeros((len(self._samples), half), np.float32), start=self._end)
        yield from self._append(end.samples, end)

    def _append(self, samples: Audio, block: Block, *, lost: bool = False) -> Iterator[Block]:
        """Yield what further frames determine; `block` gives their time."""
        conversion, first = self._conversion, self._next
        self._samples = np.concatenate((self._samples, samples), axis=1, dtype=np.float32)
        self._lost = np.concatenate((self._lost, np.full(samples.shape[1], lost)))
        self._next = max(conversion.outputs(self._end - conversion.half), first)
        phases, step = len(conversion.weights), conversion.step
        places = np.arange(first, self._next) * step // phases
        gone = self._lost[places - self._first]
        edges = np.flatnonzero(np.diff(gone, prepend=True, append=True)) + first
        for begin, end in edges.reshape(-1, 2).tolist():
            converted = np.empty((len(self._samples), end - begin), np.float32)
            _convolve(self._samples, self._first, conversion.weights, step, begin, converted)
            adc_time = block.adc_time
            if adc_time is not None:
                adc_time += (begin * step / phases - block.start) / conversion.sample_rate
            yield Block(samples=converted, start=begin, dropped=begin - self._given, adc_time=adc_time)
            self._given = end
        spare = self._next * step // phases - conversion.half + 1 - self._first
        self._samples, self._lost = self._samples[:, spare:], self._lost[spare:]
        self._first += spare


@kernel(fastmath={"reassoc", "contract"})
def _convolve(samples: Audio, first: int, weights: Audio, step: int, begin: int, converted: Audio) -> None:
    """Fill in the output frames from `begin` on; `samples` are those from frame `first` on."""
    phases, size = weights.shape
    for k in range(converted.shape[1]):
        place = (begin + k) * step
        phase, start = place % phases, place // phases - size // 2 + 1 - first
        for channel in range(converted.shape[0]):
            total = np.float32(0.0)
            for j in range(size):
                total += weights[phase, j] * samples[channel, start + j]
            converted[channel, k] = total


def _refuse_rates(sample_rate: int, new_rate: int) -> None:
    if sample_rate < 1 or new_rate < 1:
        raise InputError(f"rates of {sample_rate} and {new_rate} Hz", "above 0 Hz")
