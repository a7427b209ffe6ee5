"""The command `publish`: writes a model or a dataset as a folder for the Hugging Face Hub."""

import json
from pathlib import Path

import click

from monochord.cli._output import echo
from monochord.front.publish import publish as published


@click.command()
@click.argument("what")
@click.option(
    "--out", type=click.Path(path_type=Path), required=True, metavar="FOLDER", help="New folder to write."
)
@click.option(
    "--licence",
    "--license",
    required=True,
    metavar="ID",
    help="Licence that you publish under: the Hub's identifier, such as apache-2.0.",
)
@click.option(
    "--scores",
    type=click.Path(path_type=Path),
    metavar="REPORT",
    help="Folder of 'monochord evaluate', or its scores.json: the test in a model's card.",
)
@click.option("--title", default="", help="Title of the card.  [default: the model's, or the folder's name]")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def publish(what: str, *, out: Path, licence: str, scores: Path | None, title: str, as_json: bool) -> None:
    """Write a model or a dataset as a folder for the Hugging Face Hub.

    WHAT is the folder of a training run, of a model or of a dataset, or the name of a bundled model. The
    folder holds its files, a card with every figure from the files, and checksums. Nothing is uploaded.

    \b
    monochord publish run --scores report --licence apache-2.0 --out hub/model
    monochord publish dataset --licence cc-by-4.0 --out hub/dataset
    """  # noqa: D301
    folder = published(what, out, licence=licence, scores=scores, title=title)
    echo(json.dumps(folder.tree()) if as_json else str(folder))
