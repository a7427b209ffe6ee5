"""The command `sessions label`: guided touches of known position and force, recorded with their labels."""

import json
import math
import os
import re
import select
import shlex
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import click

from monochord.capture.recording.settings import of_sensor
from monochord.capture.sources import SOURCES
from monochord.cli._options import (
    amount,
    put_source,
    radius,
    refuse_unwritable,
    sensor_option,
    set_option,
    source_options,
)
from monochord.cli._output import echo
from monochord.core.config import Tree, override, to_tree
from monochord.core.errors import DeviceError, InputError
from monochord.core.files import refuse_existing
from monochord.core.interruption import interruption
from monochord.core.screen import console_of
from monochord.core.units import Metres, Newtons
from monochord.live.labelled import LabelledRecording, beside, complete, length_of
from monochord.live.loop import opened
from monochord.live.settings import MODEL, LiveRun
from monochord.live.touch_guide import FORCES, HOLD, TouchGuide
from monochord.perception.model import load
from monochord.physics.known_touches import Unit, in_newtons
from monochord.sessions import read_session
from monochord.sessions.facts import facts_lines, facts_of

USUAL_LENGTH: Metres = 0.65
"""Length of a string that nobody states, in m."""
COMMANDS = "Enter: held now, or let go, where it is not heard. u: undo. s: skip this place. q: finish."
STANDARD_INPUT = 0
NUMBER = re.compile(r"(?P<value>[-+]?[0-9]*[.]?[0-9]+)\s*(?P<unit>mm|N|g)?", re.IGNORECASE)


@click.command()
@click.argument("out", metavar="OUT.mcap", type=click.Path(path_type=Path))
@source_options
@sensor_option
@click.option(
    "--model", metavar="NAME", default="demo", show_default=True, help="Model that hears the touches."
)
@click.option(
    "--touches", type=click.IntRange(1, 1000), default=10, show_default=True, metavar="N",
    help="Number of touches.",
)  # fmt: skip
@click.option(
    "--unit", type=click.Choice(["N", "g"]), default="g", show_default=True,
    help="Unit of the forces that you type: newtons, or grams as a kitchen scale shows.",
)  # fmt: skip
@click.option(
    "--hold", type=click.FloatRange(0.5, 30.0), default=HOLD, show_default=True, metavar="S",
    help="How long to hold each touch.",
)  # fmt: skip
@click.option(
    "--forces", type=amount, nargs=2, default=FORCES, show_default=True, metavar="LOW HIGH",
    help="Range of proposed forces in N.",
)  # fmt: skip
@click.option("--object", "object_", metavar="TEXT", help="Object that touches the string.")
@click.option("--material", metavar="TEXT", help="Material of the object.")
@click.option("--radius", type=radius, metavar="M", help="Radius of the object where it touches.")
@click.option("--notes", metavar="TEXT", help="Notes to save with the session.")
@set_option("monochord list settings live")
@click.option("--json", "as_json", is_flag=True, help="Print the session's facts as one JSON object.")
def label(out: Path, *, as_json: bool, **options: Any) -> None:
    """Record touches of known position and force, step by step.

    Have a ruler along the string, and the sensor on a kitchen scale or the object on a force gauge. Each
    touch is proposed within the sensing range. The command hears when it begins, and says when it was held
    long enough. Then let go, and type the position in mm from pickup 1 and the force: '62 51', or with a
    unit, '62 0.5N'. An empty line takes the proposed values; one number alone is the position.

    The session goes to 'calibrate', 'build' and 'evaluate'. After a crash, the same command completes it from
    OUT.recorded.mcap and OUT.csv, which hold everything up to a quarter of a second before.

    \b
    monochord sessions label touches.mcap --sensor sensor.toml --object "3 mm rod"
    monochord sessions label touches.mcap --source twin --touches 3
    """  # noqa: D301
    refuse_unwritable(out, (".mcap",))
    refuse_existing(out)
    described = _described(options)
    recorded, table = beside(out)
    if recorded.exists() and table.exists():
        complete(out, described)
        echo(
            f"{out}: completed from an interrupted recording; record more touches into another file", err=True
        )
    else:
        _record(out, options, described)
    facts = facts_of(read_session(out))
    echo(*([json.dumps(facts)] if as_json else facts_lines(facts)))
    if not as_json:
        words = ["monochord", "calibrate", options["model"], "--sessions", str(out), "--out", "mine"]
        echo(f"then: {shlex.join(words)}")


def _described(options: dict[str, Any]) -> dict[str, Any]:
    """Return the session's description as plain values."""
    given = {name: options[name] for name in ("material", "radius", "notes")}
    about = {**given, "object": options["object_"]}
    described = {name: value for name, value in about.items() if value is not None}
    if options["sensor"]:
        described |= of_sensor(options["sensor"])
        described["string"] = to_tree(described["string"])
    return described


