"""The command `build`: builds a dataset with labels from sessions, split and audited."""

import json
from pathlib import Path
from typing import Any

import click

from monochord.cli._options import completes, sensor_option, worker_options
from monochord.cli._output import echo
from monochord.cli._signature import options_of
from monochord.datasets.kinds import KINDS, table_of
from monochord.front.build import build as build_data
from monochord.front.build import built
from monochord.perception.data import LabelledData


@click.command()
@click.argument("sessions", nargs=-1, required=True)
@options_of(build_data, "out", required=True)
@options_of(build_data, "window", "hop", "labels")
@options_of(
    build_data, "split", metavar="BY", **completes(lambda: ("session", "object", "time", "day", "build"))
)
@options_of(build_data, "held_out", metavar="NAME")
@options_of(build_data, "seed", "force")
@sensor_option
@options_of(build_data, "skip")
@worker_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def build(sessions: tuple[str, ...], *, out: Path, as_json: bool, **options: Any) -> None:
    """Build a dataset from sessions, with labels and a split.

    SESSIONS are files, folders or patterns. Their sound is cut into windows, each with its labels, and the
    windows are split into training, validation and test. The split is audited: any leak between the parts
    makes the command fail. The string's pitch comes from the session, else from --sensor, else from the
    untouched beginning of the recording.

    \b
    monochord build sessions --out dataset
    monochord build sessions --out unseen --held-out 'slide*'
    """  # noqa: D301
    data = built(sessions, out, note=lambda line: echo(line, err=True), **options)
    result = _result(data, out)
    echo(*([json.dumps(result)] if as_json else _lines(result)))
    data.refuse_leaks()


def _result(data: LabelledData, out: Path) -> dict[str, Any]:
    manifest, split, audit = data.manifest, data.split, data.audit
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
        "parts": table_of(data.dataset, split),
        "leaks": [str(leak) for leak in audit.leaks] if audit else [],
        "notes": list(audit.notes) if audit else [],
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
