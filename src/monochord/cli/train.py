"""The verb `train`: a dataset into a model."""

import json
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from monochord.cli._output import echo
from monochord.core.config import load_toml, override
from monochord.core.printable import printable
from monochord.figures import FIGURES
from monochord.perception.training.configs import config_path
from monochord.perception.training.rows import Told
from monochord.perception.training.scores import lines
from monochord.perception.training.settings import Settings
from monochord.perception.training.train import Result
from monochord.perception.training.train import train as trained

LEARNING = "learning"
"""The figure that is drawn into the folder of a run, under its own name."""


@click.command()
@click.argument("config")
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("run"), show_default=True, help="Folder."
)
@click.option("--dataset", type=click.Path(), metavar="DIR", help="What monochord build made.")
@click.option("--set", "assignments", multiple=True, metavar="A.B=C", help="Any setting; the last word.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def train(
    config: str, *, out: Path, dataset: str | None, assignments: tuple[str, ...], as_json: bool
) -> None:
    """Train a model by CONFIG, a preset's name or a TOML file.

    The folder of the run holds its settings, its history, also drawn, the model and what that is worth
    on validation. After an interruption the same command goes on.

    \b
    monochord train small --dataset dataset --out run
    monochord train paper --set feature.name=log_mel --out run
    """  # noqa: D301
    tree = load_toml(config_path(config))
    if dataset is not None:
        tree["dataset"] = dataset
    settings = Settings.read(override(tree, assignments))
    with _shown() as told:
        result = trained(settings, out, told)
    _draw(out)
    echo(*([json.dumps(_tree(result))] if as_json else _lines(result)))


def _draw(out: Path) -> None:
    """Draw how a run learned into its folder; equal histories give equal bytes."""
    import matplotlib as mpl  # noqa: PLC0415

    with mpl.rc_context({"svg.hashsalt": LEARNING}):
        drawn = FIGURES.build(LEARNING, {"run": str(out)}).draw()
        drawn.savefig(out / f"{LEARNING}.svg", metadata={"Date": None})


def _tree(result: Result) -> dict[str, Any]:
    told = result.model.definition
    return {
        "path": str(result.out),
        "simulated": told.simulated,
        "feature": told.feature.name,
        "epochs": result.epochs,
        "part": "validation",
        "heads": result.scores,
        "weights": told.weights,
    }


def _lines(result: Result) -> list[str]:
    told = result.model.definition
    kind = ", simulated" if told.simulated else ""
    reference = f" beside the reference {told.reference.feature.name}" if told.reference else ""
    tasks = {name: record.task for name, record in told.heads.items()}
    return [
        f"{result.out}{kind}: feature {told.feature.name}{reference}, {result.epochs} epochs",
        "on the validation part, by which the epoch of each head and its calibration were chosen:",
        *lines(result.scores, tasks),
    ]


@contextmanager
def _shown() -> Generator[Told]:
    """Give what is told of the progress: a bar, where there is a terminal to show it."""
    if not sys.stderr.isatty():
        yield lambda *_: None
        return
    from rich.console import Console  # noqa: PLC0415
    from rich.markup import escape  # noqa: PLC0415
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn  # noqa: PLC0415

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=None)
        shown = ""

        def told(what: str, done: int, of: int) -> None:
            nonlocal shown
            if what != shown:
                bar.reset(task)
            shown = what
            bar.update(task, description=escape(printable(what)), completed=done, total=of)

        yield told
