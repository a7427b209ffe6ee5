"""`monochord ablate` trains, evaluates and compares, and goes on where it was."""

import json
from pathlib import Path

import pytest

from monochord.cli import run
from monochord.datasets.build import build_dataset
from monochord.datasets.split import split_dataset
from monochord.lab.bench import make
from monochord.lab.plan import assignments
from monochord.lab.plans import load_plan

GRID = """
title = "What the reference buys"
config = "small"
dataset = "{home}/dataset"
set = ["feature.name=log_mel", "context.on=false", "optimiser.epochs={epochs}"]

[variations.smaller]
set = ["heads.force.hidden=[8, 8, 8]"]
"""


@pytest.mark.slow
def test_variations_are_trained_judged_and_compared(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("torch")
    sessions = [make(session, tmp_path).path for session in assignments(load_plan("small"))]
    dataset = build_dataset(sessions, tmp_path / "dataset")
    split_dataset(dataset, by="time").write(dataset.path / "split.json")
    grid, out = tmp_path / "grid.toml", tmp_path / "out"
    grid.write_text(GRID.format(home=tmp_path, epochs=2))
    assert run(["ablate", str(grid), "--out", str(out)]) == 0
    told = capsys.readouterr()
    assert "What the reference buys, simulated, on validation" in told.out
    assert [line.split()[0] for line in told.out.splitlines()[2:]] == ["whole", "smaller"]
    assert "whole: training" in told.err
    assert (out / "smaller" / "report" / "report.html").is_file()
    assert run(["ablate", str(grid), "--out", str(out), "--json"]) == 0
    again = capsys.readouterr()
    assert "training" not in again.err
    assert [row["variation"] for row in json.loads(again.out)["rows"]] == ["whole", "smaller"]
    grid.write_text(GRID.format(home=tmp_path, epochs=3))
    assert run(["ablate", str(grid), "--out", str(out)]) == 2
    assert "a variation of another grid" in capsys.readouterr().err


def test_no_grid_is_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["ablate", str(tmp_path / "none.toml")]) == 2
    assert "none.toml" in capsys.readouterr().err
