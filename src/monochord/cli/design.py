"""The command `design`: a sensor before it is built, with its bounds and what others would cost."""

import json
from pathlib import Path
from typing import Any

import click

from monochord.cli._options import (
    PAGE_OPTIONS,
    completes,
    page_options,
    refuse_unless_forced,
    refuse_unwritable,
    refuse_without,
)
from monochord.cli._output import echo
from monochord.cli._signature import options_of
from monochord.cli.figure import SUFFIXES
from monochord.core.files import replacing, write_text
from monochord.figures.base import require_matplotlib
from monochord.front.design import design as designed
from monochord.front.design_figure import draw
from monochord.front.page import design_page
from monochord.physics.design import FRAMES, WIRES, Wishes
from monochord.physics.materials import material_names


@click.command()
@options_of(Wishes, "length", "range", "resolution", "force_resolution")
@options_of(Wishes, "forces", type=click.Tuple([float, float]), metavar="N N")
@options_of(Wishes, "gauge", "tension")
@options_of(Wishes, "wire", metavar="NAME", help=f"Wire: {', '.join(WIRES)}.")
@options_of(Wishes, "frame", metavar="NAME", help=f"Frame: {', '.join(FRAMES)}.")
@options_of(Wishes, "mount")
@options_of(Wishes, "material", metavar="NAME", **completes(material_names))
@options_of(Wishes, "contact_share", "line_std", "open_std", metavar="SHARE")
@options_of(Wishes, "end_std", "window", "gap")
@options_of(Wishes, "level", metavar="TIMES")
@options_of(Wishes, "model", metavar="MODEL")
@click.option(
    "--figure", type=click.Path(path_type=Path), metavar="FILE", help="Draw it: .png, .pdf or .svg."
)
@click.option("--out", type=click.Path(path_type=Path), metavar="FILE", help="Sensor file to write.")
@click.option("--force", is_flag=True, help="Overwrite the files if they exist.")
@page_options("Open a page with sliders instead; wishes are set there.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def design(
    *, figure: Path | None, out: Path | None, force: bool, as_json: bool, web: bool, **wishes: Any
) -> None:
    """Design a sensor: its string, its tension, and what it can tell.

    Sweeps gauge, tension and length, computes for each the Cramer-Rao bounds of position and force, drift,
    strength and clearance, and recommends one with its reasons. The bounds hold for a contact and a mount
    that are known only by their class. Nothing is simulated.

    \b
    monochord design --range 0.1 --force-resolution 0.1 --figure design.png
    monochord design --gauge 0.254e-3 --tension 40 --gap 2e-3 --out sensor.toml
    monochord design --web
    """  # noqa: D301
    page = {name: wishes.pop(name) for name in PAGE_OPTIONS}
    if web:
        refuse_without(
            "--web with wishes or files",
            "a page alone; both are there",
            *wishes,
            "figure",
            "out",
            "force",
            "as_json",
        )
        _serve(page)
        return
    refuse_without("an option of the page", "it has an effect with --web", *page)
    for path, suffixes in ((figure, SUFFIXES), (out, (".toml",))):
        if path is None:
            continue
        refuse_unwritable(path, suffixes)
        refuse_unless_forced(path, force=force)
    if figure is not None:
        require_matplotlib()
    given = {name: value for name, value in wishes.items() if value is not None}
    result = designed(**given)
    if out is not None:
        write_text(out, result.toml())
    if figure is not None:
        with replacing(figure) as part:
            draw(result).savefig(part)
    written = {name: str(path) for name, path in (("path", out), ("figure", figure)) if path is not None}
    if as_json:
        echo(json.dumps({**result.tree(), **written}))
        return
    echo(*result.lines(), *(f"written to {path}" for path in written.values()))


def _serve(page: dict[str, Any]) -> None:
    """Serve the page of the design until Control-C."""
    from monochord.page.serving import served, until_interrupted  # noqa: PLC0415  (loads a web server)

    names, browser = page["allow_host"], not page["no_browser"]
    with served([design_page()], str(page["port"]), names=names, browser=browser):
        until_interrupted()
