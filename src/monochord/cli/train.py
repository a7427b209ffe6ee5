"""The command `train`: a dataset into a model."""

import json
from pathlib import Path
from typing import Any

import click

from monochord.cli._options import set_option, worker_options
from monochord.cli._output import echo
from monochord.front.train import train as train_model
from monochord.perception.training.configs import DEFAULT


@click.command()
@click.argument("config", default=DEFAULT)
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("run"), show_default=True, help="Folder."
)
@click.option("--dataset", type=click.Path(), metavar="DIR", help="Dataset that monochord build made.")
@set_option("monochord list settings train")
@worker_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def train(
    dataset: str | None, out: Path, *, assignments: tuple[str, ...], as_json: bool, **options: Any
) -> None:
    """Train a model by CONFIG, a preset's name or a TOML file; by default that of the published results.

    The folder of the run holds its settings, its history, also drawn, the model and its scores on
    validation. After an interruption the same command goes on. Worker processes compute the features.

    \b
    monochord train --dataset dataset --out run
    monochord train paper --set feature.name=log_mel --out run
    """  # noqa: D301
    model = train_model(dataset, out, settings=assignments, **options)
    echo(*([json.dumps(model.tree())] if as_json else model.lines()))
