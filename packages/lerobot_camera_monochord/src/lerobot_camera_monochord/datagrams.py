"""Receives the datagrams of ``monochord live --sink udp`` in a thread, and keeps the latest picture."""

import json
import socket
import threading
import time
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from lerobot_camera_monochord.touches import Picture

PATIENCE = 1.0
"""Longest time without a datagram before it is an error, in s: a hundred windows."""
POLL = 0.1
"""How often the thread looks whether it is to end, in s."""
MAX_BYTES = 65536


class Receiver:
    """The latest picture and vector of a UDP port.

    Raises `ConnectionError` where the port cannot be opened.

    Examples
    --------
    >>> picture = Picture(16, 16, length=0.2, force=2.0)
    >>> with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
    ...     receiver = Receiver(picture, "127.0.0.1", 0)
    ...     _ = sender.sendto(b'{"sequence": 0, "contact": 0.1}', ("127.0.0.1", receiver.port))
    ...     image, vector = receiver.next(1.0)
    ...     receiver.close()
    >>> image.shape, len(vector)
    ((16, 16, 3), 8)
    """

    def __init__(self, picture: Picture, host: str, port: int) -> None:
        self._picture, self._host = picture, host
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind((host, port))
        except (OSError, OverflowError) as error:
            self._socket.close()
            remedy = "close what has it, or set another one here and in --sink udp="
            raise ConnectionError(
                f"UDP port {port} of {host} cannot be opened ({error}): {remedy}"
            ) from error
        self._socket.settimeout(POLL)
        self.port: int = self._socket.getsockname()[1]
        self._changed = threading.Condition()
        self._count = self._seen = 0
        self._latest = self._began = time.monotonic()
        self._fault = ""
        self._closed = False
        self._thread = threading.Thread(target=self._run, name=f"monochord {self.port}", daemon=True)
        self._thread.start()

    def next(self, timeout: float = PATIENCE) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return the latest picture and vector that were not returned yet, waiting up to `timeout` s.

        Raises `TimeoutError`, with the command that starts the datagrams, where none comes in that time.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._count > self._seen or self._fault, timeout)
            return self._current(self._count > self._seen)

    def latest(self, max_age: float = PATIENCE) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Return the latest picture and vector at once.

        Raises `TimeoutError`, as `next` does, where they are older than `max_age` s.
        """
        with self._changed:
            return self._current(self._count > 0 and time.monotonic() - self._latest <= max_age)

    def close(self) -> None:
        """End the thread and release the port."""
        self._closed = True
        self._thread.join()
        self._socket.close()

    def _current(self, is_new: bool) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:  # noqa: FBT001
        if self._fault:
            raise ValueError(self._fault)
        if not is_new:
            where = f"{self._host}:{self.port}"
            waited = time.monotonic() - (self._latest if self._count else self._began)
            raise TimeoutError(
                f"no datagram on {where} for {waited:.1f} s; start them: "
                f"monochord live demo --source jack --sink udp={where}"
            )
        self._seen = self._count
        return self._picture.image, self._picture.vector

    def _run(self) -> None:
        while not self._closed:
            try:
                datagram: Any = json.loads(self._socket.recv(MAX_BYTES))
            except TimeoutError:
                continue
            except (ValueError, RecursionError):  # of another program, as the next are
                continue
            if not isinstance(datagram, dict) or "sequence" not in datagram:
                continue
            with self._changed:
                try:
                    self._picture.add(cast("dict[str, Any]", datagram))
                except ValueError as error:
                    self._fault = str(error)
                self._count, self._latest = self._count + 1, time.monotonic()
                self._changed.notify_all()
