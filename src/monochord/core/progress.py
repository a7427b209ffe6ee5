"""Progress bars for long work, on a terminal and in a notebook only."""

import sys
from collections.abc import Generator
from contextlib import contextmanager
from importlib.util import find_spec

from monochord.core.printable import printable
from monochord.core.types import Progress


def shows_progress() -> bool:
    """Return whether a bar can be shown: standard error on a terminal, or a notebook with widgets."""
    if "ipykernel" in sys.modules:
        return find_spec("ipywidgets") is not None
    return sys.stderr.isatty()


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
    from rich.console import Console  # noqa: PLC0415
    from rich.markup import escape  # noqa: PLC0415
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn  # noqa: PLC0415
    from rich.progress import Progress as Bar  # noqa: PLC0415

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(unit, total=None)
        shown = ""

        def report(name: str, done: int, of: int) -> None:
            nonlocal shown
            if name != shown and of != bar.tasks[0].total:
                bar.reset(task)
            shown = name
            bar.update(task, description=escape(printable(name)), completed=done, total=of)

        yield report
