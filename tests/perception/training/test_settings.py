"""What is configured: strict, complete when written down, and the presets can be read."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

from monochord.core.config import dump_toml
from monochord.core.errors import InputError
from monochord.perception.training.configs import config_names, config_path
from monochord.perception.training.settings import TrainingSettings


@pytest.mark.parametrize("name", config_names())
def test_a_preset_has_the_four_heads(name: str) -> None:
    settings = TrainingSettings.read(tomllib.loads(config_path(name).read_text(encoding="utf-8")))
    assert list(settings.tasks()) == ["contact", "slip", "position", "force"]


@pytest.mark.usefixtures("made_up_features")
def test_all_of_it_is_written_down_and_read_again(lesson: dict[str, Any]) -> None:
    tree = TrainingSettings.read(lesson).resolved()
    assert tree["context"]["feature"] == {"name": "bands", "count": 4}
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
    tree = TrainingSettings.read(
        {"feature": {"name": "bands"}, "context": {"on": False}, "split": "mine.json"}
    ).resolved()
    assert (tree["dataset"], tree["split"]) == (str(tmp_path / "dataset"), str(tmp_path / "mine.json"))


@pytest.mark.parametrize(
    ("tree", "line"),
    [
        ({"sed": 1}, "option 'sed': allowed is .* did you mean 'seed'"),
        ({"seed": -1}, "seed -1: allowed is 0 or more"),
        ({"optimiser": {"rate": 0.0}}, "option 'optimiser.rate' = 0.0: allowed is a number above 0"),
        (
            {"optimiser": {"epochs": 0}},
            "option 'optimiser.epochs' = 0: allowed is a whole number of 1 or more",
        ),
        ({"noise": {"copies": -1}}, "noise.copies -1: allowed is 0 to 100"),
        (
            {"objects": {"copies": 101}},
            "option 'objects.copies' = 101: allowed is a whole number from 0 to 100",
        ),
        ({"objects": {"compliance": [2.0, 1.0]}}, "objects: compliance 2 to 1: allowed is the least first"),
        ({"context": {"drop": 1.5}}, "option 'context.drop' = 1.5: allowed is a number from 0 to 1"),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_line(tree: dict[str, Any], line: str) -> None:
    with pytest.raises(InputError, match=line):
        TrainingSettings.read(tree)


def test_an_unknown_head_is_refused_with_a_suggestion() -> None:
    with pytest.raises(InputError, match="did you mean 'position'"):
        TrainingSettings.read({"heads": {"positon": {}}}).tasks()


def test_a_feature_needs_a_name() -> None:
    with pytest.raises(InputError, match="feature without a name"):
        TrainingSettings.read({"feature": {"bands": 3}}).feature_named()


def test_the_rule_of_the_reference_is_checked() -> None:
    with pytest.raises(InputError, match="feature without a name"):
        TrainingSettings.read({"context": {"feature": {}}}).context.rule()
