"""Drawings are SVG that an XML parser reads, with every mark inside the picture."""

import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from monochord.evaluation.drawings import HEIGHT, POINTS, WIDTH, curves, error_map_drawn, scatter
from monochord.evaluation.results import Results
from monochord.evaluation.scorecard import error_map

Oracle = Callable[..., Results]


def marks(svg: str, tag: str) -> list[ET.Element]:
    return list(ET.fromstring(svg).iter(tag))  # noqa: S314  (our own text)


def test_a_scatter_has_its_points_inside(oracle: Oracle) -> None:
    results = oracle()
    wild = replace(results, value={"position": results.label("position") + 0.05})
    points = marks(scatter(wild, "position", "wild <guesses>"), "circle")
    assert len(points) == 6 * 140 <= POINTS
    assert all(0.0 <= float(each.get("cx", "-1")) <= WIDTH for each in points)
    assert all(0.0 <= float(each.get("cy", "-1")) <= HEIGHT for each in points)


def test_an_oracles_points_lie_on_the_line(oracle: Oracle) -> None:
    points = marks(scatter(oracle(), "force", "oracle"), "circle")
    x, y = (np.array([float(each.get(name, "nan")) for each in points]) for name in ("cx", "cy"))
    assert np.corrcoef(x, y)[0, 1] == pytest.approx(-1.0, abs=1e-3)


def test_an_error_map_has_a_cell_where_something_was_touched(oracle: Oracle) -> None:
    told = error_map(oracle(spread=1.0), "position", "clean")
    cells = marks(error_map_drawn(told), "rect")
    assert len(cells) == int((np.array(told.windows) > 0).sum())
    silent = replace(told, error=tuple(tuple(None for _ in row) for row in told.error))
    assert {each.get("fill") for each in marks(error_map_drawn(silent), "rect")} == {"#777777"}


def test_nothing_to_draw_is_an_empty_panel(oracle: Oracle) -> None:
    results = oracle()
    none = results.where(np.zeros(len(results), bool))
    assert marks(scatter(none, "position", "none"), "circle") == []
    assert marks(error_map_drawn(error_map(none, "force", "clean")), "rect") == []
    assert marks(curves({}, "none", ("x", "y")), "circle") == []


def test_curves_are_named() -> None:
    svg = curves({"hum": [(10.0, 50.0), (0.0, 20.0)], "white": [(0.0, 10.0)]}, "told", ("dB", "%"))
    texts = [each.text for each in marks(svg, "text")]
    assert "hum" in texts
    assert "white" in texts
    assert len(marks(svg, "circle")) == 3
