"""The command `doctor`: what live audio needs, what of it this machine has, and what to do about the rest."""

import dataclasses
import json

import click

from monochord.capture.jack.machine import MISSING, OK, WARN, Check, checks
from monochord.cli._compile import compile_kernels
from monochord.cli._output import echo
from monochord.evaluation import recordings

MARKS = {"ok": "ok     ", "warn": "warn   ", "missing": "missing"}


@click.command()
@click.option(
    "--compile", "compiles", is_flag=True, help="First compile all kernels, so that no other command has to."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def doctor(*, compiles: bool, as_json: bool) -> int:
    """Check what live audio needs on this machine; fails only if a required part is missing."""
    if compiles:
        compile_kernels()
    results = [*checks(), _recordings()]
    if as_json:
        echo(json.dumps({"checks": [dataclasses.asdict(check) for check in results]}))
    else:
        for check in results:
            echo(f"{MARKS[check.state]}  {check.name:<18}  {check.detail}")
            if check.remedy:
                echo(f"{'':<9}{'':<20}-> {check.remedy}")
    return int(any(check.required and check.state == MISSING for check in results))


def _recordings() -> Check:
    name, folder = "real recordings", recordings.folder()
    if folder is None:
        remedy = "only studies and the noise suite need them; name their folder in MONOCHORD_REALSTRINGS"
        return Check(name=name, state=WARN, detail="none", remedy=remedy)
    return Check(name=name, state=OK, detail=f"{len(recordings.takes())} in {folder}")
