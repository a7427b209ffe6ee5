"""The robot's pose as JSON datagrams, which most robot controllers can send."""

import logging
import socket
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass

import msgspec

from monochord.capture.address import listening
from monochord.capture.instruments._columns import rotation_names
from monochord.capture.instruments._json_feed import JsonConnection, Stamped
from monochord.capture.instruments._pose import UPRIGHT, pose_feed, unit_pose
from monochord.capture.instruments.base import Instrument
from monochord.core.types import Feed
from monochord.core.units import Hertz

MAX_HEADS = 64
"""Most sets of names that are remembered as judged."""
_log = logging.getLogger("monochord")
_FIELDS = msgspec.json.Decoder(dict[str, msgspec.Raw])
"""Reads the names of a datagram, and no value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseUdp(Instrument):
    """Poses received at `address`, one JSON datagram each.

    A datagram is ``{"stamp": 1.5, "position": [x, y, z], "orientation": [x, y, z, w], "sequence": 7}``:
    seconds of the sender's clock, metres, a quaternion and the sender's count; all but the position are
    optional. The stamp becomes `device_time`, in ns. An unreadable datagram counts as faulty, and so does a
    position more than 1e7 m away. Other names are not read, as a line in the log says; a datagram whose
    rotation has another name, such as ``rpy``, is faulty.

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
    def open(self) -> Generator["_PoseUdpConnection"]:
        """Listen; raises `DeviceError` if the port is taken. A missing sender is not an error."""
        feed = pose_feed(self.rate, {"address": self.address})
        with listening(self.address) as sock:
            yield _PoseUdpConnection(sock, feed)


class _Pose(Stamped, kw_only=True):
    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float] = UPRIGHT


class _PoseUdpConnection(JsonConnection[_Pose]):
    """Reads poses; a rotation under a name that is not read is never taken as upright."""

    def __init__(self, sock: socket.socket, feed: Feed) -> None:
        super().__init__(sock, feed, _Pose, lambda pose: unit_pose(pose.position, pose.orientation))
        self._judged: dict[frozenset[str], bool] = {}

    def _read(self, text: bytes) -> _Pose | None:
        pose = super()._read(text)
        try:
            names = frozenset(_FIELDS.decode(text)) if pose else frozenset[str]()
        except (msgspec.DecodeError, UnicodeDecodeError):  # of a name that is not read
            return None
        return pose if pose and self._is_clear(names) else None

    def _is_clear(self, names: frozenset[str]) -> bool:
        """Return whether the names of a datagram leave no doubt about its rotation; log those not read."""
        if names in self._judged:
            return self._judged[names]
        unread = sorted(names - {*_Pose.__struct_fields__})
        turns = [] if "orientation" in names else rotation_names(unread)
        if len(self._judged) < MAX_HEADS:
            self._judged[names] = not turns
            if turns:
                line = (
                    "monochord: poses with %s, which may be a rotation, are refused: send it as orientation"
                )
                _log.warning(line + " [x, y, z, w], a quaternion", ", ".join(turns))
            elif unread:
                _log.warning("monochord: poses: not read: %s", ", ".join(unread))
        return not turns
