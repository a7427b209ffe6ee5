"""Cuts blocks into overlapping windows on an exact sample clock."""

from collections.abc import Iterable, Iterator

import numpy as np

from monochord.core.errors import InputError
from monochord.core.ranges import Count, SampleRate, checked
from monochord.core.types import Audio, Block, Window
from monochord.core.units import Samples


@checked
def windows(blocks: Iterable[Block], *, size: Count, hop: Count, sample_rate: SampleRate) -> Iterator[Window]:
    """Yield windows of `size` frames that start at every multiple of `hop`, as soon as each is complete.

    Window k covers frames [k hop, k hop + size) of the sample clock, whatever the block sizes. Dropped frames
    are zeros, and windows that contain any have `has_gap` set. A window of dropped frames only is still
    yielded, so that the output keeps the clock's pace. Memory does not grow with the stream, nor with the
    length of a gap.

    Parameters
    ----------
    blocks
        Blocks of one stream, in order.
    size, hop
        Window length and hop, in frames, both at least 1.
    sample_rate
        Sample rate in Hz.

    Yields
    ------
    Window
        A window with a copy of the samples, (channels, size).

    Raises
    ------
    InputError
        If `size` or `hop` is below 1, or a block begins before the last one's end or has other channels.

    Examples
    --------
    >>> ones = np.ones((1, 3), np.float32)
    >>> blocks = [Block(samples=ones, start=0), Block(samples=ones, start=4, dropped=1)]
    >>> [(w.start, w.has_gap) for w in windows(blocks, size=2, hop=2, sample_rate=44100)]
    [(0, False), (2, True), (4, False)]
    """
    tape: _Tape | None = None
    start = gap_end = 0
    for block in blocks:
        if tape is None:
            tape = _Tape(block.samples.shape[0], size)
        if len(block.samples) != len(tape.buffer):
            given = f"a block of {len(block.samples)} channels after one of {len(tape.buffer)}"
            raise InputError(given, "blocks of one stream")
        for run, is_gap in _runs(block, tape.end, size):
            tape.append(run)
            if is_gap:
                gap_end = tape.end
            # Every window that this run completes ends inside the run, so all earlier gaps end before it.
            while start + size <= tape.end:
                samples = tape.cut(start, size)
                yield Window(samples=samples, start=start, sample_rate=sample_rate, has_gap=start < gap_end)
                start += hop


def _runs(block: Block, end: Samples, longest: Samples) -> Iterator[tuple[Audio, bool]]:
    """Yield the frames after clock index `end`, lost frames as zeros, in runs of limited length."""
    lost = block.start - end
    if lost < 0:
        raise InputError(f"a block from frame {block.start}", f"{end} or later, where the last one ended")
    zeros = np.zeros((block.samples.shape[0], min(lost, longest)), np.float32)
    for done in range(0, lost, longest):
        yield zeros[:, : lost - done], True
    for done in range(0, block.samples.shape[1], longest):
        yield block.samples[:, done : done + longest], False


class _Tape:
    """The newest frames of a stream, at least `size` of them, in preallocated memory."""

    SPARE = 8  # windows in the buffer before the oldest are dropped: each frame is moved 1/7 times on average

    def __init__(self, channels: int, size: Samples) -> None:
        self.size = size
        self.buffer = np.zeros((channels, self.SPARE * size), np.float32)
        self.filled = 0
        self.end = 0  # clock index just after the newest frame

    def append(self, run: Audio) -> None:
        """Append at most `size` frames."""
        if self.filled + run.shape[1] > self.buffer.shape[1]:
            self.buffer[:, : self.size] = self.buffer[:, self.filled - self.size : self.filled]
            self.filled = self.size
        self.buffer[:, self.filled : self.filled + run.shape[1]] = run
        self.filled += run.shape[1]
        self.end += run.shape[1]

    def cut(self, start: Samples, size: Samples) -> Audio:
        """Return a copy of the frames from clock index `start` on."""
        at = self.filled - (self.end - start)
        return self.buffer[:, at : at + size].copy()
