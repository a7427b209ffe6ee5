"""The command `calibrate`: a model adapted to one build by a few known touches."""

import dataclasses
import json
from pathlib import Path
from typing import Any

import click

from monochord.cli._output import echo, progress_bar
from monochord.datasets.build import Labelling
from monochord.perception.training.adapt import Objects
from monochord.perception.training.adaptation import Adaptation
from monochord.perception.training.calibration import calibrated


@click.command()
@click.argument("model")
@click.option(
    "--sessions", multiple=True, required=True, metavar="FILES", help="Sessions of known touches; repeatable."
)
@click.option(
    "--touches",
    type=click.IntRange(min=0),
    metavar="N",
    help="Use only the first N touches; 0 tests the model and changes nothing.  [default: all]",
)
@click.option(
    "--objects",
    type=click.Choice(["same", "others"]),
    default="same",
    help="Will the same object touch the string later, or others too?  [default: same]",
)
@click.option(
    "--labels",
    type=click.Choice(["recorded", "measured"]),
    help="Use the labels of the session, or derive them from force and pose.  [default: recorded, if any]",
)
@click.option(
    "--out", type=click.Path(path_type=Path), help="New folder for the model; not needed with --touches 0."
)
@click.option("--force", is_flag=True, help="Accept sessions whose streams are not on one clock.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def calibrate(
    model: str,
    *,
    sessions: tuple[str, ...],
    touches: int | None,
    objects: Objects,
    labels: Labelling | None,
    out: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Adapt a model to your sensor with a few known touches.

    Touch the string at a few places with a few forces. Record the touches, or import a sound file with a
    table of positions and forces, as read from a ruler and a kitchen scale ('monochord sessions import').
    Earlier calibrations of MODEL are kept. With --objects others, and one session per object, only the
    sensor is learned, not the object. The sensor counts as healthy: its present sound is no fault from then
    on.

    The errors that are printed are of touches that were left out. Use --touches 0 to test the model on all
    touches without changing it. Impossible labels, such as forces in grams, are refused.

    \b
    monochord calibrate demo --sessions touches.mcap --out mine
    monochord calibrate demo --sessions touches.mcap --touches 0
    """  # noqa: D301
    with progress_bar() as progress:
        result = calibrated(
            model,
            sessions,
            out,
            touches=touches,
            objects=objects,
            labels=labels or "",
            force=force,
            progress=progress,
        )
    if as_json:
        echo(json.dumps(_tree(result, out)))
        return
    kind = ", simulated" if result.model.definition.simulated else ""
    how = "errors of touches that were left out, by cross-validation" if result.learned else "as it is"
    echo(f"{out or model}{kind}: {how}", *result.lines())


def _tree(result: Adaptation, out: Path | None) -> dict[str, Any]:
    return {
        "path": str(out) if out else None,
        "simulated": result.model.definition.simulated,
        "heads": {name: dataclasses.asdict(head) for name, head in result.heads.items()},
        "mistaken": result.mistaken,
        "trust": dataclasses.asdict(result.trust),
        "next_touch": dataclasses.asdict(result.next_touch) if result.next_touch else None,
        "sensing_range": result.sensing_range,
        "outside": result.outside,
        "weights": result.model.definition.weights,
    }
