"""UDP addresses, local (to bind) and remote."""

import queue
import re
import socket
import threading
from collections.abc import Generator
from contextlib import contextmanager

from monochord.core.errors import DeviceError, InputError
from monochord.core.units import Seconds

PATIENCE: Seconds = 5.0
"""Timeout for resolving a local address, in s."""


@contextmanager
def listening(address: str) -> Generator[socket.socket]:
    """Open a UDP socket at ``HOST:PORT`` or ``PORT`` (of this machine alone).

    Raises `InputError` for an invalid address, and `DeviceError` where the port is taken or the address
    belongs to another machine.
    """
    host, _, port = address.rpartition(":")
    if not is_port(port, lowest=0):
        raise InputError(f"address '{address}'", "HOST:PORT, or PORT of this machine")
    place = resolved(host or "127.0.0.1", PATIENCE)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        try:
            sock.bind((place, int(port)))
        except OSError as error:
            raise DeviceError(f"UDP {address}: {error.strerror or error}") from error
        yield sock


def is_port(text: str, *, lowest: int = 1) -> bool:
    """Return whether a text is a port number from `lowest` to 65535."""
    return re.fullmatch("[0-9]{1,5}", text) is not None and lowest <= int(text) < 65536


def resolved(host: str, seconds: Seconds) -> str:
    """Return a host's IPv4 address; raises `DeviceError` where it is not resolved within `seconds`.

    `InputError` refuses an IPv6 address.

    The system's resolver cannot be interrupted: it runs in a separate thread, which is abandoned at the
    timeout.
    """
    if ":" in host:
        raise InputError(f"host '{host}'", "an IPv4 address, or a name that has one")
    answers: queue.SimpleQueue[str | Exception] = queue.SimpleQueue()

    def resolve(flags: int) -> None:
        try:
            answers.put(str(socket.getaddrinfo(host, None, socket.AF_INET, flags=flags)[0][4][0]))
        except (OSError, ValueError) as error:  # ValueError for what cannot be a name
            answers.put(error)

    resolve(socket.AI_NUMERICHOST)  # asks nobody
    answer = answers.get()
    if isinstance(answer, OSError):
        threading.Thread(target=resolve, args=(0,), name="resolve", daemon=True).start()
        try:
            answer = answers.get(timeout=seconds)
        except queue.Empty:
            answer = OSError(None, f"no answer within {seconds:g} s")
    if isinstance(answer, Exception):
        reason = getattr(answer, "strerror", None) or "not a name"
        raise DeviceError(f"host '{host}': {reason}; is the name right, and the network up?") from answer
    return answer
