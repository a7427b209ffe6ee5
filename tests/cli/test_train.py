"""`monochord train`, and `monochord live` with its model."""

import json
from pathlib import Path
from typing import Any

import pytest
from tests.conftest import LESSON

from monochord.cli import run
from monochord.core.config import dump_toml
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


def test_it_prints_scores_and_goes_on_where_it_was(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "run")
    assert run(["train", str(config), "--out", out, "--set", "optimiser.epochs=2", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert (printed["epochs"], printed["simulated"], printed["part"]) == (2, True, "validation")
    assert run(["train", str(config), "--out", out, "--set", "optimiser.epochs=2"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"{out}, simulated: feature bands beside the reference bands, 2 epochs"
    assert [line.split()[0] for line in lines[2:]] == ["contact", "slip", "position", "force"]
    assert "the mean label" in lines[4]


@pytest.mark.slow
def test_it_draws_how_it_learned_and_equal_runs_have_equal_pictures(
    config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
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
    given = ["figure", "learning", "--set", f"run={out}", "--out", str(tmp_path / "a.png"), "--json"]
    assert run(given) == 0
    numbers = json.loads(capsys.readouterr().out)["numbers"]
    metrics = json.loads((out / "metrics.json").read_text())
    assert (numbers["simulated"], numbers["epochs"]) == (True, [1, 2, 3])
    assert {name: head["best_epoch"] for name, head in numbers["heads"].items()} == metrics["best_epochs"]
    assert run(["figure", "learning", "--set", f"run={tmp_path}", "--out", str(tmp_path / "b.png")]) == 2
    error = capsys.readouterr().err
    assert "no config.toml in it" in error
    assert error.count("\n") == 1


def test_other_settings_in_the_same_folder_are_refused(
    config: Path, trained: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["train", str(config), "--out", str(trained), "--set", "seed=1"]) == 2
    assert "a run with other settings" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["papr"], "or FILE.toml; did you mean 'paper'?"),
        (["no_such.toml"], "configuration no_such.toml (No such file or directory)"),
        (["CONFIG", "--dataset", "nowhere"], "dataset /"),
        (["CONFIG", "--set", "heads.contact.hiden=3"], "did you mean 'hidden'?"),
        (["CONFIG", "--set", "feature.name=band"], "did you mean 'bands'?"),
        (["CONFIG", "--set", "sensor=protoype"], "did you mean 'prototype'?"),
    ],
)
def test_what_cannot_be_is_one_line(
    arguments: list[str], line: str, config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = [str(config) if word == "CONFIG" else word for word in arguments]
    assert run(["train", *given, "--out", str(tmp_path / "run")]) == 2
    error = capsys.readouterr().err
    assert line in error
    assert error.count("\n") == 1
    assert not (tmp_path / "run").exists()


def test_live_takes_a_run_for_its_estimator(
    trained: Path, learnable: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, session = str(trained), str(learnable.parent / "sung_0.mcap")
    assert run(["live", out, session, "--source", "session", "--seconds", "3", "--json"]) == 0
    first = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert {"contact", "slip", "position", "force"} <= first.keys() | first.get("estimates", {}).keys()
    assert run(["live", session, "--source", "session", out, "--seconds", "2", "--sink", "terminal"]) == 0
    assert "truth" in capsys.readouterr().out


@pytest.mark.parametrize("extra", [["--length", "0.2"], ["--estimator", "closed-form"]])
def test_options_of_another_estimator_are_refused_beside_a_run(
    trained: Path, capsys: pytest.CaptureFixture[str], extra: list[str]
) -> None:
    assert run(["live", str(trained), "--source", "twin", *extra]) == 2
    assert capsys.readouterr().err.count("\n") == 1
