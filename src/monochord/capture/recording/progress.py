"""A recording at one moment: what its view shows and what its watch judges."""

from dataclasses import dataclass

from monochord.capture.recording.disk import Space
from monochord.capture.recording.feeds import FeedNow
from monochord.capture.recording.levels import Level
from monochord.core.types import StreamHealth
from monochord.core.units import Samples, Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """A running recording.

    `time` is the monotonic clock's and `elapsed` since the recording began. `frames`, `dropped` and `gaps`
    are those of the blocks that came; `silent` is for how long no audio has come, 0 while it is not late.
    `levels` are the microphones', `feeds` the instruments'. `waiting` is the share of the room for what is
    not yet written, and `held_up` for how long instruments waited for room. `doubt` is how long ago the
    source says that its newest block began, where that cannot be, and `slipped` by how much its times moved
    against its frames.
    """

    time: Seconds
    elapsed: Seconds
    frames: Samples
    dropped: Samples
    gaps: int
    silent: Seconds
    health: StreamHealth
    levels: tuple[Level, ...]
    feeds: tuple[FeedNow, ...]
    space: Space
    waiting: float = 0.0
    held_up: Seconds = 0.0
    doubt: Seconds = 0.0
    slipped: Seconds = 0.0
