"""The command `calibrate`: a model adapted to one build by a few known touches."""

import json
from pathlib import Path
from typing import Any

import click

from monochord.cli._output import echo
from monochord.core.errors import InputError
from monochord.front.calibrate import calibrate as adapted


@click.command()
@click.argument("model")
@click.option("--sessions", multiple=True, required=True, metavar="FILES", help="Known touches; repeatable.")
@click.option(
    "--touches",
    type=click.IntRange(min=0),
    metavar="N",
    help="Use the first N; 0 changes nothing and judges by all.  [default: all]",
)
@click.option(
    "--objects",
    type=click.Choice(["same", "others"]),
    default="same",
    help="What will touch it: the object of these touches, or others too.  [default: same]",
)
@click.option(
    "--labels",
    type=click.Choice(["recorded", "measured"]),
    help="From the session, or from force and pose.  [default: recorded where there are any]",
)
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder of the new model; not needed for 0 touches."
)
@click.option("--force", is_flag=True, help="Accept sessions whose streams are not on one clock.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def calibrate(
    model: str, *, sessions: tuple[str, ...], out: Path | None, as_json: bool, **options: Any
) -> None:
    """Adapt MODEL to one sensor and object by touches of known position and force.

    A few touches at different places and forces are enough: record them, or import a sound file and a table
    of what a ruler and a kitchen scale showed (monochord sessions import). What the model was adapted to
    before stays known. Most of what they teach is the object's: with --objects others, each session of one
    object, the sensor alone is learned. The sensor is taken to be in order: what it sounds like is no fault
    from then on. Every error is of touches that were left out. With 0 touches the model stays as it is, and
    all of them say how good it is. Labels that cannot be, such as forces in grams, are refused: nothing is
    saved then.

    \b
    monochord calibrate demo --sessions touches.mcap --out mine
    monochord live mine
    monochord calibrate mine --sessions more.mcap --touches 0
    """  # noqa: D301
    if out is None and options["touches"] != 0:
        raise InputError("no --out", "a new folder for the model", "or --touches 0, which judges it alone")
    result = adapted(model, sessions, out, **options)
    if as_json:
        echo(json.dumps(result.tree()))
        return
    kind = ", simulated" if result.definition.simulated else ""
    learned = result.calibration.learned
    how = "errors of touches that were left out, by cross-validation" if learned else "as it is"
    echo(f"{out or model}{kind}: {how}", *result.calibration.lines())
