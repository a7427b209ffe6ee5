"""The command `tune`: tunes a sensor's string from untouched sound."""

import dataclasses
import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from monochord.capture.sources import SOURCES
from monochord.cli._options import (
    put_source,
    refuse_own_design,
    refuse_unless_forced,
    refuse_unwritable,
    sensor_option,
    set_option,
    source_options,
    window_options,
)
from monochord.cli._output import echo
from monochord.cli._signature import options_of
from monochord.core.config import Tree, override
from monochord.core.files import usable_path, write_text
from monochord.live import LiveRun
from monochord.live.tuning import WINDOW, SensorAsTuned, tuned
from monochord.live.tuning import tune as tune_sensor
from monochord.physics.sensors import HOW_LONG, sensor_tuning

OUT = Path("sensor.toml")


@click.command()
@click.argument("inputs", metavar="[INPUT]...", nargs=-1)
@source_options
@sensor_option
@options_of(tune_sensor, "seconds")
@options_of(
    tune_sensor,
    "length",
    help=f"Length of the string, by a ruler {HOW_LONG}.  [default: as in --sensor FILE]",
)
@window_options
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help=f"Sensor file to write.  [default: {OUT}]",
)
@click.option("--force", is_flag=True, help="Overwrite the file if it exists.")
@set_option("monochord list settings live")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def tune(inputs: tuple[str, ...], *, out: Path | None, force: bool, as_json: bool, **options: Any) -> None:
    """Measure the untouched string's pitch and write sensor.toml.

    Switch the drivers on and touch nothing. INPUT is a recording (sound, or a session's .mcap), a device or
    JACK ports; give several for several recordings. Pass the written file as --sensor to live,
    locate, record and collect. If the pitch cannot be found, nothing is written.

    \b
    monochord tune --sensor prototype --length 0.1983
    monochord tune --source twin --set source.sensor=gauge_012 --out thin.toml
    """  # noqa: D301
    path = out or OUT
    refuse_unwritable(path, (".toml",))
    refuse_unless_forced(path, force=force)
    refuse_own_design(path, options["sensor"] or "")
    runs = [_run(opened, options) for opened in inputs or (None,)]
    names = [
        opened or SOURCES.name_of(run.source) for opened, run in zip(inputs or (None,), runs, strict=True)
    ]
    result = tuned(
        [run.source for run in runs],
        names,
        sensor=options["sensor"] or "",
        seconds=runs[0].seconds,
        window=runs[0].window,
        length=options["length"],
    )
    result = dataclasses.replace(result, time=datetime.now(UTC).isoformat(timespec="seconds"))
    with usable_path(f"file {path}", "a writable path"):
        write_text(path, result.toml())
    if as_json:
        measured = sensor_tuning(str(path))
        echo(json.dumps({"path": str(path), **_facts(result), "tuning": dataclasses.asdict(measured)}))  # pyright: ignore[reportArgumentType]
        return
    echo(*result.lines(), f"written to {path}; use it with --sensor {path}")


def _run(opened: str | None, options: dict[str, Any]) -> LiveRun:
    """Return a run that would open this input; only source, window and time are used."""
    tree: Tree = {"sinks": {}, "seconds": options["seconds"]}
    put_source(tree, options, opened)
    tree["window"] = {"length": options["window"] or WINDOW.length, "hop": options["hop"] or WINDOW.hop}
    return LiveRun.read(override(tree, options["assignments"]))


def _facts(result: SensorAsTuned) -> dict[str, Any]:
    return {
        "design": result.design,
        "nominal": result.nominal,
        "deviation": result.deviation,
        "cents": result.cents,
        "refused_windows": result.refused,
        "notes": list(result.notes),
    }
