"""What a person sees while numba compiles.

A kernel is compiled when it is first called after an installation or an update, and kept on disk. That takes
some tens of seconds; a terminal that stays blank meanwhile looks as if the program hangs.
"""

import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any, TextIO

from monochord.core.units import Seconds

USUAL_TIME: Seconds = 40.0
"""What all kernels of the twin and of the bundled model took together, on one core of a shared machine."""
BAR_WIDTH = 24
REDRAW_PERIOD: Seconds = 0.1


@contextmanager
def compilation_shown(file: TextIO | None = None) -> Generator[None]:
    """Show a person on a terminal that kernels are compiled, if any are: ``compiling, once, about 40 s``.

    Behind the words a bar moves whenever a function of a kernel is compiled, and shows the time spent of the
    usual one; at the end the line is erased. A log, a pipe or a file gets nothing.

    Parameters
    ----------
    file
        Where to write; standard error by default.

    Examples
    --------
    >>> with compilation_shown():
    ...     pass
    """
    from numba.core import event  # noqa: PLC0415  (loads a compiler)

    screen = sys.stderr if file is None else file
    if not screen.isatty():
        yield
        return
    line = _Line(screen)

    class Listener(event.Listener):
        """Passes numba's starts and ends on to the line."""

        def on_start(self, event: Any) -> None:  # noqa: ARG002
            """Note that a compilation starts, perhaps within another."""
            line.start()

        def on_end(self, event: Any) -> None:  # noqa: ARG002
            """Note that one has ended."""
            line.stop()

    # numba compiles in one thread at a time, so that starts and ends nest.
    with event.install_listener("numba:compile", Listener()):
        try:
            yield
        finally:
            line.erase()


class _Line:
    def __init__(self, file: TextIO) -> None:
        self._file = file
        self._depth, self._since, self._before = 0, 0.0, 0.0
        self._drawn: Seconds | None = None

    def start(self) -> None:
        self._depth += 1
        if self._depth == 1:
            self._since = time.monotonic()
        self._show()

    def stop(self) -> None:
        self._show()
        self._depth -= 1
        if self._depth == 0:
            self._before += time.monotonic() - self._since
            self.erase()

    def erase(self) -> None:
        """Clear the bar: what comes next may draw on the same line."""
        if self._drawn is not None:
            self._file.write("\r\x1b[K")
            self._file.flush()

    def _show(self) -> None:
        now = time.monotonic()
        if self._drawn is None or now - self._drawn >= REDRAW_PERIOD:
            spent = self._before + now - self._since
            full = round(BAR_WIDTH * min(1.0, spent / USUAL_TIME))
            bar = "#" * full + "." * (BAR_WIDTH - full)
            self._file.write(f"\rcompiling, once, about {USUAL_TIME:.0f} s [{bar}] {spent:.0f} s\x1b[K")
            self._file.flush()
            self._drawn = now
