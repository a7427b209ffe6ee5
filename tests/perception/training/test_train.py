"""A run from sessions to a model: it beats the mean label by far, and its folder is complete."""

import csv
import json
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from tests.perception.windows import window_of

from monochord.core.config import dump_toml
from monochord.core.errors import InputError
from monochord.datasets.split import Split
from monochord.datasets.store import open_dataset
from monochord.perception.model import ModelState, load
from monochord.perception.model.definition import Method
from monochord.perception.training.settings import METHODS, TrainingSettings
from monochord.perception.training.train import read_in_turn, train

pytest.importorskip("torch")
pytestmark = pytest.mark.usefixtures("made_up_features")


def test_it_beats_the_mean_label_by_far_on_sessions_not_trained_on(lesson_run: Path, learnable: Path) -> None:
    dataset = open_dataset(learnable)
    test = Split.read(dataset.path / "split.json").test
    model, state = load(lesson_run), ModelState()
    errors, right = dict[str, list[float]](), list[bool]()
    for row in test.tolist():
        state, estimates = model.step(state, window_of(dataset, row))
        contact = dataset.label("contact")[row]
        if np.isfinite(contact):
            right.append((estimates["contact"].value >= 0.5) == (contact == 1.0))
        for name in ("position", "force"):
            if contact == 1.0 and estimates[name].valid:
                errors.setdefault(name, []).append(estimates[name].value - float(dataset.label(name)[row]))
    assert np.mean(right) > 0.98
    for name, share in (("position", 0.35), ("force", 0.6)):
        label = dataset.label(name)[test]
        by_mean = np.nanmean(np.abs(label - model.definition.heads[name].offset))
        assert np.mean(np.abs(errors[name])) < share * by_mean, name
        assert len(errors[name]) > 0.9 * np.isfinite(label).sum()
    scores = json.loads((lesson_run / "metrics.json").read_text())
    assert scores["heads"]["slip"]["auc"] > 0.9


def test_its_folder_is_complete_and_each_head_says_its_method_and_why(
    lesson: dict[str, Any], tmp_path: Path
) -> None:
    out = tmp_path / "run"
    result = train(TrainingSettings.read({**lesson, "optimiser": {"epochs": 3, "batch": 64}}), out)
    assert sorted(each.name for each in out.iterdir()) == [
        "checkpoint.safetensors",
        "config.toml",
        "history.csv",
        "metrics.json",
        "model",
    ]
    metrics = json.loads((out / "metrics.json").read_text())
    assert metrics["simulated"] is True
    assert set(metrics["heads"]) == {"contact", "slip", "position", "force"}
    assert "coverage_1" in metrics["calibration"]["force"]["measured"]
    with (out / "history.csv").open() as file:
        assert [line["epoch"] for line in csv.DictReader(file)] == ["1", "2", "3"]
    definition = load(out).definition
    assert definition == result.model.definition
    for name, record in definition.heads.items():
        choice, stored = result.choices[name], metrics["methods"][name]
        assert set(choice.errors) == set(get_args(Method)) == set(METHODS)
        assert record.method == choice.method == stored["method"]
        assert choice.errors[choice.method] <= min(choice.errors.values()) / 0.95
        assert stored["errors"] == choice.errors
        assert (record.nodes > 0) == (choice.method == "extra_trees")
    assert result.model.definition.heads["force"].calibration.sessions == 2


def test_equal_settings_give_equal_bytes(lesson: dict[str, Any], tmp_path: Path) -> None:
    short = {**lesson, "optimiser": {"epochs": 2, "batch": 64}, "noise": {"copies": 1}}
    train(TrainingSettings.read(short), tmp_path / "one")
    again = tmp_path / "elsewhere"
    train(TrainingSettings.read({**short, "cache": str(again)}), tmp_path / "two")
    for name in ("model/weights.safetensors", "model/model.json", "metrics.json", "history.csv"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes(), name


@pytest.mark.slow
def test_shuffled_labels_teach_nothing(
    lesson: dict[str, Any], tmp_path: Path, reseal: Callable[[Path], None]
) -> None:
    folder = tmp_path / "shuffled"
    shutil.copytree(lesson["dataset"], folder)
    rng, valid = np.random.default_rng(0), np.load(folder / "valid" / "position.npy")
    for name in ("position", "force"):
        label = np.load(folder / "labels" / f"{name}.npy")
        label[valid] = rng.permutation(label[valid])
        np.save(folder / "labels" / name, label)
    reseal(folder)
    scores = train(TrainingSettings.read({**lesson, "dataset": str(folder)}), tmp_path / "run").scores
    for name in ("position", "force"):
        assert scores[name]["mae"] > 0.93 * scores[name]["baseline_mae"]
        assert abs(scores[name]["r"]) < 0.2


def test_a_refusal_leaves_nothing_behind(lesson: dict[str, Any], tmp_path: Path) -> None:
    split = tmp_path / "split.json"
    split.write_text(json.dumps({"by": "session", "parts": {"train": [[0, 100]], "validation": []}}))
    with pytest.raises(InputError, match="validation"):
        train(TrainingSettings.read({**lesson, "split": str(split)}), tmp_path / "run")
    assert not (tmp_path / "run").exists()


KILLED = """
import sys
from pathlib import Path
from monochord.perception import features
features.__path__.append(sys.argv[1])
from monochord.core.config import load_toml
from monochord.perception.training.settings import TrainingSettings
from monochord.perception.training.train import train
train(TrainingSettings.read(load_toml(Path(sys.argv[2]))), Path(sys.argv[3]))
"""


def test_a_session_is_a_stream_of_its_own(lesson_run: Path, learnable: Path) -> None:
    dataset, model = open_dataset(learnable), load(lesson_run)
    rows = np.arange(len(dataset))
    both = read_in_turn(model, dataset, rows[dataset.session < 2]).outputs
    alone = read_in_turn(model, dataset, rows[dataset.session == 1]).outputs
    assert {row: both[row] for row in alone} == alone
    assert len(both) == (dataset.session < 2).sum()


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_a_run_that_is_killed_ends_as_one_that_is_not(lesson: dict[str, Any], tmp_path: Path) -> None:
    config = tmp_path / "config.toml"
    config.write_text(dump_toml({**lesson, "optimiser": {"epochs": 24, "batch": 16, "patience": 24}}))
    made_up = Path(__file__).parents[2] / "made_up_features"

    def begin(out: str) -> "subprocess.Popen[bytes]":
        return subprocess.Popen([sys.executable, "-c", KILLED, made_up, config, tmp_path / out])

    with begin("whole") as run:
        assert run.wait() == 0
    for epoch in (2, 9):
        with begin("cut") as run:
            while run.poll() is None and lines(tmp_path / "cut" / "history.csv") <= epoch:
                time.sleep(0.01)
            run.kill()
        assert run.returncode == -signal.SIGKILL, "it was quicker than the kill"
    with begin("cut") as run:
        assert run.wait() == 0
    for name in ("model/weights.safetensors", "model/model.json", "metrics.json", "history.csv"):
        assert (tmp_path / "cut" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes(), name
    assert not list((tmp_path / "cut").glob(".*"))


def lines(file: Path) -> int:
    return len(file.read_text().splitlines()) if file.is_file() else 0
