"""TensorBoard reads the curves back, whole and once, also after a run was cut off."""

import sys
import time
from pathlib import Path
from typing import Any

import pytest

from monochord.core.errors import InputError
from monochord.perception.training.run_folder import board
from monochord.perception.training.settings import TrainingSettings
from monochord.perception.training.train import train

pytest.importorskip("torch")
HISTORY = [{"epoch": number, "loss": 1.0 / number, "force": 0.5 / number} for number in range(1, 6)]


def read(folder: Path) -> dict[str, list[tuple[int, float]]]:
    """Return steps and values by curve, as TensorBoard itself reads them."""
    events = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    accumulator = events.EventAccumulator(str(folder))
    accumulator.Reload()
    return {
        tag: [(one.step, one.value) for one in accumulator.Scalars(tag)]
        for tag in accumulator.Tags()["scalars"]
    }


def curve(name: str, epochs: int) -> list[Any]:
    return [(line["epoch"], pytest.approx(line[name])) for line in HISTORY[:epochs]]


def test_each_epoch_can_be_read_as_soon_as_it_was_shown(tmp_path: Path) -> None:
    pytest.importorskip("tensorboard")
    with board(tmp_path / "board") as show:
        for epochs in (1, 2, 2, 5):
            show([dict(line) for line in HISTORY[:epochs]])
            curves = read(tmp_path / "board")
            assert curves == {
                "training/loss": curve("loss", epochs),
                "validation/force": curve("force", epochs),
            }


def test_a_run_that_goes_on_has_whole_curves_also_for_who_is_looking_on(tmp_path: Path) -> None:
    events = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    looking = events.EventAccumulator(str(tmp_path))
    for epochs in (2, 5):
        with board(tmp_path) as show:
            for shown in range(epochs - 1, epochs + 1):
                show(HISTORY[:shown])
        looking.Reload()
        seen = [(one.step, one.value) for one in looking.Scalars("training/loss")]
        assert seen == curve("loss", epochs) == read(tmp_path)["training/loss"]
        time.sleep(1.1)  # files are read in the order of their names, which tell the second


@pytest.mark.usefixtures("made_up_features")
def test_a_run_has_its_history_on_the_board_also_when_asked_for_it_later(
    lesson: dict[str, Any], tmp_path: Path
) -> None:
    pytest.importorskip("tensorboard")
    short = {**lesson, "methods": ["network"], "optimiser": {"epochs": 2, "batch": 64}}
    train(TrainingSettings.read(short), tmp_path)
    assert not (tmp_path / "board").exists()
    for again in range(2):
        time.sleep(1.1 * again)
        train(TrainingSettings.read({**short, "board": True}), tmp_path)
        curves = read(tmp_path / "board")
        assert {name: len(points) for name, points in curves.items()} == {
            "training/loss": 2,
            **{f"validation/{head}": 2 for head in ("contact", "slip", "position", "force")},
        }


@pytest.mark.usefixtures("made_up_features")
def test_without_the_package_it_is_refused_before_anything_is_written(
    lesson: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delitem(sys.modules, "torch.utils.tensorboard", raising=False)
    monkeypatch.setitem(sys.modules, "tensorboard", None)
    own = {**lesson, "board": True, "cache": str(tmp_path / "features")}
    with pytest.raises(InputError, match="pip install tensorboard"):
        train(TrainingSettings.read(own), tmp_path / "run")
    assert not list(tmp_path.iterdir())
