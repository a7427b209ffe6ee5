"""Circuit symbols as SVG: what two schematics need. Coordinates in SVG units, y down."""

from pathlib import Path

Point = tuple[float, float]
STYLE = (
    "<style>line,polyline,path,rect,circle{fill:none;stroke:#222;stroke-width:1.6}"
    ".dot{fill:#222}text{font:13px sans-serif;fill:#222}.note{font-size:12px;fill:#666}</style>"
)


class Drawing:
    """Collects symbols; `write` makes the file."""

    def __init__(self, title: str, width: int, height: int) -> None:
        self.size, self.parts = (width, height), list[str]()
        self.text((20, 26), title)
        self.text(
            (20, height - 12), "Never built or simulated as a circuit. Values: see wiring.md.", note=True
        )

    def line(self, *points: Point) -> None:
        """Draw a wire."""
        self.parts.append(f'<polyline points="{" ".join(f"{x:g},{y:g}" for x, y in points)}"/>')

    def dot(self, x: float, y: float) -> None:
        """Draw a joint of wires."""
        self.parts.append(f'<circle class="dot" cx="{x:g}" cy="{y:g}" r="2.6"/>')

    def text(self, at: Point, text: str, *, note: bool = False) -> None:
        """Write a line of text from a point to the right."""
        style = ' class="note"' if note else ""
        self.parts.append(f'<text{style} x="{at[0]:g}" y="{at[1]:g}">{text}</text>')

    def box(self, x: float, y: float, width: float, height: float) -> None:
        """Draw a rectangle."""
        self.parts.append(f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}"/>')

    def resistor(self, x: float, y: float, label: str, *, down: bool = False) -> None:
        """Draw a resistor of length 60 from a point, to the right or down."""
        if down:
            self.line((x, y), (x, y + 12))
            self.box(x - 7, y + 12, 14, 36)
            self.line((x, y + 48), (x, y + 60))
            self.text((x + 13, y + 35), label)
            return
        self.line((x, y), (x + 12, y))
        self.box(x + 12, y - 7, 36, 14)
        self.line((x + 48, y), (x + 60, y))
        self.text((x + 2, y - 13), label)

    def capacitor(self, x: float, y: float, label: str, *, down: bool = False) -> None:
        """Draw a capacitor of length 60 from a point, to the right or down."""
        if down:
            self.line((x, y), (x, y + 26))
            self.line((x - 12, y + 26), (x + 12, y + 26))
            self.line((x - 12, y + 34), (x + 12, y + 34))
            self.line((x, y + 34), (x, y + 60))
            self.text((x + 16, y + 35), label)
            return
        self.line((x, y), (x + 26, y))
        self.line((x + 26, y - 12), (x + 26, y + 12))
        self.line((x + 34, y - 12), (x + 34, y + 12))
        self.line((x + 34, y), (x + 60, y))
        self.text((x + 2, y - 17), label)

    def ground(self, x: float, y: float) -> None:
        """Draw a ground below a point."""
        for half, low in ((12, 0), (8, 5), (4, 10)):
            self.line((x - half, y + low), (x + half, y + low))

    def diode_up(self, x: float, y: float) -> None:
        """Draw a diode of length 40 from a point down, which conducts upwards."""
        self.line((x, y), (x, y + 40))
        self.line((x - 9, y + 27), (x + 9, y + 27), (x, y + 13), (x - 9, y + 27))
        self.line((x - 9, y + 13), (x + 9, y + 13))

    def jfet(self, x: float, y: float) -> None:
        """Draw an N-channel JFET: gate at the point, drain 30 above and source 30 below at x + 30."""
        self.line((x, y), (x + 18, y))
        self.line((x + 10, y - 5), (x + 18, y), (x + 10, y + 5))
        self.line((x + 18, y - 18), (x + 18, y + 18))
        self.line((x + 18, y - 12), (x + 30, y - 12), (x + 30, y - 30))
        self.line((x + 18, y + 12), (x + 30, y + 12), (x + 30, y + 30))

    def coil(self, x: float, y: float, label: str) -> None:
        """Draw a coil of length 60 from a point down."""
        arcs = "".join("a7.5,7.5 0 0 1 0,15" for _ in range(4))
        self.parts.append(f'<path d="M{x:g},{y:g}{arcs}"/>')
        self.line((x + 13, y), (x + 13, y + 60))
        self.text((x + 22, y + 35), label)

    def write(self, file: Path) -> None:
        """Write the drawing."""
        width, height = self.size
        head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}">'
        paper = f'<path d="M0,0h{width}v{height}h-{width}z" style="fill:#fff;stroke:none"/>'
        file.write_text("\n".join([head, STYLE, paper, *self.parts, "</svg>"]) + "\n", encoding="utf-8")
