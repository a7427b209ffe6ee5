"""The command `train`: trains a model on a dataset."""

import json
from pathlib import Path
from typing import Any

import click

from monochord.cli._options import set_option, worker_options
from monochord.cli._output import echo
from monochord.cli._signature import options_of
from monochord.front.train import train as train_model
from monochord.perception.training.configs import DEFAULT


@click.command()
@click.argument("config", default=DEFAULT)
@options_of(train_model, "out")
@click.option("--dataset", type=click.Path(), metavar="DIR", help="Dataset of 'monochord build'.")
@set_option("monochord list settings train")
@worker_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def train(
    dataset: str | None, out: Path, *, assignments: tuple[str, ...], as_json: bool, **options: Any
) -> None:
    """Train a model on a dataset.

    CONFIG is a preset or a TOML file; the default is the configuration of the published results. Each head is
    learned by a network, ridge regression and extra trees, and keeps the best on validation. The run folder
    receives the model, its settings, its learning curve and its validation scores. After an
    interruption, run the same command again to continue.

    \b
    monochord train --dataset dataset --out run
    monochord train paper --dataset dataset --out paper --set seed=1
    """  # noqa: D301
    model = train_model(dataset, out, settings=assignments, **options)
    if model.left_out:
        echo(f"note: no network: it requires PyTorch. Install it: {model.left_out}", err=True)
    echo(*([json.dumps(model.tree())] if as_json else model.lines()))
