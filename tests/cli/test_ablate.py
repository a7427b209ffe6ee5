"""`monochord ablate` trains, evaluates and compares, and goes on where it was."""

import json
from pathlib import Path

import pytest

from monochord.cli import run

GRID = """
title = "What the reference buys"
config = "paper"
dataset = "{home}/dataset"
set = ["feature.name=log_mel", "context.on=false", "optimiser.epochs={epochs}"]

[variations.smaller]
set = ["heads.force.hidden=[8, 8, 8]"]
"""


@pytest.mark.slow
def test_variations_are_trained_judged_and_compared(
    small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("torch")
    grid, out = tmp_path / "grid.toml", tmp_path / "out"
    grid.write_text(GRID.format(home=small, epochs=2))
    assert run(["ablate", str(grid), "--out", str(out), "--workers", "2"]) == 0
    printed = capsys.readouterr()
    assert "What the reference buys, simulated, on validation" in printed.out
    assert [line.split()[0].strip(",") for line in printed.out.splitlines()[2::3]] == ["whole", "smaller"]
    assert "whole: training" in printed.err
    assert (out / "smaller" / "report" / "report.html").is_file()
    rows = tmp_path / "rows.json"
    assert run(["ablate", str(grid), "--out", str(out), "--rows", str(rows), "--json"]) == 0
    again = capsys.readouterr()
    assert "training" not in again.err
    assert [row["variation"] for row in json.loads(again.out)["rows"] if not row["baseline"]] == [
        "whole",
        "smaller",
    ]
    labels = {(row["feature"], row["part"], row["simulated"]) for row in json.loads(rows.read_text())}
    assert labels >= {("log_mel", "validation", True), ("log_mel, smaller", "validation", True)}
    assert run(["ablate", str(grid), "--out", str(out), "--part", "test", "--noise", "white:0"]) == 0
    tested = capsys.readouterr()
    assert "training" not in tested.err
    assert "smaller: evaluation" in tested.err
    assert "on test" in tested.out
    grid.write_text(GRID.format(home=small, epochs=3))
    assert run(["ablate", str(grid), "--out", str(out)]) == 2
    assert "a variation of another grid" in capsys.readouterr().err


@pytest.mark.slow
def test_one_that_fails_ends_with_a_line_and_status_1(
    small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    dataset, rows_file = str(small / "dataset"), tmp_path / "rows.json"
    arguments = ["--dataset", dataset, "--out", str(tmp_path), "--rows", str(rows_file), "--workers", "1"]
    arguments += ["--only", "closed_form", "--only", "no_noise"]
    odd = [
        "--set",
        "variations.no_noise.set=['cache=/dev/null/none']",
        "--set",
        "set=['feature.name=log_mel']",
    ]
    physics = "variations.closed_form={estimator='closed_form', estimator_set=['tension_law=geometric']}"
    assert run(["ablate", "parts", *arguments, *odd, "--set", physics]) == 1
    printed = capsys.readouterr()
    assert [line.split()[0] for line in printed.out.splitlines()[2:3]] == ["closed_form"]
    assert printed.err.splitlines()[-1].startswith(
        "monochord: 1 of 2 variations failed (no_noise); variation no_noise, train: "
    )
    assert "/dev/null/none" in printed.err
    rows = json.loads(rows_file.read_text())
    assert {row["feature"].partition(",")[0] for row in rows} == {"closed_form"}
