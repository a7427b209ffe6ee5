"""The robot's pose from ROS 2 over DDS, without a ROS installation."""

from collections import deque
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

from monochord.capture.instruments._collected import CollectedConnection
from monochord.capture.instruments._pose import pose_feed, unit_pose
from monochord.capture.instruments.base import Instrument
from monochord.core.errors import InputError
from monochord.core.types import Feed, InstrumentHealth, Readings
from monochord.core.units import Hertz, Seconds

if TYPE_CHECKING:
    from monochord.capture.dds.participant import TopicReader

MAX_PENDING = 100_000
"""Largest number of poses that wait for a poll; older ones count as missing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseDds(Instrument):
    """A pose on a ROS 2 `topic`; needs the extra ``ros``, but no ROS installation.

    Each reading has its time of arrival, taken in a DDS thread; its `device_time` is the header's stamp in ns
    of the sender's wall clock. A publisher may leave and return. An invalid pose counts as faulty, and so do
    a position more than 1e7 m away and an invalid stamp. CycloneDDS binds to all addresses; the kernel drops
    packets from other interfaces.

    Parameters
    ----------
    topic
        Name of the topic in ROS 2.
    kind
        ``pose`` for ``geometry_msgs/PoseStamped``, ``tf`` for ``tf2_msgs/TFMessage``.
    frame
        For ``tf``, the child frame whose transform is the pose; for ``pose``, the header's frame, empty for
        any.
    domain
        DDS domain; None for ``$ROS_DOMAIN_ID``, or else 0.
    interface
        Network interface; ``lo`` is this machine alone, empty lets the library choose.
    rate
        Expected poses per second; 0 if unknown.
    """

    topic: str = "/pose"
    kind: Literal["pose", "tf"] = "pose"
    frame: str = ""
    domain: int | None = None
    interface: str = "lo"
    rate: Hertz = 0.0

    @contextmanager
    def open(self) -> Generator["_PoseDdsConnection"]:
        """Join the domain; raises `InputError` without the library. A missing publisher is not an error."""
        if self.kind == "tf" and not self.frame:
            raise InputError("kind 'tf' without a frame", "a frame", "set frame=tool0")
        from monochord.capture.dds.participant import Participant  # noqa: PLC0415

        details = {"topic": self.topic, "kind": self.kind, "frame": self.frame, "interface": self.interface}
        feed = pose_feed(self.rate, details)
        with Participant(domain=self.domain, interface=self.interface) as participant:
            connection = _PoseDdsConnection(self, feed)
            message = "PoseStamped" if self.kind == "pose" else "TFMessage"
            connection.reader = participant.reader(self.topic, message, connection.add)
            yield connection


class _PoseDdsConnection(CollectedConnection):
    def __init__(self, options: PoseDds, feed: Feed) -> None:
        super().__init__(feed)
        self._options = options
        self.reader: TopicReader | None = None
        self._pending: deque[tuple[tuple[float, ...] | None, int, Seconds]] = deque(maxlen=MAX_PENDING)
        self._lost = 0

    @property
    def health(self) -> InstrumentHealth:
        counted, reader = super().health, self.reader
        if reader is None:
            return counted
        return replace(
            counted,
            missing=self._lost,
            faulty=counted.faulty + reader.faulty,
            reconnects=reader.returns,
        )

    def add(self, message: Any, now: Seconds) -> None:
        """Store the poses of a message for the next poll; called from a DDS thread."""
        for header, position, orientation in self._poses(message):
            pose = unit_pose(
                (position.x, position.y, position.z),
                (orientation.x, orientation.y, orientation.z, orientation.w),
            )
            stamp = header.stamp
            valid = pose if stamp.sec >= 0 and stamp.nanosec < 1_000_000_000 else None
            self._lost += len(self._pending) == MAX_PENDING
            self._pending.append((valid, stamp.sec * 1_000_000_000 + stamp.nanosec, now))

    def poll(self) -> list[Readings]:
        for _ in range(len(self._pending)):
            pose, tick, now = self._pending.popleft()
            if pose is None:
                self._collected.refuse()
            else:
                self._collected.add(pose, time=now, tick=tick)
        return self._collected.take()

    def _poses(self, message: Any) -> Iterator[tuple[Any, Any, Any]]:
        """Yield header, position and orientation of each pose of the selected frame in a message."""
        frame = self._options.frame
        if self._options.kind == "pose":
            if frame in {"", message.header.frame_id}:
                yield message.header, message.pose.position, message.pose.orientation
            return
        for part in message.transforms:
            if part.child_frame_id == frame:
                yield part.header, part.transform.translation, part.transform.rotation
