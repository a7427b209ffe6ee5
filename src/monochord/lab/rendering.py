"""What a rendered session is: microphones, wrench, pose, labels and events, at true times."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, Samples, Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Happening:
    """An event at a time in s: a phase that begins, a tap, the drivers that go on or off."""

    time: Seconds
    kind: str
    text: str = ""
    data: Mapping[str, float | str | bool] = field(default_factory=dict[str, float | str | bool])


@dataclass(frozen=True, slots=True, kw_only=True)
class Rendering:
    """A session, or a stretch of one, at true times.

    `microphones` (2, n) float32 in full scale begin at frame `start`; `wrench` (m, 6) in N and N m, `pose`
    (k, 7) in m and as a unit quaternion, and every column (l,) of `labels` begin at the first multiple of
    their period that is not before it. Labels are NaN where there is no contact to speak of.
    """

    start: Samples
    sample_rate: int
    force_rate: Hertz
    pose_rate: Hertz
    label_rate: Hertz
    microphones: Audio
    wrench: Floats
    pose: Floats
    labels: dict[str, Floats]
    events: tuple[Happening, ...]

    @property
    def begin(self) -> Seconds:
        """When it begins, in s."""
        return self.start / self.sample_rate

    @property
    def seconds(self) -> Seconds:
        """How long it lasts, in s."""
        return self.microphones.shape[1] / self.sample_rate

    def index(self, rate: Hertz, count: int) -> NDArray[np.int64]:
        """Return which readings these `count` are of a stream of a rate."""
        return first_reading(self.start, rate, self.sample_rate) + np.arange(count, dtype=np.int64)

    @property
    def wrench_time(self) -> Floats:
        """When the wrenches were taken, (m,) in s."""
        return self.index(self.force_rate, len(self.wrench)) / self.force_rate

    @property
    def pose_time(self) -> Floats:
        """When the poses were taken, (k,) in s."""
        return self.index(self.pose_rate, len(self.pose)) / self.pose_rate

    @property
    def label_time(self) -> Floats:
        """When the labels hold, (l,) in s."""
        return self.index(self.label_rate, len(self.labels["contact"])) / self.label_rate


def joined(parts: Iterable[Rendering]) -> Rendering:
    """Return consecutive stretches as one; raises `ValueError` where there is none.

    Parameters
    ----------
    parts
        Stretches of one session, in order, each beginning where the one before ends.

    Returns
    -------
    Rendering
        From the first one's begin to the last one's end.
    """
    parts = list(parts)
    if not parts:
        raise ValueError("nothing to join")
    first = parts[0]
    return Rendering(
        start=first.start,
        sample_rate=first.sample_rate,
        force_rate=first.force_rate,
        pose_rate=first.pose_rate,
        label_rate=first.label_rate,
        microphones=np.concatenate([part.microphones for part in parts], axis=1),
        wrench=np.concatenate([part.wrench for part in parts]),
        pose=np.concatenate([part.pose for part in parts]),
        labels={name: np.concatenate([part.labels[name] for part in parts]) for name in first.labels},
        events=tuple(event for part in parts for event in part.events),
    )


def first_reading(frame: Samples, rate: Hertz, sample_rate: int) -> int:
    """Return which reading of a rate is the first that is not before a frame of the microphones.

    Examples
    --------
    >>> first_reading(44100, 1000.0, 44100), first_reading(44101, 1000.0, 44100)
    (1000, 1001)
    """
    return math.ceil(frame * rate / sample_rate - 1e-9)
