"""The bring-up of a sensor on the command line: prompts, checks as they come, and the files."""

import json
import time
from collections.abc import Callable
from typing import Any

import click

from monochord.bringup import (
    BringUp,
    Live,
    Step,
    Virtual,
    bring_up,
    from_recordings,
    recordings,
    shown,
    steps,
    write,
)
from monochord.bringup.page import rows
from monochord.capture.sources import SOURCES
from monochord.cli._options import first_field, put_source, refuse_unwritable, refuse_without
from monochord.cli._output import echo
from monochord.core.config import Tree, override
from monochord.core.errors import InputError
from monochord.live import LiveRun
from monochord.physics.sensors import load_sensor
from monochord.physics.twin import sensor_of

PASSED = {True: "ok      ", False: "FAILED  ", None: "left out"}
PAUSE = 3.0
"""Time in s to get ready for a step without prompts."""


def bring_up_sensor(options: dict[str, Any], *, as_json: bool) -> int:
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
    """Carry out the steps on the recordings or the source in the options; print each check unless `quiet`."""
    sensor, folder = options["sensor"], options["folder"]
    show = (lambda _: None) if quiet else _shower()
    todo = steps(options["drift"] or 0.0)
    if folder is not None:
        refuse_without(
            "--source, --device or --rate with --recordings", "only one", "source", "device", "rate"
        )
        result = from_recordings(sensor, recordings(folder, todo))
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
        opened = getattr(source, first_field(SOURCES, name)) or "first two inputs"
        taking = Live(
            source=source,
            name=f"{name} {opened}",
            prompt=lambda step: _prompt(step, waits=not options["yes"]),
        )
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
