"""The view of a running recording, in a separate thread: a blocked terminal does not stop the recording."""

import math
import threading
import time
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.text import Text

from monochord.capture.recording.counters import FeedState, Level, RecordingState
from monochord.core.printable import printable
from monochord.core.screen import Screen, can_draw
from monochord.core.units import Seconds, decibels
from monochord.sessions import Event

DRAW_INTERVAL: Seconds = 0.125
"""Shortest time between two drawings, in s."""
LINE_INTERVAL: Seconds = 5.0
"""Time between two lines of plain output, in s."""
MAX_NOTICES = 3
"""Number of the newest notices shown."""
MAX_WIDTH = 110
LABEL, DIM, WARN, GOOD = "grey62", "grey42", "bold orange1", "green"
METER_FLOOR = -60.0  # decibels at the left end of a level meter
EIGHTHS = " ▏▎▍▌▋▊▉"
SHOWN = ("fz", "x", "y", "z")  # columns of a reading that are shown; else its first three
LOW_RATE = 0.9  # share of the nominal rate below which the rate is marked
STOP_TIMEOUT: Seconds = 1.0
"""How long the end of a recording waits for a blocked terminal, in s."""


class RecordingView:
    """Receives the states of a recording, and draws the latest one on `console`."""

    def __init__(self, path: Path, console: Console) -> None:
        self._path, self._console = path, console
        self._latest: RecordingState | None = None
        self._notices = deque[str](maxlen=MAX_NOTICES)
        self._unprinted = deque[str](maxlen=100)
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        draw = self._draw if can_draw(console) else self._print
        self._thread = threading.Thread(target=draw, name="record view", daemon=True)

    def show(self, now: RecordingState, notices: Sequence[Event]) -> None:
        """Receive the state of the recording, and new notices."""
        with self._lock:
            self._latest = now
            for notice in notices:
                self._notices.append(f"{duration(now.elapsed)}  {notice.text}")
                self._unprinted.append(f"{now.elapsed:8.1f} s  {notice.text}")

    def start(self) -> None:
        """Start drawing."""
        self._thread.start()

    def stop(self) -> None:
        """Draw the latest state and end; a blocked terminal is abandoned."""
        self._stopped.set()
        self._thread.join(STOP_TIMEOUT)

    def _draw(self) -> None:
        with Screen(self._console) as screen:
            last = False
            while not last:
                last = self._stopped.wait(DRAW_INTERVAL)
                with self._lock:
                    now, notices = self._latest, list(self._notices)
                if now:
                    columns = min(self._console.size.width, MAX_WIDTH)
                    screen.show(draw(self._path, now, notices, columns))

    def _print(self) -> None:
        last, due = False, 0.0
        while not last:
            last = self._stopped.wait(DRAW_INTERVAL)
            with self._lock:
                now, lines = self._latest, list(self._unprinted)
                self._unprinted.clear()
            moment = time.monotonic()
            if now and (last or moment >= due):
                due = moment + LINE_INTERVAL
                lines.append(plain_line(now))
            for line in lines:
                self._console.print(Text(printable(line)), soft_wrap=True)
            if lines:
                self._console.file.flush()


@contextmanager
def viewed(path: Path, console: Console) -> Generator[RecordingView]:
    """Draw the recording into `path` on a console until the context is left."""
    view = RecordingView(path, console)
    view.start()
    try:
        yield view
    finally:
        view.stop()


def draw(path: Path, now: RecordingState, notices: Sequence[str], columns: int) -> list[Text]:
    """Return the view as lines of at most `columns` cells, with the newest notices at the bottom."""
    return [
        _title(path, now, columns),
        Text(),
        *(_meter(k + 1, level, columns) for k, level in enumerate(now.levels)),
        Text(),
        *(_feed(feed) for feed in now.feeds),
        _audio(now),
        _disk(now),
        *(Text(f"  ! {text}", WARN) for text in notices),
    ]


def plain_line(now: RecordingState) -> str:
    """Return the state as one line of text, for a log or a pipe."""
    peaks = " / ".join(f"{decibels(level.peak_hold):.0f}" for level in now.levels)
    clipped = sum(level.clipped for level in now.levels)
    feeds = "".join(
        f"; {feed.name} {feed.rate:.0f} a second, missing {feed.health.missing}"
        + (f", silent for {feed.silent:.1f} s" if feed.silent else "")
        for feed in now.feeds
    )
    silent = f", silent for {now.silent:.1f} s" if now.silent else ""
    quiet = ", ".join(f"{k + 1}" for k, level in enumerate(now.levels) if level.is_silent)
    silent += f", silence, microphone {quiet}" if quiet else ""
    return (
        f"{now.elapsed:8.1f} s  peak {peaks} dBFS, clipped {clipped}, gaps {now.gaps}, dropped {now.dropped}"
        f"{silent}{feeds}; {1e-6 * now.space.size:.1f} MB, space for {duration(now.space.left)}"
    )


