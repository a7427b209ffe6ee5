"""The bring-up of a sensor on the command line: prompts, checks as they come, and the files."""

import json
import time
from typing import Any

import click

from monochord.bringup import (
    END,
    RECORD,
    SKIP,
    BringUp,
    Guide,
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
from monochord.bringup.examine import REHEARSAL
from monochord.bringup.page import rows
from monochord.bringup.takes import OnAudio, ignore_audio
from monochord.capture.sources import SOURCES
from monochord.cli._options import (
    first_field,
    put_source,
    refuse_own_design,
    refuse_unless_forced,
    refuse_unwritable,
    refuse_without,
)
from monochord.cli._output import echo
from monochord.core.config import Tree, override
from monochord.front.page import design_page
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
        refuse_own_design(out, sensor)
        refuse_unless_forced(out, out.with_suffix(".html"), force=options["force"])
    result = _brought_up(options, quiet=as_json)
    written = write(result, out) if out is not None else ()
    if as_json:
        paths = [str(path) for path in written if path is not None]
        echo(
            json.dumps(
                {
                    "simulated": result.simulated,
                    "faults": result.faults,
                    "passed": result.passed,
                    "files": paths,
                    "checks": rows(result),
                }
            )
        )
        return int(not result.passed)
    echo(result.verdict)
    uses = f"use it with --sensor {out}", "the report"
    for path, use in zip(
        written, (f"{each}, simulated" if result.simulated else each for each in uses), strict=False
    ):
        echo(f"written to {path}; {use}" if path else "no sensor file: the pitch is not measured")
    return int(not result.passed)


def _brought_up(options: dict[str, Any], *, quiet: bool) -> BringUp:
    """Carry out the steps on the recordings or the source in the options; print each check unless `quiet`."""
    sensor, folder = options["sensor"], options["folder"]
    todo, guide = steps(options["drift"] or 0.0), _Terminal(waits=not options["yes"], quiet=quiet)
    if folder is not None:
        refuse_without(
            "--source, --device or --rate with --recordings", "only one", "source", "device", "rate"
        )
        result = from_recordings(sensor, recordings(folder, todo))
        guide.show(result)
        return result
    if options["web"]:
        return _on_the_page(options, todo)
    source = _source_of(options)
    return bring_up(sensor, source, todo, guide if isinstance(source, Live) else _Unasked(quiet=quiet))


def _source_of(options: dict[str, Any], on_audio: OnAudio | None = None) -> Live | Virtual:
    """Return the source in the options; `on_audio` gets its sound as it comes."""
    tree: Tree = {"sinks": {}}
    put_source(tree, options)
    source = LiveRun.read(override(tree, options["assignments"])).source
    if (name := SOURCES.name_of(source)) == "twin":
        built: Any = source
        world = sensor_of(load_sensor(options["sensor"]), built.world, build=built.build, day=built.day)
        return Virtual(sensor=world, seed=built.seed, sample_rate=built.sample_rate, on_audio=on_audio)
    opened = getattr(source, first_field(SOURCES, name)) or "first two inputs"
    return Live(source=source, name=f"{name} {opened}", on_audio=on_audio or ignore_audio)


def _on_the_page(options: dict[str, Any], todo: tuple[Step, ...]) -> BringUp:
    """Carry out the steps as people choose on a page, and serve it until Control-C."""
    from monochord.bringup.web import BringUpPage  # noqa: PLC0415  (loads a web server)
    from monochord.page.serving import served  # noqa: PLC0415  (likewise)

    out = options["out"]
    page = BringUpPage(
        options["sensor"], todo, write=None if out is None else lambda result: write(result, out)
    )
    source = _source_of(options, page.on_audio)
    names, browser = options["allow_host"], not options["no_browser"]
    pages = (page.page, design_page())
    with served(pages, str(options["port"]), names=names, browser=browser):
        return bring_up(options["sensor"], source, todo, page.guide(source))


class _Unasked(Guide):
    """Prints the checks that are new or have changed since the last step."""

    def __init__(self, *, quiet: bool) -> None:
        self._printed: dict[tuple[str, str], str] = {}
        self._quiet = quiet

    def show(self, result: BringUp) -> None:
        """Print the checks, and first that they are simulated where they are."""
        if result.simulated and not (self._printed or self._quiet):
            echo(REHEARSAL)
        for check in result.checks:
            text = f"{PASSED[check.passed]}  {check.name:<42}  {shown(check)}"
            known = check.step in result.takes or check.step == "loopback"
            if not self._quiet and known and self._printed.get((check.step, check.name)) != text:
                self._printed[check.step, check.name] = text
                echo(text)


class _Terminal(_Unasked):
    """Says on standard error what to do, and waits for a key or a while."""

    def __init__(self, *, waits: bool, quiet: bool) -> None:
        super().__init__(quiet=quiet)
        self._waits, self._last = waits, ""

    def choose(self, step: Step | None, result: BringUp | None) -> str:  # noqa: ARG002
        """Ask for the step."""
        if step is None:
            return END
        echo("", f"{step.name} ({step.seconds:g} s): {step.instruction}", err=True)
        choice = RECORD
        if self._waits:
            before = self._last if self._last != step.name else ""
            others = {"s": SKIP} | ({"r": before} if before else {})
            text = "Enter to record, s to skip" + (f", r to repeat {before}" if before else "")
            given = click.prompt(text, default="", show_default=False, prompt_suffix=" ", err=True)
            choice = others.get(given.strip().lower(), RECORD)
        else:
            time.sleep(PAUSE)
        if choice == RECORD:
            self._last = step.name
            echo("recording ...", err=True)
        return choice
