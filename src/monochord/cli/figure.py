"""The command `figure`: draws a figure into a file."""

import json
from pathlib import Path

import click

from monochord.cli._moved import refuse_moved
from monochord.cli._options import completes, refuse_unwritable, set_option
from monochord.cli._output import echo
from monochord.core.config import override, to_tree
from monochord.core.files import replacing
from monochord.figures import FIGURES
from monochord.figures.base import Measured, require_matplotlib

SUFFIXES = (".png", ".pdf", ".svg")


@click.command()
@click.argument("name", **completes(FIGURES.names))
@click.option(
    "--out", type=click.Path(path_type=Path), help="File to write: .png, .pdf or .svg.  [default: NAME.png]"
)
@set_option("monochord list figures")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def figure(name: str, *, out: Path | None, assignments: tuple[str, ...], as_json: bool) -> None:
    """Draw a figure into a file.

    NAME is a figure of 'monochord list figures', which shows its options too.

    \b
    monochord figure scatter --set results=report/results.npz
    monochord figure session --set path=session.mcap --out session.svg
    """  # noqa: D301
    refuse_moved("figure", name, FIGURES.names())
    require_matplotlib()
    path = out or Path(f"{name}.png")
    refuse_unwritable(path, SUFFIXES)
    drawing = FIGURES.build(name, override({}, assignments), where="")
    with replacing(path) as part:
        drawing.draw().savefig(part)
    if as_json:
        result = {"figure": name, "path": str(path), "options": to_tree(drawing)}
        if isinstance(drawing, Measured):
            result["numbers"] = drawing.numbers()
        echo(json.dumps(result))
    else:
        echo(str(path))
