"""Progress bars for long work, on a terminal and in a notebook only."""

import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from html import escape as escaped
from importlib import import_module

from monochord.core.printable import printable
from monochord.core.types import Progress
from monochord.core.units import Seconds

REFRESH: Seconds = 0.1
"""Shortest time between two states of a bar in a notebook."""


def shows_progress() -> bool:
    """Return whether a bar can be shown: standard error on a terminal, or a notebook."""
    from monochord.core.screen import can_draw, console_of  # noqa: PLC0415

    return in_notebook() or (sys.stderr.isatty() and can_draw(console_of(sys.stderr)))


def in_notebook() -> bool:
    """Return whether the program runs in the kernel of a notebook; to have imported one is not enough."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    return hasattr(shell, "kernel")


@contextmanager
def progress_bar(unit: str = "sessions", progress: Progress | None = None) -> Generator[Progress]:
    """Yield a function that reports progress: `progress` if given, else a bar labelled with `unit`.

    >>> with progress_bar(progress=print) as report:
    ...     report("take", 1, 2)
    take 1 2
    """
    if progress is not None or not shows_progress():
        yield progress or (lambda *_: None)
        return
    if in_notebook():
        yield from _notebook_bar(unit)
        return
    from rich.markup import escape  # noqa: PLC0415
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn  # noqa: PLC0415
    from rich.progress import Progress as Bar  # noqa: PLC0415

    from monochord.core.screen import console_of  # noqa: PLC0415

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Bar(*columns, console=console_of(sys.stderr), transient=True) as bar:
        task = bar.add_task(unit, total=None)
        shown = ""

        def report(name: str, done: int, of: int) -> None:
            nonlocal shown
            if name != shown and of != bar.tasks[0].total:
                bar.reset(task)
            shown = name
            bar.update(task, description=escape(printable(name)), completed=done, total=of)

        yield report


def _notebook_bar(unit: str) -> Generator[Progress]:
    """Yield the function that updates a bar below the cell, which is empty at the end."""
    handle = import_module("IPython.display").display(_Bar(unit), display_id=True)
    shown = time.monotonic()

    def report(name: str, done: int, of: int) -> None:
        nonlocal shown
        if done == of or time.monotonic() - shown >= REFRESH:
            shown = time.monotonic()
            handle.update(_Bar(name, done, of))

    try:
        yield report
    finally:
        handle.update(_Bar())


class _Bar:
    """A state of the bar in a notebook."""

    def __init__(self, name: str = "", done: int = 0, of: int = 0) -> None:
        self._text = f"{name} {done}/{of}".strip() if of else name
        self._state = f'value="{done}" max="{of}"' if of else ""

    def __repr__(self) -> str:
        return self._text

    def _repr_html_(self) -> str:
        return f"<progress {self._state}></progress> {escaped(self._text)}" if self._text else " "
