"""The command `doctor`: checks this machine's readiness for live audio, or brings up a newly built sensor."""

import dataclasses
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from monochord.bringup import (
    BringUp,
    Live,
    Step,
    Virtual,
    bring_up,
    from_recordings,
    shown,
    steps,
    write,
)
from monochord.bringup import (
    recordings as recorded,
)
from monochord.bringup.page import rows
from monochord.capture.jack.machine import MISSING, OK, Check, checks
from monochord.capture.sources import SOURCES
from monochord.cli._compile import compile_kernels
from monochord.cli._options import (
    amount,
    put_source,
    refuse_unwritable,
    refuse_without,
    sensor_option,
    set_option,
    source_options,
)
from monochord.cli._output import echo
from monochord.core.config import Tree, override
from monochord.core.errors import InputError
from monochord.evaluation import recordings
from monochord.live import LiveRun
from monochord.physics.sensors import load_sensor
from monochord.physics.twin import sensor_of

MARKS = {"ok": "ok     ", "warn": "warn   ", "missing": "missing"}
PASSED = {True: "ok      ", False: "FAILED  ", None: "left out"}
PAUSE = 3.0
"""Time in s to get ready for a step without prompts."""


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
@set_option("monochord list settings live")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def doctor(*, compiles: bool, as_json: bool, **options: Any) -> int:
    """Check this machine for live audio; with --sensor, bring up a newly built sensor.

    Each line is one requirement; a line with -> says what to do. The exit status is 1 only if a required
    part is missing.

    With --sensor, it asks for one step after the other, records each, and says what passed and what to
    change. --out writes a file for --sensor of other commands, and a report beside it, such as mine.html. The
    exit status is then 1 if a check failed.

    \b
    monochord doctor
    monochord doctor --sensor prototype --source jack --out mine.toml
    monochord doctor --sensor prototype --recordings takes --out mine.toml
    """  # noqa: D301
    if options["sensor"]:
        return _sensor(options, as_json=as_json)
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


def _sensor(options: dict[str, Any], *, as_json: bool) -> int:
    """Bring up a sensor; return the exit status."""
    sensor, out = options["sensor"], options["out"]
    load_sensor(sensor)  # an unknown one is refused before anything is recorded
    if out is not None:
        refuse_unwritable(out, (".toml",))
        if not options["force"] and (taken := [p for p in (out, out.with_suffix(".html")) if p.exists()]):
            raise InputError(
                f"file '{taken[0]}', which already exists", "a new file", "replace it with --force"
            )
    result = _brought_up(options, quiet=as_json)
    written = write(result, out) if out is not None else ()
    if as_json:
        paths = [str(path) for path in written if path is not None]
        echo(
            json.dumps(
                {"faults": result.faults, "passed": result.passed, "files": paths, "checks": rows(result)}
            )
        )
        return int(not result.passed)
    echo(f"{len(result.faults)} fault(s): {', '.join(result.faults)}" if result.faults else "No fault.")
    for path, use in zip(written, (f"use it with --sensor {out}", "the report"), strict=False):
        echo(f"written to {path}; {use}" if path else "no sensor file: the pitch is not measured")
    return int(not result.passed)


def _brought_up(options: dict[str, Any], *, quiet: bool) -> BringUp:
    """Carry out the steps on what the options name, and print each check as it is there unless `quiet`."""
    sensor, folder = options["sensor"], options["folder"]
    show = (lambda _: None) if quiet else _shower()
    todo = steps(options["drift"] or 0.0)
    if folder is not None:
        refuse_without(
            "--source, --device or --rate with --recordings", "only one", "source", "device", "rate"
        )
        result = from_recordings(sensor, recorded(folder, todo))
        show(result)
        return result
    tree: Tree = {"sinks": {}}
    put_source(tree, options)
    source = LiveRun.read(override(tree, options["assignments"])).source
    if (name := SOURCES.name_of(source)) == "twin":
        built: Any = source
        virtual = sensor_of(load_sensor(sensor), built.world, build=built.build, day=built.day)
        taking: Any = Virtual(sensor=virtual, seed=built.seed, sample_rate=built.sample_rate)
    else:
        taking = Live(source=source, name=name, prompt=lambda step: _prompt(step, waits=not options["yes"]))
    return bring_up(sensor, taking, todo, after=show)


def _prompt(step: Step, *, waits: bool) -> None:
    """Say on standard error what to do, and wait for Enter or a while."""
    echo("", f"{step.name} ({step.seconds:g} s): {step.instruction}", err=True)
    if waits:
        click.prompt("Enter to record", default="", show_default=False, prompt_suffix=" ", err=True)
    else:
        time.sleep(PAUSE)
    echo("recording ...", err=True)


def _shower() -> Callable[[BringUp], None]:
    """Return a function that prints the checks that are new or have changed since its last call."""
    printed: dict[tuple[str, str], str] = {}

    def show(result: BringUp) -> None:
        for check in result.checks:
            text = f"{PASSED[check.passed]}  {check.name:<42}  {shown(check)}"
            known = check.step in result.takes or check.step == "loopback"
            if known and printed.get((check.step, check.name)) != text:
                printed[check.step, check.name] = text
                echo(text)

    return show


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
