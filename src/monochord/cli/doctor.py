"""The command `doctor`: checks this machine's readiness for live audio, or brings up a newly built sensor."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import click

from monochord.capture.jack.machine import MISSING, OK, MachineCheck, checks
from monochord.cli._bring_up import PAUSE, bring_up_sensor
from monochord.cli._compile import compile_kernels
from monochord.cli._options import (
    PAGE_OPTIONS,
    amount,
    page_options,
    refuse_without,
    sensor_option,
    set_option,
    source_options,
)
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
@sensor_option
@source_options
@click.option(
    "--recordings",
    "folder",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="With --sensor: take each step from a recording, such as pluck.wav, instead of a live source.",
)
@click.option(
    "--yes", is_flag=True, help=f"With --sensor: do not wait for Enter; a step begins after {PAUSE:g} s."
)
@click.option(
    "--drift", type=amount, default=None, metavar="SECONDS", help="With --sensor: measure the drift as well."
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="With --sensor: sensor file to write, with a report.",
)
@click.option("--force", is_flag=True, help="Overwrite the file if it exists.")
@page_options("With --sensor: lead through the steps on a page instead of the terminal.")
@set_option("monochord list settings live")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def doctor(*, compiles: bool, as_json: bool, **options: Any) -> int:
    """Check this machine, or bring up a newly built sensor.

    Each line is one requirement; a line with -> says what to do. The exit status is 1 only if a required
    part is missing.

    With --sensor, it asks for one step after the other, records each, and says what passed and what to
    change. --out writes a file for --sensor of other commands, and a report beside it, such as mine.html. The
    exit status is then 1 if a check failed.

    \b
    monochord doctor
    monochord doctor --sensor prototype --source twin --out mine.toml
    monochord doctor --sensor prototype --source jack --web --out mine.toml
    """  # noqa: D301
    if not (options["sensor"] and options["web"]):
        refuse_without(
            "an option of the page", "it has an effect with --sensor and --web", "web", *PAGE_OPTIONS
        )
    if options["sensor"]:
        if options["web"]:
            refuse_without("--recordings, --yes or --json with --web", "only one", "folder", "yes", "as_json")
        return bring_up_sensor(options, as_json=as_json)
    refuse_without(
        "an option of a sensor's bring-up", "it has an effect with --sensor",
        "folder", "yes", "drift", "out", "force", "source", "device", "rate", "assignments",
    )  # fmt: skip
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


def _usable(results: list[MachineCheck]) -> bool:
    return not any(check.required and check.state == MISSING for check in results)


def _verdict(results: list[MachineCheck]) -> str:
    """Return the overall result."""
    if not _usable(results):
        return "Monochord does not work here until the missing parts are installed."
    if any(check.state != OK for check in results):
        return "Simulations and recordings work; for live sound, follow the lines with ->."
    return "Everything is ready, live sound included."


def _recordings() -> MachineCheck:
    name, folder = "real recordings", recordings.folder()
    if folder is None:
        detail = "none; evaluate --noise and studies read them, from the folder MONOCHORD_REALSTRINGS"
        return MachineCheck(name=name, state=OK, detail=detail)
    return MachineCheck(
        name=name, state=OK, detail=f"{len(recordings.takes())} sounds of strings in {folder}"
    )
