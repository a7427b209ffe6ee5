"""A browser page of the run, in which a simulated string can be touched."""

from collections.abc import Generator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from monochord.capture.recording.settings import of_sensor
from monochord.core.types import Signal
from monochord.core.units import Metres
from monochord.live.sinks.base import PageSink, Run, Sink, Update, Writer
from monochord.live.sinks.terminal import DEFAULT_LENGTH
from monochord.live.web.tasks import MakeTasks

if TYPE_CHECKING:
    from monochord.live.web.run_page import RunPage, View
    from monochord.page.server import Page, Server


@dataclass(frozen=True, slots=True, kw_only=True)
class Web(PageSink):
    """Serve a page that shows the run in any number of browsers, without internet access.

    It shows the string with the touch, estimates with standard errors, both microphones' spectra, levels,
    history, latency and health notes. A simulated string can be touched by mouse or finger, and the truth
    stands beside the estimates. In a run of ``monochord live``, the page also starts a recording, and guides
    tuning, calibration and touches with labels. A page gets at most 30 updates a second, always the newest; a
    slow page gets fewer and delays no other.

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
        with _Page(options=self).ahead() as page:
            yield page

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:
        """Serve the page, print its address and show the run."""
        with _Page(options=self).open(run) as writer:
            yield writer

    def with_tasks(self, tasks: MakeTasks, *, pages: "Sequence[Page]" = ()) -> Sink:
        """Return this sink with what its page can ask for, and with further pages of its server."""
        return _Page(options=self, tasks=tasks, pages=tuple(pages))


@dataclass(frozen=True, kw_only=True)
class _Page(Sink):
    """The page of a run, served already or once the run opens it."""

    options: Web
    tasks: MakeTasks | None = None
    pages: "tuple[Page, ...]" = ()
    shown: "RunPage | None" = None
    server: "Server | None" = None

    @contextmanager
    def ahead(self) -> Generator[Sink]:
        with self._served(to_stderr=self.options.stderr) as (server, shown):
            yield replace(self, server=server, shown=shown)

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:
        with ExitStack() as stack:
            shown = self.shown
            if shown is None:
                to_stderr = self.options.stderr or run.is_output_taken
                _, shown = stack.enter_context(self._served(to_stderr=to_stderr))
            views = {
                name: stack.enter_context(self._shown(shown, run, name, signal))
                for name, signal in (run.strings or {"": run.signal}).items()
            }
            yield _Views(views)

    @contextmanager
    def _served(self, *, to_stderr: bool) -> Generator["tuple[Server, RunPage]"]:
        """Serve the page and print its address."""
        from monochord.live.web.run_page import RunPage  # noqa: PLC0415  (loads a web server)
        from monochord.page.serving import served  # noqa: PLC0415  (likewise)

        options = self.options
        shown = RunPage(options.string)
        with served(
            (shown.page, *self.pages),
            options.at,
            token=options.token,
            names=options.allow_host,
            browser=options.browser,
            to_stderr=to_stderr,
        ) as server:
            yield server, shown

    def _shown(self, shown: "RunPage", run: Run, name: str, signal: Signal) -> "AbstractContextManager[View]":
        """Show one string of a run."""
        options = self.options
        known = signal.string.length if signal.string else DEFAULT_LENGTH
        length = options.length or run.length or known
        tasks = None
        if self.tasks is not None:
            described = of_sensor(sensor) if (sensor := run.sensors.get(name)) else {}
            folder, model = Path(options.folder), options.model or run.model
            tasks = self.tasks(signal, length, folder, model, described)
        return shown.show(signal, length, run.controls, string=name, tasks=tasks)


class _Views(Writer):
    """Passes each update to the view of its string."""

    def __init__(self, views: "Mapping[str, View]") -> None:
        self._views = views

    def write(self, update: Update) -> None:
        self._views[update.string].write(update)
