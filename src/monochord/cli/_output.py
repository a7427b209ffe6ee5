"""What the commands print, and the bar that shows progress meanwhile."""

import sys
from collections.abc import Generator
from contextlib import contextmanager

import click

from monochord.core.printable import printable
from monochord.core.types import Progress


def echo(*lines: str, err: bool = False) -> None:
    """Print lines, on standard error with `err`; nothing that they quote controls the terminal."""
    click.echo("\n".join(map(printable, lines)), err=err)  # noqa: TID251  (the one place)


@contextmanager
def progress_bar(unit: str = "sessions") -> Generator[Progress]:
    """Yield the function that reports progress: a bar, where there is a terminal to show it."""
    if not sys.stderr.isatty():
        yield lambda *_: None
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
