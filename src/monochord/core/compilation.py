"""The progress bar shown while kernels are compiled.

A kernel is compiled when it is first called after an installation or an update, and cached on disk. That
takes some tens of seconds, during which a blank terminal would look like a hang.
"""

import sys
import threading
import time
from contextlib import suppress
from multiprocessing import parent_process
from typing import TextIO

from monochord.core.units import Seconds

USUAL_TIME: Seconds = 40.0
"""Compilation time of all kernels of the twin and the bundled model on one shared core, in s.
"""
BAR_WIDTH = 24
REDRAW_PERIOD: Seconds = 0.5


class CompilationBar:
    """A progress bar during compilation: ``compiling, once, about 40 s [##......] 4 s``.

    It shows the time spent out of the usual time, and is erased when a compilation ends. It is not drawn in a
    log, a pipe or a file, nor by a process started by another Python process. By default `file` is standard
    error.

    >>> bar = CompilationBar()
    >>> bar.start()
    >>> bar.stop()
    """

    def __init__(self, file: TextIO | None = None) -> None:
        self._file = file
        self._depth, self._since, self._before = 0, 0.0, 0.0
        self._ended = threading.Event()
        self._drawing: threading.Thread | None = None

    def start(self) -> None:
        """Record that a compilation starts, possibly nested in another."""
        self._depth += 1
        if self._depth == 1:
            self._since = time.monotonic()
            screen = sys.stderr if self._file is None else self._file
            if _is_terminal(screen):
                self._ended.clear()
                self._drawing = threading.Thread(target=self._draw, args=(screen,), daemon=True)
                self._drawing.start()

    def stop(self) -> None:
        """Record that a compilation has ended."""
        self._depth -= 1
        if self._depth == 0:
            self._before += time.monotonic() - self._since
            if self._drawing is not None:
                self._ended.set()
                self._drawing.join()
                self._drawing = None

    def _draw(self, screen: TextIO) -> None:
        """Draw until the compilation ends; later output may use the same line."""
        with suppress(OSError, ValueError):  # of a terminal that was closed
            while True:
                spent = self._before + time.monotonic() - self._since
                full = round(BAR_WIDTH * min(1.0, spent / USUAL_TIME))
                bar = "#" * full + "." * (BAR_WIDTH - full)
                screen.write(f"\rcompiling, once, about {USUAL_TIME:.0f} s [{bar}] {spent:.0f} s\x1b[K")
                screen.flush()
                if self._ended.wait(REDRAW_PERIOD):
                    break
            screen.write("\r\x1b[K")
            screen.flush()


def _is_terminal(file: TextIO | None) -> bool:
    """Return whether a file is a terminal visible to the user; a program may have closed or removed it."""
    if file is None or file.closed or not file.isatty() or parent_process() is not None:
        return False
    from monochord.core.screen import can_draw, console_of  # noqa: PLC0415

    return can_draw(console_of(file))
