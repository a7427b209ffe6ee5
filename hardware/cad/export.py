"""Writes parts and pictures: STEP, STL and hidden-line SVG."""

from pathlib import Path

from build123d import Color, Compound, ExportSVG, Vector, export_step, export_stl

VIEWS = {
    "iso": ((-300.0, -500.0, 350.0), (0.0, 0.0, 1.0)),
    "side": ((0.0, -1000.0, 0.0), (0.0, 0.0, 1.0)),
    "top": ((0.0, 0.0, 1000.0), (0.0, 1.0, 0.0)),
}
"""From where a picture is taken, relative to the middle of what it shows, and which way is up."""
CHORD = 0.005
"""Largest distance in mm of a mesh from its solid."""
WIDTH = 600.0
"""Of a picture, or its height, whichever is larger."""
SHORTEST = 0.1
"""Length in a picture of the shortest line that is drawn."""
TURN = 0.08
"""Largest angle in radians between neighbouring facets of a round face."""


def write_part(name: str, part: Compound, out: Path) -> tuple[Path, Path]:
    """Write NAME.step and NAME.stl into a folder and return both."""
    step, stl = out / f"{name}.step", out / f"{name}.stl"
    export_step(part, step)
    export_stl(part, stl, tolerance=CHORD, angular_tolerance=TURN)
    return step, stl


def write_assembly(bodies: dict[str, Compound], file: Path) -> None:
    """Write all bodies, named, into one STEP file."""
    for name, body in bodies.items():
        body.label = name
    export_step(Compound(label=file.stem, children=list(bodies.values())), file)


def picture(bodies: dict[str, Compound], file: Path, view: str = "iso", *, hidden: bool = False) -> None:
    """Draw bodies without the lines that others hide, or with these in grey."""
    place, up = VIEWS[view]
    scene = Compound(children=[solid for body in bodies.values() for solid in body.solids()])
    middle = scene.bounding_box().center()
    seen, unseen = scene.project_to_viewport(middle + Vector(*place), up, middle)
    size = Compound(children=seen).bounding_box().size
    scale = WIDTH / max(size.X, size.Y)
    svg = ExportSVG(scale=scale, margin=6, precision=2)
    layers = {"hidden": (unseen if hidden else [], 0.72, 0.5), "visible": (seen, 0.1, 0.8)}
    for name, (edges, grey, weight) in layers.items():
        svg.add_layer(name, line_color=Color(grey, grey, grey), line_weight=weight)
        svg.add_shape([edge for edge in edges if edge.length * scale > SHORTEST], name)
    svg.write(file)
    drawn = file.read_text(encoding="utf-8")
    file.write_text(drawn.replace("<svg ", '<svg style="background:#fff" ', 1), encoding="utf-8")
