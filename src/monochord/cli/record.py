"""The command `record`: records microphones and instruments on one clock."""

import json
import sys
from pathlib import Path
from typing import Any

import click

from monochord.capture.instruments import INSTRUMENTS
from monochord.capture.recording import RecordingJob
from monochord.capture.recording import record as run
from monochord.capture.recording.view import viewed
from monochord.cli._options import (
    amount,
    completes,
    put_source,
    radius,
    sensor_option,
    set_option,
    source_options,
)
from monochord.cli._output import echo
from monochord.core.config import Tree, load_toml
from monochord.core.errors import DeviceError
from monochord.core.screen import console_of
from monochord.front.record import recording_job


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
    recording; everything recorded so far is saved.

    \b
    monochord record take.mcap --source twin --seconds 2
    monochord record take.mcap --instrument net_ft=192.168.1.1 --set net_ft.bias=true
    monochord record take.mcap --instrument left:pose_udp=9871 --instrument right:pose_udp=9872
    """  # noqa: D301
    job = _job(out, options)
    with viewed(out, console_of(sys.stderr)) as view:
        summary = run(job, view.show)
    echo(*([json.dumps(summary.tree())] if options["as_json"] else summary.lines()))
    if summary.failure:
        raise DeviceError(summary.failure)


def _job(out: Path, options: dict[str, Any]) -> RecordingJob:
    """Return the recording described by the options, with its source as a table."""
    tree: Tree = load_toml(options["config"]) if options["config"] else {}
    put_source(tree, options)
    about = {key: options[key] for key in ("material", "radius", "sensor", "notes", "simulated", "seconds")}
    return recording_job(
        out,
        tree,
        instruments=options["instruments"],
        settings=options["assignments"],
        object=options["object_"],
        **about,
    )
