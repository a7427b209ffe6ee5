"""Marks stand at the errors of the file, and the paper's lines at the paper's."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.figures.paper_tables import PaperTables


@pytest.fixture
def rows(tmp_path: Path) -> Path:
    told: list[dict[str, Any]] = [
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
    file.write_text(json.dumps(told))
    return file


def test_marks_are_the_errors(rows: Path) -> None:
    position, force = PaperTables(rows=rows).draw().axes
    held = {line.get_label(): np.asarray(line.get_ydata(), float).tolist() for line in position.lines}
    assert held["one"] == [0.5, 0.5]
    assert held["two"] == [1.5, 1.5]
    (empty,) = (line for line in force.lines if line.get_label() == "two")
    assert np.size(empty.get_ydata()) == 0


def test_the_papers_lines_are_the_papers(rows: Path) -> None:
    position = PaperTables(rows=rows).draw().axes[0]
    clean, noise = (held.get_segments() for held in position.collections)  # type: ignore[attr-defined]
    assert [segment[0][1] for segment in clean] == pytest.approx([2.7, 8.8])
    assert [segment[0][1] for segment in noise] == pytest.approx([3.1, 8.6])


def test_it_tells_its_numbers(rows: Path) -> None:
    told = PaperTables(rows=rows, noise="").numbers()
    assert told["force"] == {
        "clean": {"one": {"plastic": 0.1, "wood": 0.1}, "two": {"plastic": None, "wood": None}}
    }


def test_another_noise_is_refused(rows: Path) -> None:
    with pytest.raises(InputError, match="did you mean"):
        PaperTables(rows=rows, noise="music 10dB").draw()


def test_a_file_of_something_else_is_refused(tmp_path: Path) -> None:
    (tmp_path / "rows.json").write_text("[1]")
    with pytest.raises(InputError, match="absent or damaged"):
        PaperTables(rows=tmp_path / "rows.json").draw()


def test_features_are_those_that_were_asked_for(rows: Path) -> None:
    position = PaperTables(rows=rows, features=("two",)).draw().axes[0]
    assert {line.get_label() for line in position.lines if not str(line.get_label()).startswith("_")} == {
        "two"
    }
    with pytest.raises(InputError, match="feature 'three'"):
        PaperTables(rows=rows, features=("three",)).numbers()
