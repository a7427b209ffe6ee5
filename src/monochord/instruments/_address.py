"""Addresses at which an instrument listens for datagrams."""

import socket
from collections.abc import Generator
from contextlib import contextmanager

from monochord.errors import DeviceError, InputError


@contextmanager
def listening(address: str) -> Generator[socket.socket]:
    """Open a UDP socket at ``HOST:PORT`` or ``PORT`` (of this machine alone).

    Raises `InputError` for what is no address, and `DeviceError` where it is taken or not this machine's.
    """
    host, _, port = address.rpartition(":")
    if not port.isdecimal() or not int(port) < 65536:
        raise InputError(f"address '{address}'", "HOST:PORT, or PORT of this machine")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        try:
            sock.bind((host or "127.0.0.1", int(port)))
        except OSError as error:
            raise DeviceError(f"UDP {address}: {error.strerror or error}") from error
        yield sock
