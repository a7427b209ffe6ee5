"""A page in the browser, where a simulated string is touched, too."""

import os
import secrets
import sys
import webbrowser
from collections.abc import Generator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from monochord.capture.address import is_port, resolved
from monochord.capture.sources.base import Controls
from monochord.core.errors import InputError
from monochord.core.types import Signal
from monochord.core.units import Metres
from monochord.live.sinks.base import Moment, Sink, Writer
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
    and tuning and calibration are guided. A page sees 30 moments a second at most, the newest; a slow one
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

    def off_standard_output(self) -> "Web":
        """Print the address on standard error."""
        return replace(self, stderr=True)

    def for_length(self, length: Metres) -> "Web":
        """Draw a string of this length, unless the options name one."""
        return self if self.length else replace(self, length=length)

    def for_model(self, model: str) -> "Web":
        """Let the page calibrate the model."""
        return self if self.model else replace(self, model=model)

    def for_strings(self, strings: Mapping[str, Signal]) -> Sink:
        """Let the page choose among strings."""
        return _Page(options=self, strings=strings)

    def for_controls(self, controls: Controls) -> Sink:
        """Let the page touch the string."""
        return _Page(options=self, controls=controls)

    @contextmanager
    def ahead(self) -> Generator[Sink]:
        """Serve the page and print its address; raises `DeviceError` for an address that is taken."""
        with self.served() as server:
            yield _Page(options=self, server=server)

    @contextmanager
    def open(self, signal: Signal) -> Generator[Writer]:
        """Serve the page, print its address and show the run."""
        with _Page(options=self).open(signal) as writer:
            yield writer

    @contextmanager
    def served(self) -> Generator["Server"]:
        """Run the server, whose address is printed."""
        with self._server() as server:
            opened = self.browser and _has_display() and webbrowser.open(server.address)
            hint = "" if opened or not self.browser else "  (open it in a browser)"
            file = sys.stderr if self.stderr else sys.stdout
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
    controls: Controls | None = None
    strings: Mapping[str, Signal] | None = None

    def for_controls(self, controls: Controls) -> Sink:
        return replace(self, controls=controls)

    def for_strings(self, strings: Mapping[str, Signal]) -> Sink:
        return replace(self, strings=strings)

    @contextmanager
    def open(self, signal: Signal) -> Generator[Writer]:
        options = self.options
        with ExitStack() as stack:
            server = self.server or stack.enter_context(options.served())
            views = {
                name: stack.enter_context(
                    server.show(
                        own,
                        options.length or (own.string.length if own.string else DEFAULT_LENGTH),
                        self.controls,
                        string=name,
                        folder=Path(options.folder),
                        model=options.model,
                    )
                )
                for name, own in (self.strings or {"": signal}).items()
            }
            yield _Views(views)


class _Views(Writer):
    """Shows each moment where those of its string are shown."""

    def __init__(self, views: Mapping[str, Writer]) -> None:
        self._views = views

    def write(self, moment: Moment) -> None:
        self._views[moment.string].write(moment)


def _has_display() -> bool:
    """Return whether a browser that is opened here is seen by who sits at the terminal."""
    remote = any(name in os.environ for name in ("SSH_CONNECTION", "SSH_TTY"))
    return sys.stdout.isatty() and not remote and any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
