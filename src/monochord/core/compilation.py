"""What a person sees while kernels are compiled.

A kernel is compiled when it is first called after an installation or an update, and kept on disk. That takes
some tens of seconds; a terminal that stays blank meanwhile looks as if the program hangs.
"""

import sys
import time
from multiprocessing import parent_process
from typing import TextIO

from monochord.core.units import Seconds

USUAL_TIME: Seconds = 40.0
"""What all kernels of the twin and of the bundled model took together, on one core of a shared machine."""
BAR_WIDTH = 24
REDRAW_PERIOD: Seconds = 0.1


class Bar:
    """A bar that moves whenever a function is compiled: ``compiling, once, about 40 s [##......] 4 s``.

    It shows the time spent of the usual one, and is erased when a compilation ends. A log, a pipe or a file
    gets nothing, and a process that another one of Python's started draws none.

    Parameters
    ----------
    file
        Where to write; standard error by default.

    Examples
    --------
    >>> bar = Bar()
    >>> bar.start()
    >>> bar.stop()
    """

    def __init__(self, file: TextIO | None = None) -> None:
        self._file = file
        self._depth, self._since, self._before = 0, 0.0, 0.0
        self._drawn: Seconds | None = None

    def start(self) -> None:
        """Note that a compilation starts, perhaps within another."""
        self._depth += 1
        if self._depth == 1:
            self._since = time.monotonic()
        self._show()

    def stop(self) -> None:
        """Note that one has ended."""
        self._show()
        self._depth -= 1
        if self._depth == 0:
            self._before += time.monotonic() - self._since
            self._erase()

    def _erase(self) -> None:
        """Clear the bar: what comes next may draw on the same line."""
        screen = self._screen()
        if screen is not None and self._drawn is not None:
            screen.write("\r\x1b[K")
            screen.flush()

    def _show(self) -> None:
        now, screen = time.monotonic(), self._screen()
        if screen is not None and (self._drawn is None or now - self._drawn >= REDRAW_PERIOD):
            spent = self._before + now - self._since
            full = round(BAR_WIDTH * min(1.0, spent / USUAL_TIME))
            bar = "#" * full + "." * (BAR_WIDTH - full)
            screen.write(f"\rcompiling, once, about {USUAL_TIME:.0f} s [{bar}] {spent:.0f} s\x1b[K")
            screen.flush()
            self._drawn = now

    def _screen(self) -> TextIO | None:
        """Return the terminal to draw on, None where there is none."""
        file = sys.stderr if self._file is None else self._file
        is_terminal = file is not None and not file.closed and file.isatty()  # pyright: ignore[reportUnnecessaryComparison]
        return file if is_terminal and parent_process() is None else None
