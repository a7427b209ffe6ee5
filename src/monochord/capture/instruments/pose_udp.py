"""The robot's pose as JSON datagrams, which most robot controllers can send."""

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass

from monochord.capture.address import listening
from monochord.capture.instruments._json_feed import JsonConnection, Stamped
from monochord.capture.instruments._pose import UPRIGHT, pose_feed, unit_pose
from monochord.capture.instruments.base import Instrument
from monochord.core.units import Hertz


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseUdp(Instrument):
    """Poses received at `address`, one JSON datagram each.

    A datagram is ``{"stamp": 1.5, "position": [x, y, z], "orientation": [x, y, z, w], "sequence": 7}``:
    seconds of the sender's clock, metres, a quaternion and the sender's count; all but the position are
    optional. The stamp becomes `device_time`, in ns. An unreadable datagram counts as faulty, and so does a
    position more than 1e7 m away.

    Parameters
    ----------
    address
        Address to bind: ``HOST:PORT``, or ``PORT`` for this machine alone.
    rate
        Expected poses per second; 0 if unknown.
    """

    address: str = "127.0.0.1:9871"
    rate: Hertz = 0.0

    @contextmanager
    def open(self) -> Generator["JsonConnection[_Pose]"]:
        """Listen; raises `DeviceError` if the port is taken. A missing sender is not an error."""
        feed = pose_feed(self.rate, {"address": self.address})
        with listening(self.address) as sock:
            yield JsonConnection(sock, feed, _Pose, lambda pose: unit_pose(pose.position, pose.orientation))


class _Pose(Stamped, kw_only=True):
    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float] = UPRIGHT
