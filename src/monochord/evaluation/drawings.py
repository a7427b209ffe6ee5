"""Plain drawings for the report, as SVG text: no plotting library is loaded to see a result."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from monochord.evaluation.regression import NEAR, scored
from monochord.evaluation.results import Results
from monochord.evaluation.scorecard import ErrorMap
from monochord.types import Floats

WIDTH, HEIGHT, LEFT, BELOW, ABOVE, RIGHT = 380, 300, 52, 40, 26, 12
INK, PALE = "#222222", "#bbbbbb"
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#444444", "#999933")
"""Okabe and Ito's colours, which colour-blind eyes tell apart."""
POINTS = 1500
"""Windows that a scatter shows at most, spread evenly over all."""
SHOWN: Mapping[str, tuple[float, str]] = {"position": (1e3, "mm"), "force": (1.0, "N")}
"""How a quantity is shown: factor and unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Plane:
    """A panel with its axes: from data to pixels."""

    across: tuple[float, float]
    up: tuple[float, float]
    title: str
    names: tuple[str, str]

    def x(self, value: float) -> float:
        low, high = self.across
        return LEFT + (value - low) / (high - low) * (WIDTH - LEFT - RIGHT)

    def y(self, value: float) -> float:
        low, high = self.up
        return HEIGHT - BELOW - (value - low) / (high - low) * (HEIGHT - BELOW - ABOVE)

    def drawn(self, marks: Sequence[str]) -> str:
        """Return the panel with its axes, and what it shows."""
        frame = [f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" role="img" class="drawing">']
        frame.append(f"<title>{escape(self.title)}</title>")
        frame.append(_text(WIDTH / 2, 16, self.title, size=12))
        frame += [
            _line(self, [(tick, self.up[0]), (tick, self.up[1])], PALE, 0.4) for tick in _ticks(self.across)
        ]
        frame += [
            _line(self, [(self.across[0], tick), (self.across[1], tick)], PALE, 0.4)
            for tick in _ticks(self.up)
        ]
        frame += marks
        frame += [_text(self.x(tick), HEIGHT - BELOW + 14, f"{tick:g}") for tick in _ticks(self.across)]
        frame += [_text(LEFT - 4, self.y(tick) + 3, f"{tick:g}", anchor="end") for tick in _ticks(self.up)]
        frame.append(_text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 6, self.names[0], size=11))
        beside = _text(-(HEIGHT - BELOW + ABOVE) / 2, 12, self.names[1], size=11)
        frame.append(f'<g transform="rotate(-90)">{beside}</g>')
        return "".join([*frame, "</svg>"])


def scatter(results: Results, quantity: str, title: str) -> str:
    """Return estimates of "position" or "force" over the truth as an SVG; lines mark what is near enough.

    Examples
    --------
    ``monochord evaluate --out`` writes a report that holds it.
    """
    factor, unit = SHOWN[quantity]
    part = results.where(scored(results, quantity) & np.isfinite(results.error_of(quantity)))
    chosen = np.unique(np.linspace(0, max(len(part) - 1, 0), min(POINTS, len(part))).astype(int))
    truth, told = (factor * column[chosen] for column in (part.label(quantity), part.estimate(quantity)))
    span = _span(truth)
    near = factor * NEAR[quantity]
    plane = _Plane(across=span, up=span, title=title, names=(f"true {quantity} ({unit})", f"told ({unit})"))
    low, high = span
    marks = [
        _line(plane, [(x, x + shift) for x in (max(low, low - shift), min(high, high - shift))], INK, 0.6)
        for shift in (-near, 0.0, near)
    ]
    inside = np.clip(told, *span)
    marks += [
        f'<circle cx="{plane.x(x):.1f}" cy="{plane.y(y):.1f}" r="1.6" class="point"/>'
        for x, y in zip(truth.tolist(), inside.tolist(), strict=True)
    ]
    return plane.drawn(marks)


def error_map_drawn(told: ErrorMap) -> str:
    """Return an error map as an SVG: white is none, full colour twice what is near enough; grey is unknown.

    Examples
    --------
    ``monochord evaluate --out`` writes a report that holds it.
    """
    factor, unit = SHOWN[told.quantity]
    places = [1e3 * edge for edge in told.positions]
    plane = _Plane(
        across=(places[0], places[-1]),
        up=(told.forces[0], told.forces[-1]),
        title=f"error of {told.quantity} ({unit}), {told.condition}",
        names=("true position (mm)", "true force (N)"),
    )
    marks: list[str] = []
    for row, errors in enumerate(told.error):
        for column, error in enumerate(errors):
            if not told.windows[row][column]:
                continue
            box = plane.x(places[column]), plane.y(told.forces[row + 1])
            wide = plane.x(places[column + 1]) - box[0]
            tall = plane.y(told.forces[row]) - box[1]
            share = None if error is None else min(error / (2.0 * NEAR[told.quantity]), 1.0)
            fill = 'fill="#777777"' if share is None else f'fill="{COLOURS[1]}" fill-opacity="{share:.2f}"'
            marks.append(
                f'<rect x="{box[0]:.1f}" y="{box[1]:.1f}" width="{wide:.1f}" height="{tall:.1f}" {fill}/>'
            )
            if error is not None:
                marks.append(_text(box[0] + wide / 2, box[1] + tall / 2 + 3, f"{factor * error:.2g}", size=8))
    return plane.drawn(marks)


def curves(lines: Mapping[str, Sequence[tuple[float, float]]], title: str, names: tuple[str, str]) -> str:
    """Return lines of (x, y) by name as an SVG with a key, the y axis from zero.

    Examples
    --------
    >>> curves({"hum": [(0.0, 1.0), (10.0, 0.5)]}, "errors", ("dB", "mm")).startswith("<svg")
    True
    """
    points = np.array([point for line in lines.values() for point in line] or [(0.0, 0.0)], np.float64)
    top = float(points[:, 1].max(initial=0.0)) or 1.0
    plane = _Plane(across=_span(points[:, 0]), up=(0.0, 1.05 * top), title=title, names=names)
    marks: list[str] = []
    for number, (name, line) in enumerate(lines.items()):
        colour = COLOURS[number % len(COLOURS)]
        marks.append(_line(plane, sorted(line), colour, 1.5))
        marks += [
            f'<circle cx="{plane.x(x):.1f}" cy="{plane.y(y):.1f}" r="2.5" fill="{colour}"/>' for x, y in line
        ]
        place = WIDTH - RIGHT - 4, ABOVE + 12 + 12 * number
        marks.append(_text(*place, name, anchor="end", size=10, fill=colour))
    return plane.drawn(marks)


def _span(values: Floats) -> tuple[float, float]:
    if not values.size:
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    room = 0.03 * (high - low) or 0.5
    return low - room, high + room


def _ticks(span: tuple[float, float]) -> list[float]:
    low, high = span
    rough = (high - low) / 5.0
    size = 10.0 ** np.floor(np.log10(rough))
    step = size * min((each for each in (1.0, 2.0, 5.0, 10.0) if each * size >= rough), default=10.0)
    return [round(float(tick), 10) for tick in np.arange(np.ceil(low / step), high / step + 1e-9) * step]


def _line(plane: _Plane, points: Sequence[tuple[float, float]], colour: str, wide: float) -> str:
    places = " ".join(f"{plane.x(x):.1f},{plane.y(y):.1f}" for x, y in points)
    return f'<polyline points="{places}" fill="none" stroke="{colour}" stroke-width="{wide}"/>'


def _text(x: float, y: float, text: str, *, size: int = 9, anchor: str = "middle", fill: str = INK) -> str:
    place = f'x="{x:.1f}" y="{y:.1f}" font-size="{size}" text-anchor="{anchor}" fill="{fill}"'
    return f"<text {place}>{escape(text)}</text>"
