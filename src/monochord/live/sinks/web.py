"""A browser page of the run, in which a simulated string can be touched."""

from collections.abc import Generator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from monochord.capture.recording.settings import of_sensor
from monochord.core.units import Metres
from monochord.live.sinks.base import Run, Sink, Update, Writer
from monochord.live.sinks.terminal import DEFAULT_LENGTH

if TYPE_CHECKING:
    from monochord.live.web.server import Server


@dataclass(frozen=True, slots=True, kw_only=True)
class Web(Sink):
    """Serve a page that shows the run in any number of browsers, without internet access.

    It shows the string with the touch, estimates with standard errors, both microphones' spectra, levels,
    history, latency and health notes. A simulated string can be touched by mouse or finger, and the truth
    stands beside the estimates. The page also starts a recording, and guides tuning, calibration and touches
    with labels. A page gets at most 30 updates a second, always the newest; a slow page gets fewer and delays
    no other.

    Parameters
    ----------
    at
        Port, or ``HOST:PORT``, of this machine: by default on 127.0.0.1, which other machines cannot reach.
        Port 0 selects the first free port from 8420 on.
    token
        Token required in the page's address; if empty, one is generated where other machines can reach the
        page.
    folder
        Folder for the page's recordings, tunings, calibrations and labelled touches; by default the current
        folder.
    length
        Length of the drawn string in metres; 0 for the signal's string, else 0.65 m.
    browser
        Whether to open the page in a browser, if there is a display.
    stderr
        Whether to print the address on standard error and leave standard output to data.
    string
        With several strings, the string a page shows at first; empty for the first string.
    allow_host
        Other host names of the page, such as a full DNS name, a proxy's or a container host's name: a list of
        NAME or NAME:PORT. A token is then required too.
    model
        The trained model that a calibration adapts; by default the running model, if any.
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
        """Serve the page and print its address; raises `DeviceError` where the address is taken."""
        with self.served(to_stderr=self.stderr) as server:
            yield _Page(options=self, server=server)

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:
        """Serve the page, print its address and show the run."""
        with _Page(options=self).open(run) as writer:
            yield writer

    @contextmanager
    def served(self, *, to_stderr: bool) -> Generator["Server"]:
        """Run the server and print its address."""
        from monochord.live.web.serving import served  # noqa: PLC0415  (loads a web server)

        with served(
            self.at,
            token=self.token,
            names=self.allow_host,
            browser=self.browser,
            to_stderr=to_stderr,
            first=self.string,
        ) as server:
            yield server


@dataclass(frozen=True, kw_only=True)
class _Page(Sink):
    """The page of a run, on a running server or a new one."""

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
                        described=of_sensor(sensor) if (sensor := run.sensors.get(name)) else {},
                    )
                )
                for name, own in (run.strings or {"": run.signal}).items()
            }
            yield _Views(views)


class _Views(Writer):
    """Passes each update to the views of its string."""

    def __init__(self, views: Mapping[str, Writer]) -> None:
        self._views = views

    def write(self, update: Update) -> None:
        self._views[update.string].write(update)
