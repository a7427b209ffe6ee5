"""The command `identify`: measures a real build from its untouched sound, a ruler and a caliper."""

import json
from pathlib import Path
from typing import Any

import click

from monochord.cli._options import refuse_unless_forced, refuse_unwritable, sensor_option
from monochord.cli._output import echo
from monochord.cli._signature import options_of
from monochord.core.files import write_text
from monochord.front.identify import identify as identified
from monochord.physics.sensors import HOW_LONG


@click.command()
@click.argument("files", metavar="FILES...", nargs=-1, required=True)
@options_of(identified, "length", required=True, help=f"Length of the string, by a ruler {HOW_LONG}.")
@options_of(identified, "caliper", "weighed")
@sensor_option
@options_of(identified, "length_error", "caliper_error")
@options_of(identified, "weighed_error", metavar="SHARE")
@options_of(identified, "seconds")
@click.option("--out", type=click.Path(path_type=Path), metavar="FILE", help="Sensor file to write.")
@click.option("--force", is_flag=True, help="Overwrite the file if it exists.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def identify(
    files: tuple[str, ...],
    *,
    sensor: str | None,
    out: Path | None,
    force: bool,
    as_json: bool,
    **measured: Any,
) -> None:
    """Measure a sensor as built: pitch, tension, density, losses.

    FILES are recordings of the untouched string (sound, or a session's .mcap): a pluck with both drivers off,
    and the string with both on. Each quantity has a standard error; tension and density have no answer
    without --caliper or --weighed, since sound and ruler do not determine them. The written file is a sensor
    for every --sensor.

    \b
    monochord identify pluck.wav driven.wav --length 0.2 --caliper 0.254e-3 --out mine.toml
    monochord identify pluck.wav --length 0.2 --weighed 3.95e-4 --json
    """  # noqa: D301
    if out is not None:
        refuse_unwritable(out, (".toml",))
        refuse_unless_forced(out, force=force)
    result = identified(*files, sensor=sensor or "", **measured)
    if out is not None:
        write_text(out, result.toml())
    written = {} if out is None else {"path": str(out)}
    if as_json:
        echo(json.dumps({**result.tree(), **written}))
        return
    echo(*result.lines(), *(f"written to {path}; use it with --sensor {path}" for path in written.values()))
