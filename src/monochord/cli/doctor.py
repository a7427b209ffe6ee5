"""The command `doctor`: checks this machine's readiness for live audio, with a remedy for each problem."""

import dataclasses
import json

import click

from monochord.capture.jack.machine import MISSING, OK, Check, checks
from monochord.cli._compile import compile_kernels
from monochord.cli._output import echo
from monochord.evaluation import recordings

MARKS = {"ok": "ok     ", "warn": "warn   ", "missing": "missing"}


@click.command()
@click.option(
    "--compile",
    "compiles",
    is_flag=True,
    help="Compile all kernels first, so that other commands start at once.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def doctor(*, compiles: bool, as_json: bool) -> int:
    """Check whether this machine is ready for live audio.

    Each line is one requirement; a line with -> says what to do. The exit status is 2 only if a required
    part is missing.

    \b
    monochord doctor
    monochord doctor --json
    """  # noqa: D301
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
        echo(_verdict(results))
    return int(not _usable(results))


def _usable(results: list[Check]) -> bool:
    return not any(check.required and check.state == MISSING for check in results)


def _verdict(results: list[Check]) -> str:
    """Return the overall result."""
    if not _usable(results):
        return "Monochord does not work here until the missing parts are installed."
    if any(check.state != OK for check in results):
        return "Simulations and recordings work; for live sound, follow the lines with ->."
    return "Everything is ready, live sound included."


def _recordings() -> Check:
    name, folder = "real recordings", recordings.folder()
    if folder is None:
        detail = "none; evaluate --noise and studies read them, from the folder MONOCHORD_REALSTRINGS"
        return Check(name=name, state=OK, detail=detail)
    return Check(name=name, state=OK, detail=f"{len(recordings.takes())} sounds of strings in {folder}")
