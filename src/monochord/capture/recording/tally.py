"""Counts what comes, and says how a recording stands."""

import time
from collections.abc import Mapping
from pathlib import Path

from monochord.capture.instruments.base import Connection
from monochord.capture.recording.disk import space
from monochord.capture.recording.feeds import FeedTally
from monochord.capture.recording.levels import Levels
from monochord.capture.recording.progress import Progress
from monochord.capture.recording.pumps import Polled, Pumps
from monochord.capture.recording.steadiness import Steadiness
from monochord.capture.sources.base import Stream
from monochord.core.types import Block
from monochord.core.units import Seconds

QUIET: Seconds = 0.5
"""Audio whose next block is this late is silent."""
DUE = 4
"""The same for large blocks: so many of them are overdue."""


class Tally:
    """Counts a recording from now on: `stream` beside `connections` by name, into a file in `folder`.

    `reserve` is how many bytes of the disk stay free.
    """

    def __init__(
        self, stream: Stream, connections: Mapping[str, Connection], folder: Path, reserve: float
    ) -> None:
        self.begin = self._heard = time.monotonic()
        self._stream, self._connections = stream, connections
        self._folder, self._reserve = folder, reserve
        self._rate = stream.signal.sample_rate
        self._levels = Levels(stream.signal.channels)
        self._steadiness = Steadiness(self._rate)
        self._feeds = {name: FeedTally(name, open_.feed, self.begin) for name, open_ in connections.items()}
        self._frames = self._dropped = self._gaps = self._end = 0
        self._patience = QUIET

    @property
    def audio_end(self) -> Seconds:
        """How much audio there is, with what was lost of it."""
        return self._end / self._rate

    def add(self, batch: Block | Polled) -> None:
        """Count a batch."""
        now = time.monotonic()
        if isinstance(batch, Polled):
            self._feeds[batch.name].add(batch.readings, now)
            return
        frames = batch.samples.shape[1]
        self._frames += frames
        self._dropped += batch.dropped
        self._gaps += batch.dropped > 0
        self._end = batch.start + frames
        self._heard = now
        self._patience = max(QUIET, DUE * frames / self._rate)
        self._levels.add(batch)
        self._steadiness.add(batch)

    def look(self, size: int, pumps: Pumps) -> Progress:
        """Return how the recording stands, whose file has `size` bytes."""
        now = time.monotonic()
        quiet, elapsed = now - self._heard, now - self.begin
        return Progress(
            time=now,
            elapsed=elapsed,
            frames=self._frames,
            dropped=self._dropped,
            gaps=self._gaps,
            silent=quiet if quiet > self._patience else 0.0,
            health=self._stream.health,
            levels=self._levels.look(now),
            feeds=tuple(feed.look(now, self._connections[name].health) for name, feed in self._feeds.items()),
            space=space(self._folder, size=size, elapsed=elapsed, reserve=self._reserve),
            waiting=pumps.inbox.filled,
            held_up=pumps.held_up,
            doubt=pumps.doubt,
            slipped=self._steadiness.slipped,
        )
