"""The command `calibrate`: a model adapted to one build by a few known touches."""

import dataclasses
import json
import tempfile
from pathlib import Path
from typing import Any

import click

from monochord.cli._output import echo, progress_bar
from monochord.core.errors import InputError
from monochord.datasets.build import BuildOptions, Labelling, build_dataset, find_sessions
from monochord.perception.model import Model, load, save
from monochord.perception.training.adapt import Adaptation, HeadAdaptation, adapt
from monochord.perception.tuning.sessions import heard_tension


@click.command()
@click.argument("model")
@click.option("--sessions", multiple=True, required=True, metavar="FILES", help="Known touches; repeatable.")
@click.option("--touches", type=click.IntRange(min=1), metavar="N", help="Use the first N.  [default: all]")
@click.option(
    "--labels",
    type=click.Choice(["recorded", "measured"]),
    help="From the session, or from force and pose.  [default: recorded where there are any]",
)
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder of the new model.")
@click.option("--force", is_flag=True, help="Accept sessions whose streams are not on one clock.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def calibrate(
    model: str,
    *,
    sessions: tuple[str, ...],
    touches: int | None,
    labels: Labelling | None,
    out: Path,
    force: bool,
    as_json: bool,
) -> None:
    """Adapt MODEL to one sensor and object by touches of known position and force.

    A few touches at different places and forces are enough: record them, or import a sound file and a table
    of what a ruler and a kitchen scale showed (monochord sessions import). What the model was adapted to
    before stays known. Every error below is of touches that were left out.

    \b
    monochord calibrate demo --sessions touches.mcap --out mine
    monochord live mine
    """  # noqa: D301
    given = load(model)
    if out.exists():
        raise InputError(f"folder {out} (exists)", "a new folder", "choose another name with --out")
    trained = given.definition
    rate = trained.sample_rate
    options = BuildOptions(
        window=trained.window / rate, hop=trained.hop / rate, labels=labels or "", force=force
    )
    with tempfile.TemporaryDirectory() as folder:
        dataset = build_dataset(
            find_sessions(sessions), Path(folder) / "dataset", options, listen=heard_tension
        )
        with progress_bar() as progress:
            result = adapt(given, dataset, touches=touches, progress=progress)
    saved = save(result.model, out)
    echo(*([json.dumps(_tree(result, saved, out))] if as_json else _lines(result, out)))


def _tree(result: Adaptation, saved: Model, out: Path) -> dict[str, Any]:
    return {
        "path": str(out),
        "simulated": saved.definition.simulated,
        "heads": {name: dataclasses.asdict(head) for name, head in result.heads.items()},
        "next_touch": dataclasses.asdict(result.next_touch) if result.next_touch else None,
        "weights": saved.definition.weights,
    }


def _lines(result: Adaptation, out: Path) -> list[str]:
    kind = ", simulated" if result.model.definition.simulated else ""
    lines = [f"{out}{kind}: errors of touches that were left out, by cross-validation"]
    lines += [_line(name, head) for name, head in result.heads.items()]
    touch = result.next_touch
    if touch is not None:
        place = f"{1e3 * touch.position:.0f} mm with {touch.force:.1f} N"
        lines.append(
            f"the touch that would help most next: {place}, to lower the variance by {100 * touch.gain:.0f} %"
        )
    return lines


def _line(name: str, head: HeadAdaptation) -> str:
    factor, unit = (1e3, "mm") if head.unit == "m" else (1.0, head.unit)
    before, after, std = (f"{factor * value:.3g} {unit}" for value in (head.before, head.after, head.std))
    line = (
        f"  {name:<10} mean error {before} before, {after} with {head.touches} touches "
        f"({head.windows} windows), stated +-{std} (median), which covers {100 * head.coverage:.0f} %, "
        f"twice that {100 * head.within_two:.0f} %"
    )
    return line if head.used else f"{line}; left as it was, since they did not help"