def _record(out: Path, options: dict[str, Any], described: dict[str, Any]) -> None:
    """Record guided touches until they are complete, the source ends, or a person finishes."""
    tree: Tree = {"sinks": {}}
    put_source(tree, options)
    definition = load(options["model"]).definition  # refused before any device is opened
    tree["estimator"] = {"name": MODEL, "path": options["model"]}
    tree["window"] = {"length": definition.window / definition.sample_rate}
    tree["sensor"] = options["sensor"] or ""
    setup = LiveRun.read(override(tree, options["assignments"]))
    low, high = options["forces"]
    if not low < high:
        raise InputError(f"--forces {low:g} {high:g}", "the lower force first")
    name = SOURCES.name_of(setup.source)
    with ExitStack() as stack:
        stop = stack.enter_context(interruption())
        with stop.at_once():
            live = stack.enter_context(opened(setup))
        stack.enter_context(stop.ending(live.close))
        guide = TouchGuide(
            live.signal,
            length_of(live.signal, USUAL_LENGTH),
            options["touches"],
            hold=options["hold"],
            forces=(low, high),
        )
        take = LabelledRecording(out, guide, live.signal, described)
        person = _Person(guide, options["unit"])
        try:
            for update in live:
                person.listen()
                take.take(update)
                if take.recording.failure:
                    kept = " and ".join(map(str, beside(out)))
                    raise DeviceError(f"{take.recording.failure}; {kept} hold what was recorded")
                if stop.requested or guide.complete:
                    break
        finally:
            labelled = not take.recording.failure and take.finish()
        if stop.requested and not labelled:
            raise KeyboardInterrupt
    if not labelled:
        raise InputError(f"{name} without a labelled touch", "one or more", "no session is written")


class _Person:
    """The person at the terminal: says what to do, and reads what is typed."""

    def __init__(self, guide: TouchGuide, unit: Unit) -> None:
        self._guide, self._unit = guide, unit
        self._typed = b""
        self._ended = False
        self._said = ""
        self._counted, self._left = 0, 0
        self._counts_down = console_of(sys.stderr).is_terminal  # a log needs no seconds
        echo(COMMANDS, err=True)

    def listen(self) -> None:
        """Carry out what was typed, and say what to do if that has changed."""
        for line in self._lines():
            self._obey(line.strip())
        guide, (place, force) = self._guide, self._guide.proposed
        text = guide.says(f"{1e3 * place:.0f} mm", self._force(force))
        if guide.phase == "label":
            text += f" [{1e3 * place:.0f} {self._in_unit(force)}] mm {self._unit}:"
        said = f"{len(guide.touches)} of {guide.count} touches. {text}"
        left = math.ceil(guide.remaining)
        if said != self._said:
            if guide.doubt and len(guide.touches) != self._counted:
                echo(guide.doubt, err=True)
            self._counted = len(guide.touches)
            echo(said, err=True)
        elif left != self._left and left and self._counts_down:
            echo(f"  {left} ...", err=True)
        self._said, self._left = said, left

    def _lines(self) -> list[str]:
        """Return the lines typed since the last call, without waiting."""
        while not self._ended and select.select([STANDARD_INPUT], [], [], 0.0)[0]:
            typed = os.read(STANDARD_INPUT, 4096)
            self._typed += typed
            self._ended = not typed
        if self._ended and self._guide.phase == "label":
            self._guide.finish()  # nobody is there to say position and force
        *lines, self._typed = self._typed.split(b"\n")
        return [line.decode(errors="replace") for line in lines]

    def _obey(self, line: str) -> None:
        guide, before = self._guide, self._guide.refusal
        match line.lower():
            case "q":
                guide.finish()
                done = True
            case "u":
                done = guide.undo()
            case "s":
                done = guide.skip()
            case "" if guide.phase != "label":
                done = guide.announce()
            case "":
                done = guide.hold(*guide.proposed)
            case _:
                done = self._measured(line)
        if not done and guide.refusal == before:
            echo(f"'{line}' has no effect now. {COMMANDS}" if line else COMMANDS, err=True)

    def _measured(self, line: str) -> bool:
        """Take a typed position, or position and force."""
        numbers = [*NUMBER.finditer(line)]
        left_over = NUMBER.sub("", line).strip(" ,;/")
        if left_over or not 1 <= len(numbers) <= 2:
            return False
        units = [(each["unit"] or "").lower() for each in numbers]
        if units[0] not in ("", "mm") or (len(units) == 2 and units[1] == "mm"):
            return False
        values = [float(each["value"]) for each in numbers]
        unit: Unit = {"n": "N", "g": "g"}.get(units[-1], self._unit)  # pyright: ignore[reportAssignmentType]
        force = in_newtons(values[1], unit) if len(values) == 2 else math.nan
        return self._guide.hold(1e-3 * values[0], force)

    def _in_unit(self, force: Newtons) -> str:
        return f"{force / in_newtons(1.0, 'g'):.0f}" if self._unit == "g" else f"{force:.1f}"

    def _force(self, force: Newtons) -> str:
        return f"{self._in_unit(force)} {self._unit}"
