"""UDP addresses: those at which datagrams are received, and those of devices and receivers."""

import queue
import re
import socket
import threading
from collections.abc import Generator
from contextlib import contextmanager

from monochord.core.errors import DeviceError, InputError
from monochord.core.units import Seconds

PATIENCE: Seconds = 5.0
"""How long the name of an own address may take to be found."""


@contextmanager
def listening(address: str) -> Generator[socket.socket]:
    """Open a UDP socket at ``HOST:PORT`` or ``PORT`` (of this machine alone).

    Raises `InputError` for what is no address, and `DeviceError` where it is taken or not this machine's.
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
    """Return whether a text is the number of a port, `lowest` to 65535."""
    return re.fullmatch("[0-9]{1,5}", text) is not None and lowest <= int(text) < 65536


def resolved(host: str, seconds: Seconds) -> str:
    """Return the IPv4 address of a host; raises `DeviceError` where none is found within so many seconds.

    Nothing interrupts the system's resolver: it works in a thread of its own, which is left alone when the
    time is over.
    """
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
