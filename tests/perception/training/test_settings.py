"""What is configured: strict, complete when written down, and the presets can be read."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

from monochord.core.config import dump_toml
from monochord.core.errors import InputError
from monochord.core.presets import preset_names
from monochord.perception.training import configs
from monochord.perception.training.configs import config_path
from monochord.perception.training.settings import TrainingSettings


@pytest.mark.parametrize("name", preset_names(configs.__name__))
def test_a_preset_has_the_four_heads(name: str) -> None:
    settings = TrainingSettings.read(tomllib.loads(config_path(name).read_text(encoding="utf-8")))
    assert list(settings.tasks()) == ["contact", "slip", "position", "force"]


@pytest.mark.usefixtures("made_up_features")
def test_all_of_it_is_written_down_and_read_again(lesson: dict[str, Any]) -> None:
    tree = TrainingSettings.read(lesson).resolved()
    assert tree["heads"]["position"]["loss"] == "laplace"
    assert TrainingSettings.read(tomllib.loads(dump_toml(tree))).resolved() == tree


@pytest.mark.usefixtures("made_up_features")
def test_a_board_makes_no_other_run(lesson: dict[str, Any]) -> None:
    assert (
        TrainingSettings.read({**lesson, "board": True}).resolved()
        == TrainingSettings.read(lesson).resolved()
    )


@pytest.mark.usefixtures("made_up_features")
def test_relative_paths_are_written_in_full(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    tree = TrainingSettings.read({"feature": {"name": "bands"}, "split": "mine.json"}).resolved()
    assert (tree["dataset"], tree["split"]) == (str(tmp_path / "dataset"), str(tmp_path / "mine.json"))


@pytest.mark.parametrize(
    ("tree", "named"),
    [
        ({"sed": 1}, r"'sed'.*'seed'"),
        ({"seed": -1}, "seed -1"),
        ({"optimiser": {"rate": 0.0}}, "optimiser"),
        ({"noise": {"copies": -1}}, "noise"),
        ({"objects": {"compliance": [2.0, 1.0]}}, "objects"),
        ({"heads": {"positon": {}}}, "'position'"),
        ({"feature": {"bands": 3}}, "feature"),
    ],
)
def test_what_makes_no_sense_is_refused(tree: dict[str, Any], named: str) -> None:
    with pytest.raises(InputError, match=named):  # noqa: PT012
        settings = TrainingSettings.read(tree)
        settings.tasks()
        settings.feature_named()
