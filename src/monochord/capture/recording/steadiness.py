"""Whether a source's frames keep pace with its own times of them: frames that nobody counted as lost."""

from statistics import median

from monochord.core.types import Block
from monochord.core.units import Seconds

OVER: Seconds = 1.0
"""Times are compared from one such stretch to the next."""
SLIP: Seconds = 3e-3
"""No converter's clock is off by so much in a second; one that missed periods uncounted is."""
FEWEST = 4
"""Blocks that a stretch must have."""


class Steadiness:
    """Follows when frame 0 was at the converter, as each block's time and index say; that must not move.

    A server that comes late for a period may lose it and count on as if nothing was; then the times of its
    frames jump against their indices. A slow drift, as two clocks have, is none.

    >>> import numpy as np
    >>> steady = Steadiness(1000)
    >>> for k in range(30):
    ...     late = 0.05 if k >= 10 else 0.0
    ...     steady.add(Block(samples=np.zeros((1, 100)), start=100 * k, adc_time=0.1 * k + late))
    >>> round(steady.slipped, 3)
    0.05
    """

    def __init__(self, sample_rate: int) -> None:
        self._rate = sample_rate
        self._here: list[Seconds] = []
        self._until: Seconds | None = None
        self._before: Seconds | None = None
        self.slipped: Seconds = 0.0

    def add(self, block: Block) -> None:
        """Take the next block; one without a time says nothing."""
        if block.adc_time is None:
            return
        if self._until is None:
            self._until = block.adc_time + OVER
        self._here.append(block.adc_time - block.start / self._rate)
        if block.adc_time >= self._until and len(self._here) >= FEWEST:
            now = median(self._here)
            step = 0.0 if self._before is None else now - self._before
            self.slipped += step if abs(step) > SLIP else 0.0
            self._before, self._until = now, block.adc_time + OVER
            self._here.clear()
