"""A recording of microphones and instruments on one clock."""

import json
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import click
from rich.console import Console

from monochord.cli._options import amount, first_field, put
from monochord.cli._output import echo
from monochord.config import Tree, load_toml, override
from monochord.errors import DeviceError, InputError
from monochord.instruments import INSTRUMENTS
from monochord.recording import Settings
from monochord.recording import record as run
from monochord.recording.view import viewed


@click.command()
@click.argument("out", metavar="OUT.mcap", type=click.Path(path_type=Path))
@click.option("--source", metavar="NAME", help="Where audio comes from.  [default: jack]")
@click.option(
    "--instrument",
    "instruments",
    multiple=True,
    metavar="NAME[=WHERE]",
    help="What to record beside it; repeatable.",
)
@click.option("--seconds", type=amount, metavar="S", help="How long; else until Control-C.")
@click.option("--object", "object_", metavar="TEXT", help="What touches the string.")
@click.option("--material", metavar="TEXT", help="What that is made of.")
@click.option("--radius", type=amount, metavar="M", help="Its radius where it touches.")
@click.option("--sensor", metavar="PRESET", help="The sensor, of the catalogue or FILE.toml.")
@click.option("--note", metavar="TEXT", help="Whatever else should be known.")
@click.option("--simulated", is_flag=True, default=None, help="Mark the session as no real one.")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as one JSON object.")
@click.option("--config", type=click.Path(path_type=Path), metavar="FILE", help="Settings from a TOML file.")
@click.option("--set", "assignments", multiple=True, metavar="A.B=C", help="Any setting; the last word.")
def record(out: Path, **options: Any) -> None:
    """Record audio, force and pose into the session OUT.mcap.

    Settings come from --config, then from the options, then from --set, where an instrument's options go by
    its name. Control-C, SIGTERM or SIGHUP ends the recording; what was recorded is saved at every
    moment.

    \b
    monochord record take.mcap --object plastic --seconds 60
    monochord record take.mcap --instrument net_ft=192.168.1.1 --set net_ft.bias=true
    """  # noqa: D301
    settings = Settings.read(_tree(options))
    job = settings.job(out)
    with viewed(out, Console(file=sys.stderr, highlight=False)) as view:
        summary = run(job, view.show)
    echo(*([json.dumps(summary.tree())] if options["as_json"] else summary.lines()))
    if summary.failure:
        raise DeviceError(summary.failure)


def _tree(options: dict[str, Any]) -> Tree:
    tree: Tree = load_toml(options["config"]) if options["config"] else {}
    before = tree.get("source", {})
    name = options["source"] or before.get("name", "jack")
    # Another source than the file's does not take over the options of the file's.
    tree["source"] = {**(before if before.get("name") == name else {}), "name": name}
    known: Tree = tree.get("instruments", {})
    instruments: Tree = dict(known)
    for text in options["instruments"]:
        asked, equals, where = text.partition("=")
        key = asked.replace("-", "_")
        opened = {first_field(INSTRUMENTS, asked): where} if equals else {}
        instruments[key] = {**known.get(key, {}), **opened}
    put(tree, "about", object=options["object_"], simulated=options["simulated"])
    put(tree, "about", **{key: options[key] for key in ("material", "radius", "sensor", "note")})
    put(tree, "instruments", **instruments)
    if options["seconds"] is not None:
        tree["seconds"] = options["seconds"]
    return override(tree, _in_full(options["assignments"], instruments))


def _in_full(assignments: Sequence[str], instruments: Iterable[str]) -> list[str]:
    """Return assignments, those that begin with an instrument's name put into the table of them."""
    names = set(instruments)
    for text in assignments:
        name = text.partition(".")[0].replace("-", "_")
        if name in INSTRUMENTS.names() and name not in names:
            raise InputError(f"--set {text}", f"options of what is recorded; add --instrument {name}")
    return [
        f"instruments.{text}" if text.partition(".")[0].replace("-", "_") in names else text
        for text in assignments
    ]
