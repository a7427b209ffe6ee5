"""The command `audit`: checks a dataset's split for leaks."""

import dataclasses
import json
from pathlib import Path

import click

from monochord.cli._output import echo
from monochord.cli._signature import options_of
from monochord.front.audit import audit as audit_dataset


@click.command()
@click.argument("dataset", type=click.Path(path_type=Path))
@options_of(audit_dataset, "split", type=click.Path(path_type=Path), metavar="FILE")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def audit(dataset: Path, *, split: Path | None, as_json: bool) -> None:
    """Check a dataset for leaks between training and test.

    A leak is a window, sample, session, day or object that two parts share, a guard gap that is too small,
    or a copy of a recording: renamed, shifted, scaled or with noise added. Any leak makes the command fail.

    \b
    monochord audit dataset
    monochord audit dataset --split other.json --json
    """  # noqa: D301
    report = audit_dataset(dataset, split)
    if as_json:
        leaks = [dataclasses.asdict(leak) for leak in report.leaks]
        echo(json.dumps({"clean": report.clean, "leaks": leaks, "notes": list(report.notes)}))
    else:
        lines = [*(f"leak: {leak}" for leak in report.leaks), *(f"note: {note}" for note in report.notes)]
        echo(*lines, f"{len(report.leaks) or 'no'} leak{'' if len(report.leaks) < 2 else 's'}")
    report.refuse_leaks()
