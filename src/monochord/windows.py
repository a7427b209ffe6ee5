"""Blocks into overlapping windows on an exact sample clock."""

from collections.abc import Iterable, Iterator

import numpy as np

from monochord.errors import InputError
from monochord.types import Block, Window
from monochord.units import Samples


def windows(blocks: Iterable[Block], *, size: Samples, hop: Samples, sample_rate: int) -> Iterator[Window]:
    """Yield windows of `size` frames that start at every multiple of `hop`, as soon as each is complete.

    Window k covers frames [k hop, k hop + size) of the sample clock, whatever the block sizes. Frames that
    were dropped are zeros in the samples, and the windows that touch them have `has_gap` set. A window whose
    every frame was dropped is still yielded, so that the output keeps the clock's pace.

    Parameters
    ----------
    blocks
        Blocks in order, from one stream.
    size, hop
        Window length and distance of window starts, in frames, both at least 1.
    sample_rate
        Frames a second.

    Yields
    ------
    Window
        With samples (channels, size) that own their memory.

    Raises
    ------
    InputError
        If `size` or `hop` is below 1.
    """
    if size < 1 or hop < 1:
        raise InputError(f"window of {size} frames, hop {hop}", "1 frame or more each")
    held: np.ndarray | None = None
    first = 0  # clock index of held[:, 0]
    gap_end = 0  # clock index just after the newest dropped frame
    start = 0
    for block in blocks:
        channels = block.samples.shape[0]
        if held is None:
            held = np.zeros((channels, 0), np.float32)
        if block.dropped:
            gap_end = block.start
        fill = np.zeros((channels, block.dropped), np.float32)
        held = np.concatenate((held, fill, block.samples), axis=1)
        end = first + held.shape[1]
        while start + size <= end:
            cut = held[:, start - first : start - first + size].copy()
            gap = start < gap_end and gap_start < start + size
            yield Window(samples=cut, start=start, sample_rate=sample_rate, has_gap=gap)
            start += hop
        keep = min(max(start - first, 0), held.shape[1])
        held, first = held[:, keep:], first + keep
