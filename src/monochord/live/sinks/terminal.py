"""The live view in a terminal, or one plain line a second without one."""

import sys
import time
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from rich.console import Console
from rich.text import Text

from monochord.core.printable import printable
from monochord.core.screen import Screen, can_draw, console_of
from monochord.core.timing import Histogram
from monochord.core.types import Signal
from monochord.core.units import Metres, Seconds
from monochord.live.events import Event
from monochord.live.health import Note
from monochord.live.sinks import _notes, _view
from monochord.live.sinks.base import Run, Sink, Update, Writer

DEFAULT_LENGTH: Metres = 0.65  # to draw a string of unknown length
DRAW_EVERY: Seconds = 0.1
"""Shortest time between pictures, in s; it grows for slow drawing, which may take one eighth of the time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Terminal(Sink):
    """Draw the string with the touch, the estimates, levels, latency and the stream's health.

    Below are the last event and the health notes with remedies, worst first. A low terminal leaves out the
    least important parts; errors go last. With several strings, each has a line, plus one for its worst note.

    Without a terminal, a plain line is printed every second, with the events since the previous one, and a
    line at once where a note appears or clears.

    Parameters
    ----------
    length
        Length of the drawn string in metres, from nut to bridge; 0 for the signal's string, else 0.65 m.
    plain
        Whether to print one plain line a second, even in a terminal.
    stderr
        Whether to draw on standard error and leave standard output to data.
    """

    length: Metres = 0.0
    plain: bool = False
    stderr: bool = False

    def ends_with_standard_output(self, run: Run) -> bool:
        """Return whether it draws there."""
        return not (self.stderr or run.is_output_taken)

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:
        """Take over the terminal's lower part; the last picture stays."""
        console = console_of(sys.stdout if self.ends_with_standard_output(run) else sys.stderr)
        if self.plain or not can_draw(console):
            lines = _Lines(console)
            yield lines
            lines.close()
            return
        signal, given = run.signal, self.length or run.length
        length = given or (signal.string.length if signal.string else DEFAULT_LENGTH)
        # A length of one's own is that of a stopped string; a sensor's string ends at its pickups.
        stopped = given or signal.channels == 1
        ends = ("nut", "bridge") if stopped else ("pickup 1", "pickup 2")
        with Screen(console) as screen:
            picture = _Picture(console, screen, signal, length, ends)
            yield picture
            picture.close()


class _Picture(Writer):
    """Draws the newest update, at most every `DRAW_EVERY`, within its share of the time."""

    def __init__(
        self,
        console: Console,
        screen: Screen,
        signal: Signal,
        length: Metres,
        ends: tuple[str, str],
    ) -> None:
        self._console, self._screen = console, screen
        self._signal, self._length, self._ends = signal, length, ends
        self._latency = Histogram()
        self._next: Seconds = 0.0
        self._newest: dict[str, Update] = {}
        self._waiting: Update | None = None
        self._last: Event | None = None

    def write(self, update: Update) -> None:
        self._latency.add(update.prediction.latency)
        self._newest[update.string] = update
        if update.events:
            self._last = update.events[-1]
        begin = time.monotonic()
        if begin < self._next:
            self._waiting = update
            return
        self._draw(update)
        end = time.monotonic()
        self._next = begin + max(DRAW_EVERY, 8.0 * (end - begin))

    def close(self) -> None:
        """Draw the last update, if newer than the picture."""
        if self._waiting is not None:
            self._draw(self._waiting)

    def _draw(self, update: Update) -> None:
        self._waiting = None
        size = self._console.size
        latency = self._latency.percentiles()
        if update.string:
            self._screen.show(_view.several(self._newest.values(), latency, size.width, size.height))
            return
        columns = min(size.width, 110)
        self._screen.show(
            _view.frame(
                update, self._signal, self._length, latency, columns, size.height, self._ends, self._last
            )
        )


class _Lines(Writer):
    """Prints one line a second for each string, and a final one; notes as they appear and clear."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._latency = Histogram()
        self._next: dict[str, Seconds] = {}
        self._waiting: dict[str, Update] = {}
        self._events: dict[str, list[Event]] = {}
        self._notes: dict[str, Mapping[str, Note]] = {}

    def write(self, update: Update) -> None:
        self._latency.add(update.prediction.latency)
        now, name = time.monotonic(), update.string
        self._notes[name], news = _notes.news(self._notes.get(name, {}), update)
        for line in news:
            self._print(line)
        self._waiting[name] = update
        if update.events:
            self._events.setdefault(name, []).extend(update.events)
        if now >= self._next.get(name, 0.0):
            self._next[name] = now + 1.0
            self._print_update(self._waiting.pop(name))

    def close(self) -> None:
        """Print the newest update of each string, unless it was printed."""
        for update in self._waiting.values():
            self._print_update(update)

    def _print_update(self, update: Update) -> None:
        events = self._events.pop(update.string, [])
        self._print(_view.plain(update, self._latency.percentiles(), events))

    def _print(self, line: str) -> None:
        self._console.print(Text(printable(line)), soft_wrap=True)
        self._console.file.flush()
