"""`monochord evaluate` prints a table of scores, and refuses tests that prove nothing."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.cli.running import Capture, record, refusal

from monochord.cli import run
from monochord.datasets.split import Split
from monochord.datasets.store import open_dataset
from monochord.evaluation.results import read_results
from monochord.figures import base
from monochord.perception.training.settings import TrainingSettings
from monochord.perception.training.train import train

PHYSICS = ("--set", "tension_law=geometric")


def test_sessions_are_evaluated_whole(small: Path, capsys: Capture) -> None:
    assert run(["evaluate", "--sessions", str(small / "hold_000.mcap"), *PHYSICS]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("closed_form, simulated: ")
    cells = lines[2].split()
    assert cells[:3] == ["plastic", "clean", "closed"]
    assert float(cells[cells.index("mm") - 1]) < 1.0


def test_without_matplotlib_the_report_has_no_figures_and_a_note_says_how_to_have_them(
    small: Path, tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(base, "find_spec", lambda _: None)
    out = tmp_path / "out"
    given = ["--dataset", str(small / "dataset"), "--sensor", "prototype", "--no-baselines", *PHYSICS]
    assert run(["evaluate", *given, "--out", str(out)]) == 0
    captured = capsys.readouterr()
    assert captured.err.rstrip().endswith("pip install 'matplotlib>=3.9'")
    assert captured.out.splitlines()[-1].endswith(str(out / "report.html"))
    assert 'class="drawing"' not in (out / "report.html").read_text()


def test_a_dataset_is_evaluated_clean_and_in_noise_beside_baselines(
    small: Path, tmp_path: Path, capsys: Capture
) -> None:
    out, rows = tmp_path / "out", tmp_path / "rows.json"
    options = ["--dataset", str(small / "dataset"), "--sensor", "prototype", "--noise", "white:-20"]
    card = record(capsys, "evaluate", *options, *PHYSICS, "--out", out, "--rows", rows)
    split = Split.read(small / "dataset" / "split.json")
    assert card["windows"] == 2 * len(split.test)
    assert card["simulated"]
    by = {row["condition"]: row["position"] for row in card["table"] if row["state"] == "touched"}
    assert by["clean"]["answered"] > 0.3
    assert by["clean"]["mae"]["value"] < 1e-3
    assert by["white -20 dB"]["answered"] == 0.0
    assert len(read_results(out / "results.npz")) == card["windows"]
    assert (out / "report.html").read_text().count('<img class="drawing"') == 3
    assert list(card["baselines"]) == ["ridge", "extra_trees"]
    kept = [(row["feature"], row["condition"]) for row in json.loads(rows.read_text())]
    features = ("closed_form", "closed_form, extra trees", "closed_form, ridge")
    assert kept == [(feature, noise) for feature in features for noise in ("clean", "white -20 dB")]
    assert rows.with_suffix(".md").is_file()


def test_an_empty_test_and_a_split_of_another_dataset_are_refused(
    small: Path, tmp_path: Path, capsys: Capture
) -> None:
    split = Split.read(small / "dataset" / "split.json")
    Split(by="time", parts={**split.parts, "test": np.zeros(0, np.int64)}).write(tmp_path / "empty.json")
    Split(by="time", parts=split.parts, dataset="another").write(tmp_path / "other.json")
    command = ["evaluate", "--dataset", str(small / "dataset"), "--sensor", "prototype"]
    assert "windows" in refusal(capsys, *command, "--split", tmp_path / "empty.json")
    assert "dataset" in refusal(capsys, *command, "--split", tmp_path / "other.json")


@pytest.mark.slow
def test_a_run_is_evaluated_on_sessions_that_it_was_not_trained_on(
    lesson_run: Path, learnable: Path, tmp_path: Path, capsys: Capture
) -> None:
    folder = lesson_run
    card = record(capsys, "evaluate", folder, "--out", tmp_path / "out")
    split = Split.read(learnable / "split.json")
    assert card["windows"] == len(split.test)
    assert card["estimator"] == "model"
    assert card["options"]["feature"]["name"] == "bands"
    assert card["notes"] == []
    (row,) = [row for row in card["table"] if row["state"] == "touched"]
    assert row["position"]["r"]["value"] > 0.9
    assert run(["evaluate", str(folder), "--no-baselines", "--part", "validation"]) == 0
    trained_on, other = (
        open_dataset(learnable).manifest.parts[int(open_dataset(learnable).session[part[0]])].name
        for part in (split.train, split.test)
    )
    session = str(learnable.parent / f"{other}.mcap")
    assert run(["evaluate", str(folder), "--no-baselines", "--sessions", session]) == 0
    shutil.copy(learnable.parent / f"{trained_on}.mcap", tmp_path / "monday.mcap")
    assert "monday" in refusal(capsys, "evaluate", folder, "--sessions", tmp_path / "monday.mcap")
    assert "--estimator" in refusal(capsys, "evaluate", folder, "--estimator", "closed_form")


@pytest.mark.slow
@pytest.mark.usefixtures("made_up_features")
def test_a_model_of_shuffled_labels_is_at_chance(
    lesson: dict[str, Any],
    learnable: Path,
    tmp_path: Path,
    reseal: Callable[[Path], None],
    capsys: Capture,
) -> None:
    pytest.importorskip("torch")
    correlations: dict[str, list[float]] = {"position": [], "force": []}
    short = {**lesson, "optimiser": {**lesson["optimiser"], "batch": 256, "epochs": 15}}
    for seed in range(4):  # a few touches agree with anything once in a while
        shuffled, folder = tmp_path / f"{seed}" / "dataset", tmp_path / f"{seed}" / "run"
        shutil.copytree(learnable, shuffled)
        split, stream = Split.read(shuffled / "split.json"), np.random.default_rng(seed)
        for name in correlations:
            labels = np.load(shuffled / "labels" / f"{name}.npy")
            for rows in (split.train, split.validation):
                known = rows[np.isfinite(labels[rows])]
                labels[known] = stream.permutation(labels[known])
            np.save(shuffled / "labels" / f"{name}.npy", labels)
        reseal(shuffled)
        settings = {**short, "dataset": str(shuffled), "cache": str(tmp_path / "own")}
        train(TrainingSettings.read(settings), folder)
        card = record(capsys, "evaluate", folder, "--no-baselines")
        (row,) = [row for row in card["table"] if row["state"] == "touched"]
        for name, values in correlations.items():
            values.append(row[name]["r"].get("value") or 0.0)
    for values in correlations.values():
        assert abs(float(np.mean(values))) < 0.3, values
