"""Runs the page's server at an address as users write it, prints its link, and opens a browser."""

import os
import secrets
import sys
import threading
import webbrowser
from collections.abc import Generator, Sequence
from contextlib import contextmanager

from monochord.capture.address import is_port, resolved
from monochord.core.errors import InputError
from monochord.core.interruption import interruption
from monochord.page.guard import is_loopback
from monochord.page.server import Page, Server

RESOLVING = 5.0
"""Timeout for resolving a local address, in s."""


@contextmanager
def served(
    pages: Sequence[Page],
    at: str,
    *,
    token: str = "",  # nosec B107
    names: Sequence[str] = (),
    browser: bool = False,
    to_stderr: bool = False,
) -> Generator[Server]:
    """Run a server and print its address; other machines, and other names, need a token.

    `at` is a port, or ``HOST:PORT``, of this machine; port 0 is the first free one from 8420 on. An empty
    token is generated where other machines can reach the page. `names` are further host names of the page. It
    is opened in a browser where there is a display. Raises `InputError` for an invalid address or name,
    `DeviceError` for an address that is taken.
    """
    host, _, port = at.rpartition(":")
    if not is_port(port, lowest=0):
        raise InputError(f"address '{at}'", "HOST:PORT, or PORT of this machine")
    host = host.strip("[]") or "127.0.0.1"
    address = host if ":" in host else resolved(host, RESOLVING)
    is_alone = is_loopback(address) and not names
    token = token or ("" if is_alone else secrets.token_urlsafe(16))
    with Server(pages, address, int(port), token, names=names) as server:
        opened = browser and _has_display() and webbrowser.open(server.address)
        hint = "" if opened or not browser else "  (open it in a browser)"
        file = sys.stderr if to_stderr else sys.stdout
        file.write(f"page: {server.address}{hint}\n")
        file.flush()
        yield server


def until_interrupted() -> None:
    """Wait for Control-C, or a signal to end."""
    ended = threading.Event()
    with interruption() as stop, stop.ending(ended.set):
        ended.wait()


def _has_display() -> bool:
    """Return whether a browser opened here is visible to the user at the terminal."""
    remote = any(name in os.environ for name in ("SSH_CONNECTION", "SSH_TTY"))
    return sys.stdout.isatty() and not remote and any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
