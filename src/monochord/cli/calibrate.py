"""The command `calibrate`: adapts a model to one sensor with a few known touches."""

import json
from pathlib import Path
from typing import Any

import click

from monochord.cli._output import echo
from monochord.cli._signature import options_of
from monochord.core.errors import InputError
from monochord.front.calibrate import calibrate as adapted


@click.command()
@click.argument("model")
@options_of(adapted, "sessions", multiple=True, type=str, required=True, metavar="FILES")
@options_of(adapted, "touches", "objects", "labels")
@options_of(adapted, "out", help="New folder for the model; not needed with --touches 0.")
@options_of(adapted, "force")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def calibrate(
    model: str, *, sessions: tuple[str, ...], out: Path | None, as_json: bool, **options: Any
) -> None:
    """Adapt a model to your sensor with a few known touches.

    Touch the string at a few places with a few forces. Record the touches, or import a sound file with a
    table of positions and forces, as read from a ruler and a kitchen scale ('monochord sessions import').
    Earlier calibrations of MODEL are kept. With --objects others, and one session per object, only the sensor
    is learned, not the object. The sensor is assumed to be healthy: its present sound no longer counts as a
    fault.

    The printed errors are cross-validated: each is for a touch left out of the fit. Use --touches 0 to test
    the model on all touches without changing it. Impossible labels, such as forces in grams, are refused.

    \b
    monochord calibrate demo --sessions touches.mcap --out mine
    monochord calibrate demo --sessions touches.mcap --touches 0
    """  # noqa: D301
    if out is None and options["touches"] != 0:
        raise InputError(
            "no --out", "a new folder for the model", "or --touches 0, which only tests the model"
        )
    result = adapted(model, sessions, out, **options)
    if as_json:
        echo(json.dumps(result.tree()))
        return
    kind = ", simulated" if result.definition.simulated else ""
    learned = result.calibration.learned
    how = "errors on held-out touches, by cross-validation" if learned else "unchanged"
    echo(f"{out or model}{kind}: {how}", *result.calibration.lines())
