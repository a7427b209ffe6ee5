"""`monochord evaluate` prints a table of what an estimator is worth, and refuses tests that prove nothing."""

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.capture.sources.session import SessionSource
from monochord.cli import run
from monochord.core.types import Estimates
from monochord.datasets.build import build_dataset
from monochord.datasets.split import Split, split_dataset
from monochord.datasets.store import open_dataset
from monochord.evaluation.results import read_results
from monochord.lab.bench import make
from monochord.lab.plan import assignments
from monochord.lab.plans import load_plan
from monochord.live import Session as LiveSession
from monochord.live import run as live
from monochord.live.settings import WindowSettings
from monochord.live.sinks.base import Listener, Moment
from monochord.perception.estimators.model import ModelEstimator
from monochord.perception.training.settings import Settings
from monochord.perception.training.train import train

PHYSICS = ("--set", "tension_law=geometric")


@pytest.fixture(name="home", scope="module")
def _home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with two sessions of the twin, and their dataset, split by time."""
    home = tmp_path_factory.mktemp("home")
    sessions = [make(session, home).path for session in assignments(load_plan("small"))]
    split_dataset(build_dataset(sessions, home / "dataset"), by="time").write(home / "dataset" / "split.json")
    return home


def test_sessions_are_tested_whole(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["evaluate", "--sessions", str(home / "hold_000.mcap"), *PHYSICS]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("closed_form, simulated: ")
    assert lines[0].endswith(" windows of 1 sessions")
    assert lines[1].split()[:4] == ["object", "condition", "windows", "told"]
    told = lines[2].split()
    assert told[:2] == ["plastic", "clean"]
    assert float(told[5]) < 1.0  # mm


def test_the_test_part_of_a_dataset_in_quiet_and_in_noise(
    home: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, rows = tmp_path / "out", tmp_path / "rows.json"
    asked = ["--dataset", str(home / "dataset"), "--sensor", "prototype", "--noise", "white:-20"]
    assert run(["evaluate", *asked, *PHYSICS, "--out", str(out), "--rows", str(rows), "--json"]) == 0
    card = json.loads(capsys.readouterr().out)
    split = Split.read(home / "dataset" / "split.json")
    assert card["windows"] == 2 * len(split.test)
    assert card["simulated"]
    by = {row["condition"]: row["position"] for row in card["table"] if row["state"] == "touched"}
    assert by["clean"]["answered"] > 0.3
    assert by["clean"]["mae"]["value"] < 1e-3
    assert by["white -20 dB"]["answered"] == 0.0
    assert len(read_results(out / "results.npz")) == card["windows"]
    drawn = re.findall('<img class="drawing" alt="([^"]*)"', (out / "report.html").read_text())
    assert drawn == ["scatter, clean", "error map, clean", "confusion, clean"]
    assert [row["condition"] for row in json.loads(rows.read_text())] == ["clean", "white -20 dB"]
    assert "## Force, white -20 dB" in rows.with_suffix(".md").read_text()


def test_the_validation_part_is_no_test(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["--dataset", str(home / "dataset"), "--sensor", "prototype", "--part", "validation"]
    assert run(["evaluate", *asked, *PHYSICS]) == 0
    assert "note: the validation part, by which choices were made" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        ([], "no sessions to test on"),
        (["nowhere"], "model nowhere"),
        (["--dataset", "nowhere"], "dataset"),
        (["--dataset", "DATASET", "--sessions", "x"], "--sessions beside --dataset"),
        (["--dataset", "DATASET", "--split", "nowhere.json"], "nowhere.json (No such file"),
        (["--dataset", "DATASET", "--noise", "pimk:3"], "did you mean 'pink'"),
        (["--dataset", "DATASET", "--estimator", "closed_from"], "did you mean 'closed_form'"),
        (["--dataset", "DATASET", "--sensor", "prototipe"], "did you mean 'prototype'"),
        (["--dataset", "DATASET", "--set", "sides=both"], "an unknown string"),
        (["--sessions", "nowhere.mcap"], "sessions 'nowhere.mcap'"),
    ],
)
def test_what_cannot_be_is_one_line(
    home: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], line: str
) -> None:
    named = [str(home / "dataset") if word == "DATASET" else word for word in arguments]
    assert run(["evaluate", *named]) == 2
    told = capsys.readouterr().err
    assert line in told
    assert told.count("\n") == 1


def test_a_split_without_a_test_and_one_of_another_dataset(
    home: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    split = Split.read(home / "dataset" / "split.json")
    Split(by="time", parts={**split.parts, "test": np.zeros(0, np.int64)}).write(tmp_path / "empty.json")
    Split(by="time", parts=split.parts, dataset="another").write(tmp_path / "other.json")
    asked = ["evaluate", "--dataset", str(home / "dataset"), "--sensor", "prototype"]
    assert run([*asked, "--split", str(tmp_path / "empty.json")]) == 2
    assert "no windows to evaluate" in capsys.readouterr().err
    assert run([*asked, "--split", str(tmp_path / "other.json")]) == 2
    assert "other dataset" in capsys.readouterr().err


def learned(lesson: dict[str, Any], out: Path) -> Path:
    """Train a small run, or skip where there is nothing to train with."""
    pytest.importorskip("torch")
    train(Settings.read(lesson), out)
    return out


class Heard(Listener):
    """Keeps what was estimated live."""

    def __init__(self) -> None:
        self.told: list[Estimates] = []

    def write(self, moment: Moment) -> None:
        self.told.append(moment.prediction.estimates)


def assert_live_says_the_same(folder: Path, learnable: Path, file: Path) -> None:
    """Assert that a session's results are those that the live loop gives of it, to the bit."""
    results, heard = read_results(file), Heard()
    name = results.trials[0].session
    source = SessionSource(path=learnable.parent / f"{name}.mcap", block=700)
    window = WindowSettings(length=results.window, hop=results.hop)
    live(LiveSession(source=source, estimator=ModelEstimator(path=folder), sinks=(heard,), window=window))
    part = results.where(results.trial == 0)
    assert len(heard.told) == len(part)
    for estimate in ("contact", "slip", "position", "force"):
        np.testing.assert_array_equal(part.estimate(estimate), [told[estimate].value for told in heard.told])
        np.testing.assert_array_equal(part.std[estimate], [told[estimate].std for told in heard.told])


