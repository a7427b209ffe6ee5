"""The page of a run: each browser shows one string, its newest estimates, and may touch a simulated one.

A run's sink only stores the newest update. In the server's thread, the newest update of each string that
somebody looks at is encoded once for all.
"""

import time
from bisect import bisect_right
from collections import deque
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from typing import Any

from monochord.capture.sources.base import Controls
from monochord.core.timing import Histogram
from monochord.core.types import Contact, Signal
from monochord.core.units import Metres, Seconds
from monochord.live.update import Update
from monochord.live.web import messages
from monochord.live.web.messages import Change, Release, Show, Touch
from monochord.live.web.tasks import Tasks
from monochord.page.clients import RATE, Clients, Feed, Viewer
from monochord.page.commands import Commands, Handlers
from monochord.page.messages import packed
from monochord.page.server import Page, static

SPECTRUM_RATE = 15.0
HISTORY: Seconds = 30.0
"""Length of history sent to a newly opened page, in s."""
HOLD: Seconds = 1.5
"""How long a touch lasts without a message from the page that holds it, in s."""
EDGES: tuple[Seconds, ...] = tuple(1e-4 * 10.0 ** (k / 8) for k in range(25))
"""Bin edges of the latency histogram: eight per decade, 0.1 to 100 ms."""
EVENTS = 8
"""Number of newest events in a message."""
FILES = (
    "page.js", "state.js", "string.js", "spectrum.js", "history.js", "numbers.js", "touch.js", "tasks.js",
    "label.js", "strings.js", "sections.js",
)  # fmt: skip
"""Files of the page beside those that all pages share."""


class RunPage(Feed):
    """The page of a run with one or several strings, each of which is a `View`.

    With several strings, a page shows the string `first` at first; empty for the first one.
    """

    def __init__(self, first: str = "") -> None:
        self._first = first
        self._views: dict[str, View] = {}
        self.browsers: set[_Browser] = set()
        package = "monochord.live.web"
        html = static(package, "index.html")["index.html"]
        self.page = Page(path="", title="Live", html=html, files=static(package, *FILES), feed=self)

    @contextmanager
    def show(
        self,
        signal: Signal,
        length: Metres,
        controls: Controls | None,
        *,
        string: str = "",
        tasks: Tasks | None = None,
    ) -> Generator["View"]:
        """Show a run, or one of its strings by name: the view takes its updates.

        `tasks` are what the page can ask for beside touches, and are closed at the end.
        """
        self._views[string] = view = View(signal, length, controls, tasks)
        try:
            yield view
        finally:
            if tasks is not None:
                tasks.close()

    def view(self, string: str) -> "View | None":
        """Return a string's latest view: the first string's for an unknown name, None before any data."""
        views = self._views
        return views.get(string) or views.get(self._first) or next(iter(tuple(views.values())), None)

    def has(self, string: str) -> bool:
        """Return whether there is a string of this name."""
        return string in self._views

    def refresh(self, clients: Clients) -> bool:
        """Encode the newest update of each string that somebody looks at."""
        views = tuple(self._views.values())
        fresh = [view for view in views if view.remember()]
        if not (fresh and clients):
            return False
        extra: dict[str, Any] = {"server": {"clients": len(clients), "ignored": clients.ignored}}
        if len(views) > 1:
            extra["strings"] = [messages.string_summary(view.newest) for view in views if view.newest]
        watched = {self.view(browser.string) for browser in self.browsers}
        for view in fresh:
            if view in watched:
                view.encode(extra)
        return True

    def enter(self) -> Viewer:
        """Return a browser that looks at the first string."""
        browser = _Browser(self)
        self.browsers.add(browser)
        return browser


