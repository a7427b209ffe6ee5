"""The view of a running recording, in a thread of its own: a stopped terminal stops no recording."""

import threading
import time
from collections import deque
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path

from rich.console import Console
from rich.text import Text

from monochord.capture.recording import _view
from monochord.capture.recording.progress import Progress
from monochord.capture.recording.watch import Notice
from monochord.core.printable import printable
from monochord.core.screen import Screen, can_draw
from monochord.core.units import Seconds

PICTURES: Seconds = 0.125
"""From one picture to the next, at least."""
LINES: Seconds = 5.0
"""From one line to the next where nothing can be drawn."""
NOTICES = 3
"""Of the newest that a picture shows."""
WIDEST = 110
PATIENCE: Seconds = 1.0
"""How long the end of a recording waits for a terminal that takes nothing."""


class View:
    """Takes how a recording stands, and draws the newest on `console` when it can."""

    def __init__(self, path: Path, console: Console) -> None:
        self._path, self._console = path, console
        self._newest: Progress | None = None
        self._noticed = deque[str](maxlen=NOTICES)
        self._unsaid = deque[str](maxlen=100)
        self._lock = threading.Lock()
        self._stopped = threading.Event()
        draw = self._draw if can_draw(console) else self._say
        self._thread = threading.Thread(target=draw, name="record view", daemon=True)

    def show(self, now: Progress, notices: Sequence[Notice]) -> None:
        """Take how the recording stands, and what was just noticed."""
        with self._lock:
            self._newest = now
            for notice in notices:
                self._noticed.append(f"{_view.duration(now.elapsed)}  {notice.text}")
                self._unsaid.append(f"{now.elapsed:8.1f} s  {notice.text}")

    def start(self) -> None:
        """Begin to draw."""
        self._thread.start()

    def stop(self) -> None:
        """Draw what is newest and end; a terminal that takes nothing is left behind."""
        self._stopped.set()
        self._thread.join(PATIENCE)

    def _draw(self) -> None:
        with Screen(self._console) as screen:
            last = False
            while not last:
                last = self._stopped.wait(PICTURES)
                with self._lock:
                    now, noticed = self._newest, list(self._noticed)
                if now:
                    columns = min(self._console.size.width, WIDEST)
                    screen.show(_view.frame(self._path, now, noticed, columns))

    def _say(self) -> None:
        last, due = False, 0.0
        while not last:
            last = self._stopped.wait(PICTURES)
            with self._lock:
                now, unsaid = self._newest, list(self._unsaid)
                self._unsaid.clear()
            moment = time.monotonic()
            if now and (last or moment >= due):
                due = moment + LINES
                unsaid.append(_view.plain(now))
            for line in unsaid:
                self._console.print(Text(printable(line)), soft_wrap=True)
            if unsaid:
                self._console.file.flush()


@contextmanager
def viewed(path: Path, console: Console) -> Generator[View]:
    """Draw the recording into `path` on a console until the context is left."""
    view = View(path, console)
    view.start()
    try:
        yield view
    finally:
        view.stop()