def duration(seconds: Seconds) -> str:
    """Return a duration in a readable form.

    >>> duration(75.0), duration(5400.0), duration(math.inf)
    ('1:15', '1.5 h', '?')
    """
    if not math.isfinite(seconds):
        return "?"
    if seconds >= 3600.0:
        return f"{seconds / 3600.0:.{1 if seconds < 36000.0 else 0}f} h"
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


def _title(path: Path, now: RecordingState, columns: int) -> Text:
    left = Text.assemble(("  ● ", "bold red"), ("monochord", "bold"), (f"   {path.name}", LABEL))
    right = f"{duration(now.elapsed)}   {1e-6 * now.space.size:.1f} MB  "
    return left + Text(right.rjust(max(columns - len(left), len(right) + 1)), LABEL)


def _meter(number: int, level: Level, columns: int) -> Text:
    width = max(columns - 34, 10)
    filled, peak = _place(level.rms) * width, min(int(_place(level.peak_hold) * width), width - 1)
    bar = ("█" * int(filled) + EIGHTHS[int(filled % 1.0 * 8.0)])[:width].ljust(width)
    line = Text(f"  mic {number}  ", LABEL)
    for k, cell in enumerate(bar):
        if k == peak and level.peak_hold > 0.0:
            line.append("▏", WARN if level.clipping else "bold white")
        else:
            line.append(cell if cell != " " else "·", GOOD if cell != " " else DIM)
    if level.is_silent or level.rms == 0.0:
        line.append("  silence   ", WARN if level.is_silent else LABEL)
    else:
        line.append(f" {decibels(level.rms):6.1f} dBFS", LABEL)
    if level.clipping:
        return line.append("  CLIP", WARN)
    if level.not_numbers:
        return line.append("  not numbers", WARN)
    return line.append(f"  clipped {level.clipped}", LABEL) if level.clipped else line


def _place(share: float) -> float:
    """Return a level's place between the floor and full scale, 0 to 1."""
    return min(max(1.0 - decibels(share) / METER_FLOOR, 0.0), 1.0) if share > 0.0 else 0.0


def _feed(feed: FeedState) -> Text:
    line = Text.assemble((f"  {feed.name:<9}", LABEL))
    for text in _values(feed):
        line.append(f"{text}   ", "bold")
    if feed.silent:
        return line.append(f"silent for {feed.silent:.1f} s", WARN)
    nominal, style = feed.feed.rate, WARN if feed.rate < LOW_RATE * feed.feed.rate else ""
    line.append(f"{feed.rate:.0f}{f' of {nominal:.0f}' if nominal else ''} a second   ", style)
    for name, count in (("missing", feed.health.missing), ("faulty", feed.faulty)):
        line.append(f"{name} {count}   ", WARN if count else "")
    return line


def _values(feed: FeedState) -> Iterator[str]:
    units = dict(zip(feed.feed.columns, feed.feed.units, strict=True))
    names = [name for name in SHOWN if name in feed.values] or list(feed.values)[:3]
    for name in names:
        value, unit = feed.values[name], units[name]
        yield f"{name} {1e3 * value:.1f} mm" if unit == "m" else f"{name} {value:.2f} {unit}".rstrip()


def _audio(now: RecordingState) -> Text:
    line = Text.assemble(("  audio    ", LABEL))
    if now.silent:
        line.append(f"silent for {now.silent:.1f} s   ", WARN)
    counts = {
        "gaps": now.gaps,
        "dropped": now.dropped,
        "xruns": now.health.xruns,
        "reconnects": now.health.reconnects,
    }
    for name, count in counts.items():
        line.append(f"{name} {count}   ", WARN if count else "")
    return line


def _disk(now: RecordingState) -> Text:
    style = WARN if now.space.left < 600.0 else ""
    line = Text.assemble(("  disk     ", LABEL))
    line.append(f"{1e-9 * now.space.free:.1f} GB free, space for {duration(now.space.left)}   ", style)
    return line.append(f"waiting {100 * now.waiting:.0f} %", WARN) if now.waiting > 0.1 else line
