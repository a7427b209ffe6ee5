"""A robot that sends datagrams, or wrenches, and whose clock may be wrong; the laboratory's publishes poses.

As a process it sends the poses of a file that `write_script` wrote as datagrams::

    python -m tests.devices.robot FILE.npz
"""

import json
import socket
import sys
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from monochord.capture.dds import messages as ros
from monochord.capture.dds.participant import Participant
from monochord.core.types import Floats
from monochord.core.units import Hertz, Seconds
from monochord.lab._script import follow_input, read_script
from monochord.lab.pose_publisher import RowPublisher, stamp_of


@dataclass(frozen=True, slots=True, kw_only=True)
class UdpSettings:
    """Where datagrams go, how many a second, how late, and how far off the robot's clock is."""

    port: int
    rate: Hertz = 100.0
    delay: Seconds = 0.0
    clock_error: Seconds = 0.0


class UdpRobot(RowPublisher):
    """Sends poses (n, 7) as datagrams of JSON to a port of this machine."""

    columns = 7

    def __init__(self, poses: Floats, settings: UdpSettings) -> None:
        self.refuse_other(poses)
        self._settings = settings
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        super().__init__(poses, settings.rate, settings.delay)

    def send(self, row: list[float], taken: Seconds, number: int) -> None:
        stamp = stamp_of(taken + self._settings.clock_error) * 1e-9
        place = {"position": row[:3], "orientation": row[3:]}
        with suppress(OSError):  # nobody listens
            datagram = json.dumps({"stamp": stamp, **place, "sequence": number}).encode()
            self._socket.sendto(datagram, ("127.0.0.1", self._settings.port))

    def close(self) -> None:
        super().close()
        self._socket.close()


class WrenchPublisher(RowPublisher):
    """Publishes wrenches (n, 6), in N and N m, as a ROS 2 node does on the topic ``/wrench``."""

    columns = 6

    def __init__(self, wrenches: Floats, rate: Hertz, *, domain: int, frame: str = "string") -> None:
        self.refuse_other(wrenches)
        self._frame = frame
        self._participant = Participant(domain=domain, interface="lo")
        self._writer = self._participant.writer("/wrench", "WrenchStamped")
        super().__init__(wrenches, rate, 0.0)

    def send(self, row: list[float], taken: Seconds, number: int) -> None:
        stamp = stamp_of(taken)
        wrench = ros.Wrench(force=ros.Vector3(*row[:3]), torque=ros.Vector3(*row[3:]))
        self._writer.write(ros.WrenchStamped(header=ros.header(stamp, self._frame), wrench=wrench), stamp)

    def close(self) -> None:
        super().close()
        self._participant.close()


def serve(path: Path) -> None:
    """Play the script at `path` until the standard input ends."""
    arrays, settings = read_script(path, UdpSettings)
    with UdpRobot(arrays["poses"], settings) as robot:
        follow_input({"port": settings.port}, robot.begin_at)


if __name__ == "__main__":
    serve(Path(sys.argv[1]))
