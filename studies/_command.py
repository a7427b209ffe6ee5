"""Shared by the commands of studies: errors as one line, a progress bar, and tables."""

import json
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

import click
from rich.console import Console
from rich.progress import Progress

from monochord.benchmarks.base import Benchmark
from monochord.core.config import from_tree, override
from monochord.core.errors import InputError, MonochordError
from monochord.figures.base import Figure, Measured


def main(command: click.Command) -> None:
    """Run a command and exit: 0 for success, 2 for an error reported in one line.

    It is run as its module's, not as that of ``__main__``, whose functions no worker process can import.
    """
    started = sys.modules["__main__"]
    if started.__spec__ is not None and command in vars(started).values():
        (name,) = (name for name, value in vars(started).items() if value is command)
        command = getattr(import_module(started.__spec__.name), name)
    try:
        command.main(standalone_mode=False)
    except (MonochordError, click.ClickException) as error:
        text = error.format_message() if isinstance(error, click.ClickException) else str(error)
        sys.stderr.write(f"{command.name}: {text}\n")
        sys.exit(2)


@contextmanager
def progress_bar(title: str) -> Generator[Callable[[str, int, int], None]]:
    """Show a bar, moved by what is yielded: current work, amount done, total."""
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title)
        yield lambda name, done, of: bar.update(task, description=name or title, completed=done, total=of)


def lines_of(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a table as lines: names to the left, figures to the right.

    >>> lines_of(("model", "mm"), [("ridge", "1.5"), ("demo", "0.52")])
    ['model    mm', 'ridge   1.5', 'demo   0.52']
    """
    table = [tuple(heads), *map(tuple, rows)]
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    figures = [all(row[at][-1:] in "0123456789-%mN" for row in rows) for at in range(len(heads))]
    lines = (
        "  ".join(
            text.rjust(width) if right else text.ljust(width)
            for text, width, right in zip(line, widths, figures, strict=True)
        )
        for line in table
    )
    return [line.rstrip() for line in lines]


def measure(kind: type[Benchmark]) -> None:
    """Run a benchmark as a command, whose ``--set NAME=VALUE`` overrides an option, and print its rows."""

    @click.command(name=kind.__name__.lower(), help=kind.__doc__)
    @click.option("--set", "assignments", multiple=True, metavar="NAME=VALUE", help="Override an option.")
    def command(assignments: tuple[str, ...]) -> None:
        for row in from_tree(kind, override({}, assignments), kind.__name__).run():
            beside = f"  {row.ratio:.3g} times {row.baseline} ({row.baseline_value:.4g})" if row.ratio else ""
            print(f"{row.name:<40}{row.value:>12.4g} {row.unit}{beside}", flush=True)

    main(command)


def draw(kind: type[Figure]) -> None:
    """Draw a figure as a command, whose ``--set NAME=VALUE`` overrides an option."""

    @click.command(name=kind.__name__.lower(), help=kind.__doc__)
    @click.option("--set", "assignments", multiple=True, metavar="NAME=VALUE", help="Override an option.")
    @click.option("--out", type=click.Path(path_type=Path), required=True, help="File of the figure.")
    @click.option("--json", "numbers", type=click.Path(path_type=Path), help="File of its numbers.")
    def command(assignments: tuple[str, ...], out: Path, numbers: Path | None) -> None:
        figure = from_tree(kind, override({}, assignments), kind.__name__)
        if numbers is not None:
            if not isinstance(figure, Measured):
                raise InputError(f"--json {numbers}", "a figure with numbers", "leave --json out")
            numbers.write_text(json.dumps(figure.numbers(), indent=1) + "\n", encoding="utf-8")
        figure.draw().savefig(out)

    main(command)
