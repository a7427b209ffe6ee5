"""The command `skin`: the geometry of several strings on one link, and their frames for ROS."""

import json
from pathlib import Path

import click

from monochord.cli._options import refuse_unless_forced, refuse_unwritable
from monochord.cli._output import echo
from monochord.core.files import write_text
from monochord.skin import load_skin
from monochord.skin.urdf import urdf, xacro

MACRO = ".xacro"
"""Suffix of a file with a macro; a URDF has another."""


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--robot", type=click.Path(path_type=Path), metavar="URDF", help="The robot, which must have the link."
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write the strings' frames: a macro to a .xacro; to a .urdf the link with its strings, or --robot "
    "with them.",
)
@click.option("--force", is_flag=True, help="Overwrite the file if it exists.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def skin(file: Path, *, robot: Path | None, out: Path | None, force: bool, as_json: bool) -> None:
    """Check a skin's file and print its geometry.

    FILE has a link of the robot and its strings, each with its ends, the direction of a touch, sensor and
    channels. Printed are the channels, the part of each string that is sensed, the distance of neighbours,
    and how deep a flat plate sinks between them before it is felt.

    \b
    monochord skin finger.toml
    monochord skin finger.toml --robot arm.urdf --out arm_with_strings.urdf
    monochord skin finger.toml --out finger.urdf.xacro
    """  # noqa: D301
    if out is not None:
        refuse_unwritable(out, (MACRO, ".urdf"))
        refuse_unless_forced(out, force=force)
    loaded = load_skin(file, robot or "")
    if out is not None:
        name, link, strings = loaded.name, loaded.link, loaded.strings
        is_macro = out.suffix == MACRO
        text = xacro(name, link, strings) if is_macro else urdf(name, link, strings, robot)
        write_text(out, text)
    if as_json:
        echo(json.dumps(loaded.tree() | ({"path": str(out)} if out else {})))
        return
    echo(*loaded.lines(), *([f"written to {out}"] if out else []))
