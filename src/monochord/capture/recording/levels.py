"""How loud each microphone is, and what is wrong with its samples, in fixed memory."""

from dataclasses import dataclass

import numpy as np

from monochord.core.types import Block
from monochord.core.units import Samples, Seconds

CLIPPED = 0.999
"""From this share of full scale on, a sample counts as clipped; 16 bits reach 0.99997 and 1."""
HOLD: Seconds = 1.5
"""How long the highest peak is shown."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """One microphone over the newest stretch of audio, as shares of full scale.

    `held` is the highest peak of the last 1.5 s and `highest` that of the whole recording. `clipped` and
    `not_numbers` count samples since the begin; `clipping` tells whether some were in the last 1.5 s.
    """

    rms: float = 0.0
    peak: float = 0.0
    held: float = 0.0
    highest: float = 0.0
    clipped: Samples = 0
    not_numbers: Samples = 0
    clipping: bool = False


class Levels:
    """Takes blocks as they pass and judges them together, once for each `look`.

    >>> levels = Levels(channels=1)
    >>> levels.add(Block(samples=np.array([[0.5, -1.0]], np.float32), start=0))
    >>> levels.look(0.0)[0].clipped
    1
    """

    def __init__(self, channels: int) -> None:
        self._ears = [_Ear() for _ in range(channels)]
        self._blocks: list[Block] = []

    def add(self, block: Block) -> None:
        """Take a block."""
        self._blocks.append(block)

    def look(self, now: Seconds) -> tuple[Level, ...]:
        """Return each microphone's level, judged over what was added since the last look."""
        if self._blocks:
            samples = np.concatenate([block.samples for block in self._blocks], axis=1)
            self._blocks.clear()
            for ear, channel in zip(self._ears, samples, strict=True):
                ear.hear(channel, now)
        return tuple(ear.level(now) for ear in self._ears)


class _Ear:
    def __init__(self) -> None:
        self._rms = self._peak = self._held = self._highest = 0.0
        self._held_until = self._clipping_until = -np.inf
        self._clipped = self._not_numbers = 0

    def hear(self, channel: np.ndarray, now: Seconds) -> None:
        with np.errstate(all="ignore"):
            peak = float(max(channel.max(initial=0.0), -channel.min(initial=0.0)))
        if not np.isfinite(peak):
            numbers = channel[np.isfinite(channel)]
            self._not_numbers += channel.size - numbers.size
            channel, peak = numbers, float(np.abs(numbers).max(initial=0.0))
        if peak >= CLIPPED:
            self._clipped += int(np.count_nonzero(np.abs(channel) >= CLIPPED))
            self._clipping_until = now + HOLD
        self._peak, self._highest = peak, max(self._highest, peak)
        self._rms = float(np.sqrt(np.dot(channel, channel) / channel.size)) if channel.size else 0.0
        if peak >= self._held or now > self._held_until:
            self._held, self._held_until = peak, now + HOLD

    def level(self, now: Seconds) -> Level:
        return Level(
            rms=self._rms,
            peak=self._peak,
            held=self._held,
            highest=self._highest,
            clipped=self._clipped,
            not_numbers=self._not_numbers,
            clipping=now < self._clipping_until,
        )