class _Browser(Viewer):
    """An open page of a run."""

    def __init__(self, page: RunPage) -> None:
        self._page = page
        self.string = ""
        self._asked: View | None = None
        self._commands = Commands({Show: self._show})
        self._is_new = True
        self._view: View | None = None
        self._number = self._spectrum_number = 0
        self._holds = False
        self._last_received: Seconds = 0.0

    def news(self) -> Iterator[str | bytes]:
        """Yield what a new view is about, the newest update, and at times the spectrum."""
        if self._is_new:
            self._is_new = False
            yield messages.waiting()
        if self._holds and time.monotonic() > self._last_received + HOLD:
            self._let_go()
        view = self._page.view(self.string)
        if view is None:
            return
        if view is not self._view:
            self._view, self._number, self._spectrum_number = view, view.number, view.spectrum_number
            yield packed(view.hello())
        if view.number != self._number:
            self._number = view.number
            yield view.text
        if view.spectrum_number != self._spectrum_number:
            self._spectrum_number = view.spectrum_number
            yield view.spectrum

    def ask(self, content: str | bytes) -> None:
        """Carry out a request: a touch lasts until the page lets go, falls silent or leaves."""
        self._last_received = time.monotonic()
        view = self._page.view(self.string)
        if view is not self._asked:
            self._asked, handlers = view, {} if view is None else view.handlers
            self._commands = Commands({Show: self._show, **handlers})
        request = self._commands.read(content)
        self._commands.carry_out(request)
        self._holds = isinstance(request, Touch) or (self._holds and not isinstance(request, Release))

    def leave(self) -> None:
        """Release what this page holds."""
        self._page.browsers.discard(self)
        self._let_go()

    def _show(self, request: Show) -> bool:
        """Show another string from now on; return whether a string of that name exists."""
        if not self._page.has(request.string):
            return False
        self._let_go()
        self.string = request.string
        return True

    def _let_go(self) -> None:
        """Release the object that this page holds."""
        view = self._page.view(self.string)
        if self._holds and view is not None and view.controls is not None:
            view.controls.release()
        self._holds = False


class View:
    """A run as shown on the page: `write` runs in a sink's thread, all else in the server's."""

    def __init__(
        self, signal: Signal, length: Metres, controls: Controls | None, tasks: Tasks | None
    ) -> None:
        self._signal, self._length, self.controls, self.tasks = signal, length, controls, tasks
        self.newest: Update | None = None
        self.text, self.number = "", 0
        self.spectrum, self.spectrum_number = b"", 0
        self._remembered: Update | None = None
        self._spectrum_due: Seconds = 0.0
        self._latency = Histogram()
        self._counts = [0] * (len(EDGES) + 1)
        self._history: deque[list[float | None]] = deque(maxlen=round(HISTORY * RATE))
        self._events: deque[dict[str, Any]] = deque(maxlen=EVENTS)
        self._event = 0
        self._timing: dict[str, Any] | None = None
        self._timing_due: Seconds = 0.0
        self._simulated = controls is not None
        self.handlers = {**_handlers(controls), **({} if tasks is None else tasks.commands)}

    def write(self, update: Update) -> None:
        """Take the newest update."""
        latency = update.prediction.latency
        self._latency.add(latency)
        self._counts[bisect_right(EDGES, latency)] += 1
        self._simulated = self._simulated or bool(update.truth)
        for event in update.events:
            self._event += 1
            self._events.append(messages.event(event, self._event))
        self.newest = update
        if self.tasks is not None:
            self.tasks.take(update)

    def remember(self) -> bool:
        """Add the newest update to the history; return whether there was a new one."""
        update = self.newest
        if update is None or update is self._remembered:
            return False
        self._remembered = update
        self._history.append(messages.row(update))
        return True

    def encode(self, extra: dict[str, Any]) -> None:
        """Encode the newest update with its accompanying data, and at times its spectrum."""
        update, now = self.newest, time.monotonic()
        if update is None:
            return
        self.text = packed(self._state(update, now) | extra)
        self.number += 1
        if now >= self._spectrum_due:
            self._spectrum_due = now + 0.9 / SPECTRUM_RATE
            self.spectrum = messages.spectrum(update.window.samples, update.window.sample_rate)
            self.spectrum_number += 1

    def hello(self) -> dict[str, Any]:
        """Return the data that a newly opened page needs."""
        about = messages.hello(self._signal, self._length, self._simulated, self.controls)
        return about | {"history": list(self._history), "events": list(self._events)}

    def _state(self, update: Update, now: Seconds) -> dict[str, Any]:
        """Return the new state, with timing twice a second."""
        state = messages.state(update) | {"events": list(self._events), "simulated": self._simulated}
        if self.tasks is not None:
            state["tasks"] = self.tasks.state()
        if self.controls is not None:
            state["settings"] = messages.settings(self.controls)
        if now >= self._timing_due:
            self._timing_due = now + 0.5
            state["timing"] = messages.timing(self._latency.percentiles(), list(self._counts), EDGES)
        return state


def _handlers(controls: Controls | None) -> Handlers:
    """Return what a page can ask of a source: nothing without controls."""
    if controls is None:
        return {}

    def touch(request: Touch) -> bool:
        contact = Contact(position=request.position, force=request.force, slip_velocity=request.across)
        controls.touch(contact)
        return True

    def release(_: Release) -> bool:
        controls.release()
        return True

    def change(request: Change) -> bool:
        controls.change(request.name, request.value)
        return True

    return {Touch: touch, Release: release, Change: change}
