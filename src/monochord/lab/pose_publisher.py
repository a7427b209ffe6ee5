"""Publishes a robot's pose over DDS in real time, like a ROS 2 node.

As a process it plays a file that `write_script` wrote, with the array ``poses``. It prints what it publishes
as one line of JSON, reads each line of its standard input as the start, in s of the monotonic clock, and ends
when that input does::

    python -m monochord.lab.pose_publisher FILE.npz
"""

import sys
import threading
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

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

__all__ = ["PosePublisher", "PublisherSettings", "RowPublisher", "serve", "stamp_of", "write_script"]

MAX_WAIT: Seconds = 0.02
"""Longest wait before checking for a new start time, in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PublisherSettings(Checked):
    """The topic, rate and delay of a publisher.

    Parameters
    ----------
    rate
        Messages per second, equal to the rate of the array.
    delay
        Time in s between a pose and its message; the stamp is the time of the pose.
    topic
        ROS 2 topic.
    frame
        Coordinate frame.
    domain, interface
        DDS domain, None for ``$ROS_DOMAIN_ID``, and network interface.
    """

    rate: Annotated[Hertz, Meta(gt=0.0, le=2000.0)] = 100.0
    delay: NonNegative[Seconds] = 0.0
    topic: str = "/pose"
    frame: str = "string"
    domain: int | None = None
    interface: str = "lo"


class RowPublisher(Closing, ABC):
    """Sends the rows of an array at their times, in a separate thread.

    It always sends: the first row before its start, the last row after its end. `rows` (n, `columns`) are one
    every 1 / `rate` s; a row leaves `delay` in s after its time.
    """

    columns: int

    def __init__(self, rows: Floats, rate: Hertz, delay: Seconds) -> None:
        self._rows, self._rate, self._delay = rows, rate, delay
        self._begin = self._began = np.inf
        self._origin = time.monotonic()
        self._next = self._number = 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._publish, name="publisher", daemon=True)
        self._thread.start()

    @abstractmethod
    def send(self, row: list[float], taken: Seconds, number: int) -> None:
        """Send a row with its time, in s of the monotonic clock, and its number."""

    def begin_at(self, begin: Seconds) -> None:
        """Set the time of the first row, in s of the monotonic clock; not before now."""
        self._begin = begin

    def close(self) -> None:
        """Stop sending."""
        self._ended.set()
        self._thread.join()

    @classmethod
    def refuse_other(cls, rows: Floats) -> None:
        """Raise `InputError` for an array of the wrong shape."""
        if rows.ndim != 2 or rows.shape[1] != cls.columns or not len(rows):
            raise InputError(f"an array of shape {rows.shape}", f"(n, {cls.columns}), n above 0")

    def _publish(self) -> None:
        while not self._ended.is_set():
            self._ended.wait(min(self._send_due(self._begin, time.monotonic()), MAX_WAIT))

    def _send_due(self, begin: Seconds, now: Seconds) -> Seconds:
        """Send the rows that are due, and return the time until the next."""
        if begin != self._began:
            # Rows lie on a grid through the new begin: the next is the first on it that is not yet due.
            self._began = self._origin = begin
            self._next = int(np.ceil((now - self._delay - begin) * self._rate))
        while (due := self._origin + self._next / self._rate + self._delay) <= now:
            index = self._next if np.isfinite(self._began) else 0
            row = self._rows[min(max(index, 0), len(self._rows) - 1)]
            self.send(row.tolist(), due - self._delay, self._number)
            self._next += 1
            self._number += 1
        return due - now


class PosePublisher(RowPublisher):
    """A robot that publishes its pose: position in m and unit quaternion, (n, 7), one every 1 / `rate` s.

    Raises `InputError` where the DDS library is missing.

    >>> import numpy as np
    >>> from monochord.capture.instruments.pose_dds import PoseDds
    >>> with PosePublisher(np.array([[0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]])) as robot:
    ...     with PoseDds().open() as sensor:
    ...         while not (readings := sensor.poll()):
    ...             time.sleep(0.01)
    >>> float(readings[0].values[0, 0])
    0.1
    """

    columns = 7

    def __init__(self, poses: Floats, settings: PublisherSettings | None = None) -> None:
        self.refuse_other(poses)
        self._settings = settings = settings or PublisherSettings()
        self._participant = Participant(domain=settings.domain, interface=settings.interface)
        self._writer = self._participant.writer(settings.topic, "PoseStamped")
        super().__init__(poses, settings.rate, settings.delay)

    def send(self, row: list[float], taken: Seconds, number: int) -> None:  # noqa: ARG002
        """Publish a pose."""
        from monochord.capture.dds import messages as ros  # noqa: PLC0415

        stamp = stamp_of(taken)
        pose = ros.Pose(position=ros.Point(*row[:3]), orientation=ros.Quaternion(*row[3:]))
        self._writer.write(ros.PoseStamped(header=ros.header(stamp, self._settings.frame), pose=pose), stamp)

    def close(self) -> None:
        """Stop publishing and leave the domain."""
        super().close()
        self._participant.close()


def stamp_of(taken: Seconds) -> int:
    """Return a monotonic time as nanoseconds of the wall clock, which is the robot's."""
    return round((taken + clock_offsets()["realtime"]) * 1e9)


def serve(path: Path) -> None:
    """Play the script at `path` until the standard input ends."""
    arrays, settings = read_script(path, PublisherSettings)
    with PosePublisher(arrays["poses"], settings) as publisher:
        follow_input({"topic": settings.topic}, publisher.begin_at)


if __name__ == "__main__":
    serve(Path(sys.argv[1]))
