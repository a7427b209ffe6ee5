"""Publishes a robot's pose in real time: over DDS like a ROS 2 node, and as JSON datagrams.

As a process it plays a file that `write_script` wrote, with the arrays ``poses`` and optionally ``wrenches``.
It prints what it publishes as one line of JSON, reads each line of its standard input as the start, in s of
the monotonic clock, and ends when that input does::

    python -m monochord.lab.pose_publisher FILE.npz
"""

import json
import socket
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from monochord.capture.dds.participant import Participant
from monochord.core.clock import clock_offsets
from monochord.core.closing import Closing
from monochord.core.errors import InputError
from monochord.core.ranges import Checked, NonNegative
from monochord.core.types import Floats
from monochord.core.units import Hertz, Seconds
from monochord.lab._script import follow_input, read_script, write_script

__all__ = ["PosePublisher", "PublisherSettings", "serve", "write_script"]

MAX_WAIT: Seconds = 0.02
"""Longest wait before checking for a new start time, in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PublisherSettings(Checked):
    """The topics, rates and delays of a publisher.

    Parameters
    ----------
    rate
        Poses per second, equal to the rate of the array.
    wrench_rate
        Wrenches per second, likewise.
    delay
        Time in s between a pose and its message; the stamp is the time of the pose.
    clock_error
        Offset of the robot's clock, which sets the stamps, from the wall clock, in s.
    topic, wrench_topic
        ROS 2 topics; an empty name disables one.
    frame
        Coordinate frame of both topics.
    domain, interface
        DDS domain, None for ``$ROS_DOMAIN_ID``, and network interface.
    udp
        ``HOST:PORT`` to send JSON datagrams to; empty for none.
    """

    rate: Annotated[Hertz, Meta(gt=0.0, le=2000.0)] = 100.0
    wrench_rate: Annotated[Hertz, Meta(gt=0.0, le=2000.0)] = 100.0
    delay: NonNegative[Seconds] = 0.0
    clock_error: Seconds = 0.0
    topic: str = "/pose"
    wrench_topic: str = "/wrench"
    frame: str = "string"
    domain: int | None = None
    interface: str = "lo"
    udp: str = ""

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.udp and not self.udp.rpartition(":")[2].isdecimal():
            raise InputError(f"udp '{self.udp}'", "HOST:PORT")


class PosePublisher(Closing):
    """A robot that publishes its pose, in a separate thread.

    It always publishes: the first pose before its start, the last pose after its end. `poses` (n, 7) are
    position in m and unit quaternion, one every 1 / `rate` s; `wrenches` (m, 6) are in N and N m, one every 1
    / `wrench_rate` s. `begin` is the first pose's time, in s of the monotonic clock.

    >>> import numpy as np
    >>> from monochord.capture.instruments.pose_dds import PoseDds
    >>> with PosePublisher(np.array([[0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])) as robot:
    ...     with PoseDds().open() as sensor:
    ...         while not (readings := sensor.poll()):
    ...             time.sleep(0.01)
    >>> float(readings[0].values[0, 0])
    0.1
    """

    def __init__(
        self,
        poses: Floats,
        settings: PublisherSettings | None = None,
        *,
        wrenches: Floats | None = None,
        begin: Seconds | None = None,
    ) -> None:
        for array, columns in ((poses, 7), (wrenches, 6)):
            if array is not None and (array.ndim != 2 or array.shape[1] != columns or not len(array)):
                raise InputError(f"an array of shape {array.shape}", f"(n, {columns}), n above 0")
        self._settings = settings = settings or PublisherSettings()
        self._begin = np.inf if begin is None else begin
        self._ended = threading.Event()
        self._output = _Output(settings, wrenches=wrenches is not None)
        self._tracks = [_Track(poses, settings.rate, settings.delay, self._output.pose)]
        if wrenches is not None:
            self._tracks.append(_Track(wrenches, settings.wrench_rate, settings.delay, self._output.wrench))
        self._thread = threading.Thread(target=self._publish, name="pose-publisher", daemon=True)
        self._thread.start()

    @property
    def listeners(self) -> int:
        """Number of readers of the topics."""
        return self._output.listeners

    def begin_at(self, begin: Seconds) -> None:
        """Set the time of the first pose, in s of the monotonic clock; not before now."""
        self._begin = begin

    def close(self) -> None:
        """Stop publishing and leave the domain."""
        self._ended.set()
        self._thread.join()
        self._output.close()

    def _publish(self) -> None:
        while not self._ended.is_set():
            wait = min(track.send_due(self._begin, time.monotonic()) for track in self._tracks)
            self._ended.wait(min(wait, MAX_WAIT))


class _Track:
    """One array in time: `send` is called with a row, its monotonic time, and its number."""

    def __init__(
        self, rows: Floats, rate: Hertz, delay: Seconds, send: Callable[[list[float], Seconds, int], None]
    ) -> None:
        self._rows, self._rate, self._delay, self._send = rows, rate, delay, send
        self._began = np.inf
        self._origin = time.monotonic()
        self._next = self._number = 0

    def send_due(self, begin: Seconds, now: Seconds) -> Seconds:
        """Send the rows that are due, and return the time until the next."""
        if begin != self._began:
            # Rows lie on a grid through the new begin: the next is the first on it that is not yet due.
            self._began = self._origin = begin
            self._next = int(np.ceil((now - self._delay - begin) * self._rate))
        while (due := self._origin + self._next / self._rate + self._delay) <= now:
            index = self._next if np.isfinite(self._began) else 0
            row = self._rows[min(max(index, 0), len(self._rows) - 1)]
            self._send(row.tolist(), due - self._delay, self._number)
            self._next += 1
            self._number += 1
        return due - now


class _Output:
    """Sends poses and wrenches, stamped by the robot's clock."""

    def __init__(self, settings: PublisherSettings, *, wrenches: bool) -> None:
        self._settings = settings
        self._participant: Participant | None = None
        self._writers: dict[str, Any] = {}
        topics = {"PoseStamped": settings.topic, "WrenchStamped": settings.wrench_topic if wrenches else ""}
        if any(topics.values()):
            self._participant = Participant(domain=settings.domain, interface=settings.interface)
            self._writers = {
                message: self._participant.writer(topic, message)
                for message, topic in topics.items()
                if topic
            }
        host, _, port = settings.udp.rpartition(":")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM) if settings.udp else None
        self._to = (host or "127.0.0.1", int(port or 0))

    @property
    def listeners(self) -> int:
        return sum(writer.listeners for writer in self._writers.values())

    def pose(self, row: list[float], taken: Seconds, number: int) -> None:
        stamp = self._stamp(taken)
        writer = self._writers.get("PoseStamped")
        if writer:
            from monochord.capture.dds import messages as ros  # noqa: PLC0415

            pose = ros.Pose(position=ros.Point(*row[:3]), orientation=ros.Quaternion(*row[3:]))
            writer.write(ros.PoseStamped(header=ros.header(stamp, self._settings.frame), pose=pose), stamp)
        if self._socket:
            place = {"position": row[:3], "orientation": row[3:]}
            datagram = {"stamp": stamp * 1e-9, **place, "sequence": number}
            with suppress(OSError):  # nobody listens
                self._socket.sendto(json.dumps(datagram).encode(), self._to)

    def wrench(self, row: list[float], taken: Seconds, number: int) -> None:  # noqa: ARG002
        stamp = self._stamp(taken)
        writer = self._writers.get("WrenchStamped")
        if writer:
            from monochord.capture.dds import messages as ros  # noqa: PLC0415

            wrench = ros.Wrench(force=ros.Vector3(*row[:3]), torque=ros.Vector3(*row[3:]))
            writer.write(
                ros.WrenchStamped(header=ros.header(stamp, self._settings.frame), wrench=wrench), stamp
            )

    def close(self) -> None:
        if self._participant:
            self._participant.close()
        if self._socket:
            self._socket.close()

    def _stamp(self, taken: Seconds) -> int:
        """Return a monotonic time as nanoseconds of the robot's clock."""
        return round((taken + clock_offsets()["realtime"] + self._settings.clock_error) * 1e9)


def serve(path: Path) -> None:
    """Play the script at `path` until the standard input ends."""
    arrays, settings = read_script(path, PublisherSettings)
    with PosePublisher(arrays["poses"], settings, wrenches=arrays.get("wrenches")) as publisher:
        follow_input({"topic": settings.topic, "udp": settings.udp}, publisher.begin_at)


if __name__ == "__main__":
    serve(Path(sys.argv[1]))