@pytest.mark.usefixtures("made_up_features")
def test_a_run_is_tested_on_what_it_has_not_heard(
    lesson: dict[str, Any], learnable: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = learned(lesson, tmp_path / "run")
    assert run(["evaluate", str(folder), "--out", str(tmp_path / "out"), "--json"]) == 0
    card = json.loads(capsys.readouterr().out)
    split = Split.read(learnable / "split.json")
    assert card["windows"] == len(split.test)
    assert card["estimator"] == "model"
    assert card["options"]["feature"]["name"] == card["options"]["reference"] == "bands"
    assert card["notes"] == []
    (told,) = [row for row in card["table"] if row["state"] == "touched"]
    assert told["position"]["r"]["value"] > 0.9
    assert_live_says_the_same(folder, learnable, tmp_path / "out" / "results.npz")
    assert run(["evaluate", str(folder), "--part", "validation"]) == 0
    assert "and no test" in capsys.readouterr().out
    heard, unheard = (
        open_dataset(learnable).manifest.parts[open_dataset(learnable).session[part[0]]].name
        for part in (split.train, split.test)
    )
    assert run(["evaluate", str(folder), "--sessions", str(learnable.parent / f"{unheard}.mcap")]) == 0
    shutil.copy(learnable.parent / f"{heard}.mcap", tmp_path / "monday.mcap")
    capsys.readouterr()
    assert run(["evaluate", str(folder), "--sessions", str(tmp_path / "monday.mcap")]) == 2
    assert "a test on session monday, which it was trained on" in capsys.readouterr().err
    assert run(["evaluate", str(folder), "--estimator", "closed_form"]) == 2
    assert "one of both" in capsys.readouterr().err


@pytest.mark.usefixtures("made_up_features")
def test_what_is_learned_of_shuffled_labels_is_chance(
    lesson: dict[str, Any],
    learnable: Path,
    tmp_path: Path,
    reseal: Callable[[Path], None],
    capsys: pytest.CaptureFixture[str],
) -> None:
    found: dict[str, list[float]] = {"position": [], "force": []}
    for seed in range(4):  # a few touches agree with anything once in a while
        home = tmp_path / str(seed)
        shuffled = home / "dataset"
        shutil.copytree(learnable, shuffled)
        split, stream = Split.read(shuffled / "split.json"), np.random.default_rng(seed)
        for name in found:
            labels = np.load(shuffled / "labels" / f"{name}.npy")
            for rows in (split.train, split.validation):
                known = rows[np.isfinite(labels[rows])]
                labels[known] = stream.permutation(labels[known])
            np.save(shuffled / "labels" / f"{name}.npy", labels)
        reseal(shuffled)
        folder = learned({**lesson, "dataset": str(shuffled), "cache": str(tmp_path / "own")}, home / "run")
        assert run(["evaluate", str(folder), "--json"]) == 0
        card = json.loads(capsys.readouterr().out)
        (told,) = [row for row in card["table"] if row["state"] == "touched"]
        for name, held in found.items():
            held.append(told[name]["r"].get("value") or 0.0)
    for held in found.values():
        assert abs(float(np.mean(held))) < 0.3, held
