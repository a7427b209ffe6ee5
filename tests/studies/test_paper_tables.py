"""The paper's two tables as a figure."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from studies.paper_tables import PaperTables

from monochord.core.errors import InputError


@pytest.fixture
def rows(tmp_path: Path) -> Path:
    table: list[dict[str, Any]] = [
        {
            "feature": feature,
            "object": body,
            "condition": condition,
            "position_mae_mm": position,
            "force_mae_n": force,
            "simulated": True,
        }
        for feature, position, force in (("one", 0.5, 0.1), ("two", 1.5, None))
        for body in ("plastic", "wood")
        for condition in ("clean", "music 10 dB")
    ]
    file = tmp_path / "rows.json"
    file.write_text(json.dumps(table))
    return file


def test_paper_tables_draw_our_errors_and_the_papers(rows: Path) -> None:
    position, force = PaperTables(rows=rows).draw().axes
    marks = {line.get_label(): np.asarray(line.get_ydata(), float).tolist() for line in position.lines}
    assert (marks["one"], marks["two"]) == ([0.5, 0.5], [1.5, 1.5])
    (empty,) = (line for line in force.lines if line.get_label() == "two")
    assert np.size(empty.get_ydata()) == 0
    clean, noise = (lines.get_segments() for lines in position.collections)  # type: ignore[attr-defined]
    assert [segment[0][1] for segment in clean] == pytest.approx([2.7, 8.8])
    assert [segment[0][1] for segment in noise] == pytest.approx([3.1, 8.6])
    numbers = PaperTables(rows=rows, noise="", features=("two", "one")).numbers()
    assert numbers["force"] == {
        "clean": {"two": {"plastic": None, "wood": None}, "one": {"plastic": 0.1, "wood": 0.1}}
    }


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"noise": "music 10dB"}, "music 10dB"),
        ({"features": ("three",)}, "three"),
        ({"rows": Path("none.json")}, "none.json"),
    ],
)
def test_what_cannot_be_drawn_is_refused(rows: Path, options: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        PaperTables(**dict[str, Any](rows=rows) | options).draw()
