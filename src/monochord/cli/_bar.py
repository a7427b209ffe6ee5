"""A progress bar for what goes through sessions."""

import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import TypeAlias

from monochord.core.printable import printable

Progress: TypeAlias = Callable[[str, int, int], None]
"""Is told what is at hand, how many are done, and of how many."""


@contextmanager
def bar_of_sessions() -> Generator[Progress]:
    """Give what is told of the progress: a bar, where there is a terminal to show it."""
    if not sys.stderr.isatty():
        yield lambda *_: None
        return
    from rich.console import Console  # noqa: PLC0415
    from rich.markup import escape  # noqa: PLC0415
    from rich.progress import Progress as Bar  # noqa: PLC0415

    with Bar(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("sessions", total=None)

        def told(name: str, done: int, of: int) -> None:
            bar.update(task, description=escape(printable(name)), completed=done, total=of)

        yield told
