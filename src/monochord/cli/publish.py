"""The command `publish`: writes a model or a dataset as a folder for the Hugging Face Hub."""

import json
from pathlib import Path

import click

from monochord.cli._output import echo
from monochord.cli._signature import options_of
from monochord.front.publish import publish as published


@click.command()
@click.argument("what")
@options_of(published, "out", required=True, metavar="FOLDER")
@options_of(published, "licence", flags=("--licence", "--license"), required=True, metavar="ID")
@options_of(published, "scores", metavar="REPORT")
@options_of(published, "title")
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
