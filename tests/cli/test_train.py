"""`monochord train`, and `monochord live` with its model."""

import json
import os
from pathlib import Path
from typing import Any

import pytest
from tests.cli.running import Capture, record, refusal
from tests.conftest import LESSON

from monochord.cli import run
from monochord.core.config import dump_toml
from monochord.core.ownership import LOCK, sole_use
from monochord.perception import features

pytest.importorskip("torch")
pytestmark = pytest.mark.usefixtures("made_up_features")
MADE_UP = Path(__file__).parents[1] / "made_up_features"


@pytest.fixture
def config(lesson: dict[str, Any], tmp_path: Path) -> Path:
    file = tmp_path / "lesson.toml"
    file.write_text(dump_toml({**lesson, "optimiser": {"epochs": 3}}), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def trained(learnable: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of three epochs, to be read alone."""
    home = tmp_path_factory.mktemp("trained")
    lesson = {**LESSON, "dataset": str(learnable), "cache": str(learnable.parent / "features")}
    (home / "lesson.toml").write_text(dump_toml({**lesson, "optimiser": {"epochs": 3}}), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(features, "__path__", [*features.__path__, str(MADE_UP)])
        assert run(["train", str(home / "lesson.toml"), "--out", str(home / "run")]) == 0
    return home / "run"


def test_it_prints_scores_and_goes_on_where_it_was(config: Path, tmp_path: Path, capsys: Capture) -> None:
    out = str(tmp_path / "run")
    printed = record(capsys, "train", config, "--out", out, "--set", "optimiser.epochs=2")
    assert (printed["epochs"], printed["simulated"], printed["part"]) == (2, True, "validation")
    assert run(["train", str(config), "--out", out, "--set", "optimiser.epochs=2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{out}, simulated")
    heads = ["contact", "slip", "position", "force"]
    assert [line.split()[0] for line in lines] == [lines[0].split()[0], "the", *heads, "on", *heads]
    for name, line in zip(heads, lines[2:6], strict=True):
        choice = printed["methods"][name]
        assert line.split()[1] in choice["method"]
        assert set(choice["errors"]) == {"network", "ridge", "extra_trees"}


@pytest.mark.slow
def test_it_draws_how_it_learned_and_equal_runs_have_equal_pictures(
    config: Path, tmp_path: Path, capsys: Capture
) -> None:
    pictures: list[bytes] = []
    for out in (tmp_path / "one", tmp_path / "two", tmp_path / "two"):
        if (history := out / "history.csv").is_file():  # as a kill right after a checkpoint leaves it
            history.write_text("".join(history.read_text().splitlines(keepends=True)[:-1]))
        assert run(["train", str(config), "--out", str(out)]) == 0
        pictures.append((out / "learning.svg").read_bytes())
    assert pictures[0].lstrip().startswith(b"<?xml")
    assert pictures[0] == pictures[1] == pictures[2]
    capsys.readouterr()
    out = tmp_path / "one"
    given = ["figure", "learning", "--set", f"run={out}", "--out", str(tmp_path / "a.png")]
    numbers = record(capsys, *given)["numbers"]
    metrics = json.loads((out / "metrics.json").read_text())
    assert (numbers["simulated"], numbers["epochs"]) == (True, [1, 2, 3])
    assert {name: head["best_epoch"] for name, head in numbers["heads"].items()} == metrics["best_epochs"]


def test_other_settings_in_its_folder_and_options_beside_a_run_are_refused(
    config: Path, trained: Path, capsys: Capture
) -> None:
    assert str(trained) in refusal(capsys, "train", config, "--out", trained, "--set", "seed=1")
    for extra in (["--length", "0.2"], ["--estimator", "closed-form"]):
        assert extra[0].strip("-") in refusal(capsys, "live", trained, "--source", "twin", *extra)


def test_live_takes_a_run_for_its_estimator(trained: Path, learnable: Path, capsys: Capture) -> None:
    out, session = str(trained), str(learnable.parent / "sung_0.mcap")
    assert run(["live", out, session, "--source", "session", "--seconds", "3", "--json"]) == 0
    first = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert {"contact", "slip", "position", "force"} <= first.keys() | first.get("estimates", {}).keys()
    assert run(["live", session, "--source", "session", out, "--seconds", "2", "--sink", "terminal"]) == 0
    assert "truth" in capsys.readouterr().out


def test_a_second_run_in_its_folder_is_refused_and_a_killed_one_does_not_block(
    config: Path, tmp_path: Path, capsys: Capture
) -> None:
    out = tmp_path / "run"
    words = ("train", config, "--out", out, "--set", 'methods=["ridge"]')
    out.mkdir()
    assert run([*map(str, words)]) == 0
    with sole_use(out):
        line = refusal(capsys, *words)
        assert f"(process {os.getpid()} is writing to it)" in line
    (out / LOCK).write_text("1\n")  # as a kill leaves it
    assert run([*map(str, words)]) == 0
    assert not (out / LOCK).exists()
