"""Reads many datagrams from a socket in one system call, each with the kernel's time of arrival.

Linux only: ``recvmmsg`` and ``SO_TIMESTAMPNS``. Seven thousand datagrams a second cost one call and a few
array operations per poll, without a Python object for each.
"""

import ctypes
import errno
import socket
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats
from monochord.core.units import Samples, Seconds

BATCH = 256
MAX_CALLS = 64  # calls a poll: whoever sends faster than can be read must not keep a poll from ending
RECEIVE_BUFFER = 8 << 20
TIMESTAMPNS = 35  # SO_TIMESTAMPNS and SCM_TIMESTAMPNS of asm-generic/socket.h, which Python does not name
RECEIVE_BUFFER_FORCE = 33  # SO_RCVBUFFORCE, likewise
CONTROL = 64

# struct mmsghdr of a 64-bit Linux, and its struct iovec.
HEADER = np.dtype(
    {
        "names": ["name", "namelen", "iov", "iovlen", "control", "controllen", "flags", "length"],
        "formats": ["u8", "u4", "u8", "u8", "u8", "u8", "i4", "u4"],
        "offsets": [0, 8, 16, 24, 32, 40, 48, 56],
        "itemsize": 64,
    }
)
VECTOR = np.dtype([("base", "u8"), ("length", "u8")])
STAMP = np.dtype(
    [("length", "u8"), ("level", "i4"), ("type", "i4"), ("seconds", "i8"), ("nanoseconds", "i8")]
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Datagrams:
    """Datagrams from a socket: `payload` (n, size) uint8, with `length` (n,) valid bytes each.

    Longer datagrams are truncated. `stamp` (n,) is the kernel's time of arrival in s of the wall clock, NaN
    where it gave none.
    """

    payload: NDArray[np.uint8]
    length: NDArray[np.int64]
    stamp: Floats


class Receiver:
    """Reads datagrams of at most `size` bytes; a longer one has length `size` + 1.

    The socket becomes non-blocking, time-stamped, and gets the largest buffer that the kernel grants.
    """

    def __init__(self, sock: socket.socket, size: Samples) -> None:
        sock.setblocking(False)
        sock.setsockopt(socket.SOL_SOCKET, TIMESTAMPNS, 1)
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER)
        with suppress(PermissionError):  # root may go beyond net.core.rmem_max
            sock.setsockopt(socket.SOL_SOCKET, RECEIVE_BUFFER_FORCE, RECEIVE_BUFFER)
        self._socket, self._size = sock, size
        self._payload = np.zeros((BATCH, size + 1), np.uint8)
        self._control = np.zeros((BATCH, CONTROL), np.uint8)
        self._vectors = np.zeros(BATCH, VECTOR)
        self._vectors["base"] = _addresses(self._payload)
        self._vectors["length"] = size + 1
        self._headers = np.zeros(BATCH, HEADER)
        self._headers["iov"] = _addresses(self._vectors)
        self._headers["iovlen"] = 1
        self._headers["control"] = _addresses(self._control)
        self._headers["controllen"] = CONTROL

    @property
    def buffer(self) -> int:
        """Size of the kernel's receive buffer in bytes; a short datagram takes some 800."""
        return self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)

    def take(self) -> Datagrams:
        """Return the datagrams received so far, without waiting."""
        parts: list[Datagrams] = []
        for _ in range(MAX_CALLS):
            part = self._batch()
            parts.append(part)
            if part.length.size < BATCH:
                break
        if len(parts) == 1:
            return parts[0]
        return Datagrams(
            payload=np.concatenate([part.payload for part in parts]),
            length=np.concatenate([part.length for part in parts]),
            stamp=np.concatenate([part.stamp for part in parts]),
        )

    def _batch(self) -> Datagrams:
        count = 0
        # A device that is switched off answers with "refused", once for each request; the next call goes on.
        for _ in range(8):
            count = _recvmmsg()(
                self._socket.fileno(), self._headers.ctypes.data, BATCH, socket.MSG_DONTWAIT, None
            )
            if count >= 0 or ctypes.get_errno() in {errno.EAGAIN, errno.EBADF}:
                break
        count = max(count, 0)
        heads = self._headers[:count]
        stamp = np.ascontiguousarray(self._control[:count, : STAMP.itemsize]).view(STAMP).reshape(count)
        known = (heads["controllen"] >= STAMP.itemsize) & (stamp["type"] == TIMESTAMPNS)
        seconds = stamp["seconds"] + 1e-9 * stamp["nanoseconds"]
        heads["controllen"] = CONTROL
        return Datagrams(
            payload=self._payload[:count].copy(),
            length=heads["length"].astype(np.int64),
            stamp=np.where(known, seconds, np.nan),
        )


def wait_readable(sock: socket.socket, seconds: Seconds) -> bool:
    """Wait for a datagram, at most `seconds`."""
    import select  # noqa: PLC0415

    return bool(select.select([sock], [], [], seconds)[0])


@cache
def _recvmmsg() -> Any:
    function = cast("Any", ctypes.CDLL(None, use_errno=True)).recvmmsg
    function.argtypes = [ctypes.c_int, ctypes.c_void_p, ctypes.c_uint, ctypes.c_int, ctypes.c_void_p]
    function.restype = ctypes.c_int
    return function


def _addresses(rows: NDArray[Any]) -> NDArray[np.uint64]:
    return rows.ctypes.data + np.arange(len(rows), dtype=np.uint64) * np.uint64(rows.strides[0])
