"""The command `build`: sessions into a dataset with labels, split and audited."""

import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from monochord.cli._options import amount, completes, sensor_option, worker_options
from monochord.cli._output import echo, progress_bar
from monochord.core.errors import InputError
from monochord.datasets.audit import audit as audit_split
from monochord.datasets.build import (
    BuildOptions,
    Labelling,
    build_dataset,
    find_sessions,
    named_sessions,
)
from monochord.datasets.kinds import KINDS, table_of
from monochord.datasets.split import (
    PARTS,
    SPLIT_FILE,
    Split,
    refuse_impossible,
    refuse_too_few,
    split_dataset,
)
from monochord.datasets.store import Dataset
from monochord.perception.tuning.sessions import estimate_tension
from monochord.sessions import Description, read_session


@click.command()
@click.argument("sessions", nargs=-1, required=True)
@click.option("--out", type=click.Path(path_type=Path), required=True, help="New folder for the dataset.")
@click.option(
    "--window", type=amount, default=0.1, show_default=True, metavar="S", help="Length of a window."
)
@click.option(
    "--hop",
    type=amount,
    default=0.1,
    show_default=True,
    metavar="S",
    help="Time from one window to the next.",
)
@click.option(
    "--labels",
    type=click.Choice(["recorded", "measured"]),
    help="Use the labels of the session, or derive them from force and pose.  [default: recorded, if any]",
)
@click.option(
    "--split",
    "by",
    metavar="BY",
    help="Split by session, object, time, day or build.  [default: session; time below 3 sessions]",
    **completes(lambda: ("session", "object", "time", "day", "build")),
)
@click.option(
    "--held-out",
    multiple=True,
    metavar="NAME",
    help="Keep an object, or sessions by a pattern such as 'music*', for the test alone; repeatable.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Random seed.")
@click.option("--force", is_flag=True, help="Accept sessions whose streams are not on one clock.")
@sensor_option
@click.option("--skip", is_flag=True, help="Skip sessions that cannot be used.")
@worker_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def build(
    sessions: tuple[str, ...],
    *,
    out: Path,
    window: float,
    hop: float,
    labels: Labelling | None,
    by: str | None,
    held_out: tuple[str, ...],
    seed: int,
    force: bool,
    sensor: str | None,
    skip: bool,
    workers: int | None,
    cluster: str,
    as_json: bool,
) -> None:
    """Build a dataset from sessions, with labels and a split.

    SESSIONS are files, folders or patterns. Their sound is cut into windows, each with its labels, and the
    windows are split into training, validation and test. The split is audited: any leak between the parts
    makes the command fail. The string's pitch comes from the session, else from --sensor, else from the
    untouched beginning of the recording.

    \b
    monochord build sessions --out dataset
    monochord build sessions --out unseen --held-out 'slide*'
    """  # noqa: D301
    files = find_sessions(sessions)
    _refuse_split(by or _default_split(len(files)), files, held_out)
    options = BuildOptions(
        window=window, hop=hop, labels=labels or "", force=force, skip=skip, sensor=sensor or ""
    )
    with progress_bar() as progress:
        dataset = build_dataset(
            files, out, options, progress, estimate_tension, workers=workers, cluster=cluster
        )
    for line in dataset.manifest.refused.values():
        echo(f"left out: {line}", err=True)
    by = by or _default_split(len(dataset.manifest.parts))
    try:
        split = split_dataset(dataset, by=by, seed=seed, held_out=held_out)
    except InputError as error:
        remedy = f"{error.remedy}; {out} stands without a split".removeprefix("; ")
        raise InputError(error.given, error.expected, remedy) from error
    split.write(out / SPLIT_FILE)
    audit = audit_split(dataset, split)
    result = _result(dataset, split, out)
    result |= {"leaks": [str(leak) for leak in audit.leaks], "notes": list(audit.notes)}
    echo(*([json.dumps(result)] if as_json else _lines(result)))
    audit.refuse_leaks()


def _default_split(count: int) -> str:
    """Return how so many sessions are split by default."""
    return "session" if count >= len(PARTS) else "time"


def _refuse_split(by: str, files: Sequence[Path], held_out: Sequence[str]) -> None:
    """Refuse an impossible split before anything is built."""
    refuse_impossible(by, held_out=held_out)
    descriptions: dict[str, Description] = {}
    for name, file in named_sessions(files).items():
        with suppress(InputError):  # refused when it is built
            descriptions[name] = read_session(file).description
    if descriptions:
        objects = [one.material or one.object for one in descriptions.values()]
        days = [one.day for one in descriptions.values()]
        builds = [one.build for one in descriptions.values()]
        refuse_too_few(by, objects, days, held_out, list(descriptions), builds)


def _result(dataset: Dataset, split: Split, out: Path) -> dict[str, Any]:
    manifest = dataset.manifest
    return {
        "path": str(out),
        "sessions": len(manifest.parts),
        "refused": manifest.refused,
        "simulated": manifest.simulated,
        "labels": {part.name: part.labels for part in manifest.parts},
        "windows": manifest.windows,
        "counts": manifest.counts,
        "split": split.by,
        "seed": split.seed,
        "left_out": split.left_out,
        "parts": table_of(dataset, split),
    }


def _lines(result: dict[str, Any]) -> list[str]:
    kind = ", simulated" if result["simulated"] else ""
    sources = sorted(set(result["labels"].values()))
    wide = max(len(name) for counts in result["parts"].values() for name in [*counts, "object"])
    heads = "".join(f"{name:>12}" for name in KINDS)
    count = f"{result['sessions']} session{'' if result['sessions'] == 1 else 's'}"
    origin = f"{result['windows']} windows of {count}, labels {' and '.join(sources)}"
    lines = [
        f"{result['path']}{kind}: {origin}, {result['counts']['clipped']} windows clipped",
        f"split by {result['split']}, seed {result['seed']}, {result['left_out']} windows in guard gaps",
        f"  {'':<10}  {'object':<{wide}}{heads}",
    ]
    for part, objects in result["parts"].items():
        for name, counts in objects.items():
            numbers = "".join(f"{counts[kind]:>12}" for kind in KINDS)
            lines.append(f"  {part:<10}  {name or '(none)':<{wide}}{numbers}")
    lines += [f"leak: {leak}" for leak in result["leaks"]] or ["audit: no leak"]
    return lines + [f"note: {note}" for note in result["notes"]]
