"""A page in the browser, where a simulated string is touched, too."""

import os
import secrets
import sys
import webbrowser
from collections.abc import Generator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from monochord.capture.address import is_port, resolved
from monochord.core.errors import InputError
from monochord.core.units import Metres
from monochord.live.sinks.base import Run, Sink, Update, Writer
from monochord.live.sinks.terminal import DEFAULT_LENGTH
from monochord.live.web.access import is_loopback

if TYPE_CHECKING:
    from monochord.live.web.server import Server

RESOLVING = 5.0
"""Seconds that the name of an own address may take to be found."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Web(Sink):
    """Serve a page that shows the run in any number of browsers, without anything from the internet.

    It shows the string with the touch on it, estimates with their standard errors, the spectra of both
    microphones, levels, history, latency and notes on the sensor's health. A simulated string is touched
    there with mouse or finger, and the truth stands beside the estimates. A session is recorded from there,
    and tuning and calibration are guided. A page sees 30 updates a second at most, the newest; a slow one
    sees fewer and delays nobody.

    Parameters
    ----------
    at
        Port, or ``HOST:PORT``, of this machine: 127.0.0.1 by default, which no other machine reaches. Port 0
        is the first free one from 8420 on.
    token
        What an address must carry to be let in; empty, one is made where other machines reach the page.
    folder
        Where recordings, tunings and calibrations of the page go; this folder by default.
    length
        Length of the drawn string in metres; 0 takes the signal's string, or 0.65 m.
    browser
        Whether to open the page in a browser, where there is a display.
    stderr
        Whether to print the address on standard error, which leaves standard output to data.
    string
        Of several strings, the one that a page shows until another is chosen there; empty for the first.
    allow_host
        Other names by which browsers call the page, such as a full DNS name, or that of a proxy or of a
        container's host: a list, each NAME or NAME:PORT. An address must carry a token then, too.
    model
        The trained model that a calibration adapts: by default the one that answers, if any does.
    """

    at: str = "127.0.0.1:0"
    token: str = ""
    folder: str = ""
    length: Metres = 0.0
    browser: bool = False
    stderr: bool = False
    string: str = ""
    allow_host: tuple[str, ...] = ()
    model: str = ""

    @contextmanager
    def ahead(self) -> Generator[Sink]:
        """Serve the page and print its address; raises `DeviceError` for an address that is taken."""
        with self.served(to_stderr=self.stderr) as server:
            yield _Page(options=self, server=server)

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:
        """Serve the page, print its address and show the run."""
        with _Page(options=self).open(run) as writer:
            yield writer

    @contextmanager
    def served(self, *, to_stderr: bool) -> Generator["Server"]:
        """Run the server, whose address is printed."""
        with self._server() as server:
            opened = self.browser and _has_display() and webbrowser.open(server.address)
            hint = "" if opened or not self.browser else "  (open it in a browser)"
            file = sys.stderr if to_stderr else sys.stdout
            file.write(f"page: {server.address}{hint}\n")
            file.flush()
            yield server

    def _server(self) -> "Server":
        from monochord.live.web.server import Server  # noqa: PLC0415  (loads a web server)

        host, _, port = self.at.rpartition(":")
        if not is_port(port, lowest=0):
            raise InputError(f"address '{self.at}'", "HOST:PORT, or PORT of this machine")
        host = host.strip("[]") or "127.0.0.1"
        address = host if ":" in host else resolved(host, RESOLVING)
        is_alone = is_loopback(address) and not self.allow_host
        token = self.token or ("" if is_alone else secrets.token_urlsafe(16))
        return Server(address, int(port), token, first=self.string, names=self.allow_host)


@dataclass(frozen=True, kw_only=True)
class _Page(Sink):
    """The page of a run, on a server that runs already or on one of its own."""

    options: Web
    server: "Server | None" = None

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:
        options = self.options
        length = options.length or run.length
        with ExitStack() as stack:
            served = options.served(to_stderr=options.stderr or run.is_output_taken)
            server = self.server or stack.enter_context(served)
            views = {
                name: stack.enter_context(
                    server.show(
                        own,
                        length or (own.string.length if own.string else DEFAULT_LENGTH),
                        run.controls,
                        string=name,
                        folder=Path(options.folder),
                        model=options.model or run.model,
                    )
                )
                for name, own in (run.strings or {"": run.signal}).items()
            }
            yield _Views(views)


class _Views(Writer):
    """Shows each update where those of its string are shown."""

    def __init__(self, views: Mapping[str, Writer]) -> None:
        self._views = views

    def write(self, update: Update) -> None:
        self._views[update.string].write(update)


def _has_display() -> bool:
    """Return whether a browser that is opened here is seen by who sits at the terminal."""
    remote = any(name in os.environ for name in ("SSH_CONNECTION", "SSH_TTY"))
    return sys.stdout.isatty() and not remote and any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
