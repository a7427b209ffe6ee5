"""The folder of a run belongs to one run."""

import json
from pathlib import Path

import pytest

from monochord.core.errors import InputError
from monochord.perception.training.run_folder import claim, write_history, write_metrics


def test_the_same_run_may_come_again(tmp_path: Path) -> None:
    claim(tmp_path / "a" / "run", {"seed": 0})
    claim(tmp_path / "a" / "run", {"seed": 0})
    assert (tmp_path / "a" / "run" / "config.toml").read_text() == "seed = 0\n"


def test_another_run_may_not(tmp_path: Path) -> None:
    claim(tmp_path / "run", {"seed": 0})
    with pytest.raises(InputError, match="a run with other settings: allowed is a new folder"):
        claim(tmp_path / "run", {"seed": 1})


def test_what_is_no_run_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("...")
    with pytest.raises(InputError, match="something else: allowed is a new folder"):
        claim(tmp_path, {"seed": 0})
    with pytest.raises(InputError, match="something else"):
        claim(tmp_path / "thesis.tex", {"seed": 0})


def test_history_is_a_table(tmp_path: Path) -> None:
    write_history(tmp_path, [{"epoch": 1, "loss": 0.5}, {"epoch": 2, "loss": 0.25}])
    assert (tmp_path / "history.csv").read_text() == "epoch,loss\n1,0.5\n2,0.25\n"


def test_metrics_are_json(tmp_path: Path) -> None:
    write_metrics(tmp_path, {"epochs": 3})
    assert json.loads((tmp_path / "metrics.json").read_text()) == {"epochs": 3}
