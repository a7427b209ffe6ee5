"""`monochord evaluate --suite hardware` tests a model where its sensor is not as it was trained."""

import json
from pathlib import Path

import pytest

from monochord.cli import run
from monochord.evaluation.results import read_results

CONDITION = "tuning +4 %"


@pytest.mark.slow
def test_a_model_follows_another_pitch_as_if_it_were_tuned(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, rows, cache = tmp_path / "out", tmp_path / "rows.json", tmp_path / "cache"
    command = ["evaluate", "demo", "--suite", "hardware", "--quick", "--workers", "1", "--cache", str(cache)]
    assert run([*command, "--only", CONDITION, "--out", str(out), "--rows", str(rows), "--json"]) == 0
    tree = json.loads(capsys.readouterr().out)
    assert tree["sensor"] == "prototype"
    conditions = ("clean", CONDITION, f"{CONDITION}, tuned")
    assert [(row["condition"], row["model"]) for row in tree["rows"]] == [
        (condition, model) for condition in conditions for model in ("demo", "closed_form")
    ]
    clean, detuned, tuned = (row for row in tree["rows"] if row["model"] == "demo")
    assert clean["answered"] > 0.95
    assert clean["position_mae_mm"] < 1.0
    for row in (detuned, tuned):
        assert row["answered"] > 0.8
        assert row["position_mae_mm"] < 1.0
    assert clean["n"] == detuned["n"] == tuned["n"]
    assert read_results(out / "results.npz").trials[-1].condition == conditions[-1]
    assert json.loads((out / "hardware.json").read_text()) == json.loads(rows.read_text()) == tree["rows"]
    assert (out / "hardware.svg").read_text().count("tuned") >= 1
    assert len((out / "hardware.csv").read_text().splitlines()) == 1 + len(tree["rows"])
    stamps = {file: file.stat().st_mtime_ns for file in cache.rglob("*.mcap")}
    assert run([*command, "--only", "clean"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[:2] for line in lines[2:]] == [["clean", "demo"], ["clean", "closed"]]
    assert {file: file.stat().st_mtime_ns for file in cache.rglob("*.mcap")} == stamps
