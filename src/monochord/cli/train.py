"""The command `train`: a dataset into a model."""

import json
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click

from monochord.cli._options import set_option, worker_options
from monochord.cli._output import echo, progress_bar
from monochord.core.config import load_toml, override
from monochord.figures import FIGURES
from monochord.perception.heads.base import Task
from monochord.perception.training.configs import DEFAULT, config_path
from monochord.perception.training.settings import TrainingSettings
from monochord.perception.training.train import HeadScores, TrainingResult
from monochord.perception.training.train import train as train_model

LEARNING = "learning"
"""The figure that is drawn into the folder of a run, under its own name."""


@click.command()
@click.argument("config", default=DEFAULT)
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("run"), show_default=True, help="Run folder."
)
@click.option("--dataset", type=click.Path(), metavar="DIR", help="Dataset of 'monochord build'.")
@set_option("monochord list settings train")
@worker_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def train(
    config: str,
    *,
    out: Path,
    dataset: str | None,
    assignments: tuple[str, ...],
    workers: int | None,
    cluster: str,
    as_json: bool,
) -> None:
    """Train a model on a dataset.

    CONFIG is a preset or a TOML file; the default is the configuration of the published results. The run
    folder receives the model, its settings, its learning curve and its validation scores. After an
    interruption, run the same command again to continue.

    \b
    monochord train --dataset dataset --out run
    monochord train paper --dataset dataset --out paper --set seed=1
    """  # noqa: D301
    tree = load_toml(config_path(config))
    if dataset is not None:
        tree["dataset"] = dataset
    settings = TrainingSettings.read(override(tree, assignments))
    with progress_bar("windows") as progress:
        result = train_model(settings, out, progress, workers=workers, cluster=cluster)
    _draw(out)
    echo(*([json.dumps(_tree(result))] if as_json else _lines(result)))


def _draw(out: Path) -> None:
    """Draw the history of a run into its folder if matplotlib is installed; equal runs give equal bytes."""
    if find_spec("matplotlib") is None:
        return
    import matplotlib as mpl  # noqa: PLC0415

    with mpl.rc_context({"svg.hashsalt": LEARNING}):
        figure = FIGURES.build(LEARNING, {"run": str(out)}).draw()
        figure.savefig(out / f"{LEARNING}.svg", metadata={"Date": None})


def _tree(result: TrainingResult) -> dict[str, Any]:
    definition = result.model.definition
    return {
        "path": str(result.out),
        "simulated": definition.simulated,
        "feature": definition.feature.name,
        "epochs": result.epochs,
        "part": "validation",
        "heads": result.scores,
        "weights": definition.weights,
    }


def _lines(result: TrainingResult) -> list[str]:
    definition = result.model.definition
    kind = ", simulated" if definition.simulated else ""
    reference = f" beside the reference {definition.reference.feature.name}" if definition.reference else ""
    tasks = {name: record.task for name, record in definition.heads.items()}
    return [
        f"{result.out}{kind}: feature {definition.feature.name}{reference}, {result.epochs} epochs",
        "on the validation part, which chose the epoch of each head and its calibration:",
        *score_lines(result.scores, tasks),
    ]


def score_lines(scores: Mapping[str, HeadScores], tasks: Mapping[str, Task]) -> list[str]:
    """Return scores by head as lines of text, with the units that a person reads."""
    lines: list[str] = []
    for name, score in scores.items():
        count = f"{score['windows']:.0f} windows"
        if tasks[name].is_probability:
            text = f"{100 * score['accuracy']:.2f} % right, area under the curve {score['auc']:.4f}"
            text += f" ({count}; always the same answer: {100 * score['baseline_accuracy']:.1f} %)"
        else:
            factor, unit = (1e3, "mm") if tasks[name].unit == "m" else (1.0, tasks[name].unit)
            error, std, mean = (f"{factor * score[key]:.3g} {unit}" for key in ("mae", "std", "baseline_mae"))
            text = f"mean error {error}, stated +-{std} (median), r {score['r']:.3f}"
            text += f" ({count}; the mean label: {mean})"
        lines.append(f"  {name:<10} {text}")
    return lines
