"""The command `audit`: whether anything leaks between the parts of a dataset's split."""

import dataclasses
import json
from pathlib import Path

import click

from monochord.cli._output import echo
from monochord.front.audit import audit as audit_dataset


@click.command()
@click.argument("dataset", type=click.Path(path_type=Path))
@click.option(
    "--split", "file", type=click.Path(path_type=Path), metavar="FILE", help="[default: the dataset's own]"
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def audit(dataset: Path, *, file: Path | None, as_json: bool) -> None:
    """Look for leaks between training, validation and test of DATASET; fails if there is one.

    A leak is a window, a sample, a session, a day or an object that two parts share, a guard gap that is too
    small, or a recording that is there twice: under another name, shifted, scaled or with noise added.

    \b
    monochord audit dataset --json
    """  # noqa: D301
    report = audit_dataset(dataset, file)
    if as_json:
        leaks = [dataclasses.asdict(leak) for leak in report.leaks]
        echo(json.dumps({"clean": report.clean, "leaks": leaks, "notes": list(report.notes)}))
    else:
        lines = [*(f"leak: {leak}" for leak in report.leaks), *(f"note: {note}" for note in report.notes)]
        echo(*lines, f"{len(report.leaks) or 'no'} leak{'' if len(report.leaks) < 2 else 's'}")
    report.refuse_leaks()
