"""A recording of microphones and instruments on one clock."""

import json
import re
import sys
from collections.abc import Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from monochord.capture.instruments import INSTRUMENTS
from monochord.capture.recording import RecordingSettings
from monochord.capture.recording import record as run
from monochord.capture.recording.settings import kind_of
from monochord.capture.recording.streams import free_name
from monochord.capture.recording.view import viewed
from monochord.cli._options import (
    amount,
    completes,
    first_field,
    put,
    put_source,
    radius,
    sensor_option,
    set_option,
    source_options,
)
from monochord.cli._output import echo
from monochord.core.config import Tree, load_toml, override, table
from monochord.core.errors import DeviceError, InputError

RESERVED = tuple(field.name for field in fields(RecordingSettings))
"""Tables that --set reaches by their first word, and so no instrument's name."""


@click.command()
@click.argument("out", metavar="OUT.mcap", type=click.Path(path_type=Path))
@source_options
@click.option(
    "--instrument",
    "instruments",
    multiple=True,
    metavar="[STREAM:]NAME[=WHERE]",
    help="Also record a force sensor, robot or other stream; repeatable.",
    **completes(INSTRUMENTS.names),
)
@click.option("--seconds", type=amount, metavar="S", help="How long to record.  [default: until Control-C]")
@click.option("--object", "object_", metavar="TEXT", help="Object that touches the string.")
@click.option("--material", metavar="TEXT", help="Material of the object.")
@click.option("--radius", type=radius, metavar="M", help="Radius of the object where it touches.")
@sensor_option
@click.option("--notes", metavar="TEXT", help="Notes to save with the session.")
@click.option("--simulated", is_flag=True, default=None, help="Mark the session as simulated.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as one JSON object.")
@click.option(
    "--config", type=click.Path(path_type=Path), metavar="FILE", help="Read settings from a TOML file."
)
@set_option("monochord list settings record")
def record(out: Path, **options: Any) -> None:
    """Record microphones, force and pose into one session file.

    Options override --config, and --set overrides both. Set an instrument's options by its name: STREAM if
    one was given, else NAME, or NAME_2 for the second of a kind. Control-C, SIGTERM or SIGHUP ends the
    recording; everything up to then is saved.

    \b
    monochord record take.mcap --source twin --seconds 2
    monochord record take.mcap --instrument net_ft=192.168.1.1 --set net_ft.bias=true
    monochord record take.mcap --instrument left:pose_udp=9871 --instrument right:pose_udp=9872
    """  # noqa: D301
    settings = RecordingSettings.read(_tree(options))
    job = settings.job(out)
    with viewed(out, Console(file=sys.stderr, highlight=False)) as view:
        summary = run(job, view.show)
    echo(*([json.dumps(summary.tree())] if options["as_json"] else summary.lines()))
    if summary.failure:
        raise DeviceError(summary.failure)


def _tree(options: dict[str, Any]) -> Tree:
    tree: Tree = load_toml(options["config"]) if options["config"] else {}
    put_source(tree, options)
    instruments = _instruments(table(tree, "instruments"), options["instruments"])
    put(tree, "about", object=options["object_"], simulated=options["simulated"])
    about = {key: options[key] for key in ("material", "radius", "sensor")}
    put(tree, "about", **about, note=options["notes"])
    put(tree, "instruments", **instruments)
    if options["seconds"] is not None:
        tree["seconds"] = options["seconds"]
    return override(tree, _in_full(options["assignments"], instruments))


def _instruments(configured: Tree, named: Sequence[str]) -> Tree:
    """Return the tables of instruments: those of the configuration, with those of --instrument over them."""
    tables: Tree = {name.replace("-", "_"): table(configured, name) for name in configured}
    if len(tables) < len(configured):
        raise InputError(f"instruments {', '.join(configured)}", "names that differ by more than - and _")
    given: set[str] = set()
    for text in named:
        head, equals, where = text.partition("=")
        stream, _, kind = (part.replace("-", "_") for part in head.rpartition(":"))
        if (
            not stream and kind in tables and kind not in INSTRUMENTS.names()
        ):  # one of the configuration's own
            stream, kind = kind, kind_of(kind, tables[kind])
        if head.count(":") and not re.fullmatch("[a-z][a-z0-9_]*", stream):
            raise InputError(f"stream '{stream}'", "small letters, digits and _, a letter first")
        name = stream or free_name(kind, given)
        if name in given or name in RESERVED:
            allowed = (
                "a name of its own for each" if name in given else f"a name other than {', '.join(RESERVED)}"
            )
            raise InputError(f"--instrument {text} called '{name}'", allowed, "name it: STREAM:NAME=WHERE")
        given.add(name)
        known = tables.get(name, {})
        tables[name] = {
            **(known if kind_of(name, known) == kind else {}),
            **({first_field(INSTRUMENTS, kind): where} if equals else {}),
            **({"name": kind} if stream else {}),
        }
    return tables


def _in_full(assignments: Sequence[str], instruments: Iterable[str]) -> list[str]:
    """Return assignments, those that begin with an instrument's name put into the table of them."""
    names = set(instruments)
    full: list[str] = []
    for text in assignments:
        head, dot, rest = text.removeprefix("instruments.").partition(".")
        name = head.replace("-", "_")
        if text.startswith("instruments.") or (dot and name in names):
            full.append(f"instruments.{name}{dot}{rest}")
            continue
        if name in INSTRUMENTS.names():
            raise InputError(f"--set {text}", f"options of what is recorded; add --instrument {name}")
        full.append(text)
    return full
