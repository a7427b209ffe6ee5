"""Windows of a dataset, heard as a stream would be."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.types import Signal
from monochord.datasets.store import open_dataset
from monochord.perception.model import load
from monochord.perception.training.replay import replay, window_of
from monochord.perception.training.settings import Settings
from monochord.perception.training.train import train

pytest.importorskip("torch")
pytestmark = pytest.mark.usefixtures("made_up_features")


def test_a_session_is_heard_alone(lesson: dict[str, Any], tmp_path: Path) -> None:
    train(Settings.read({**lesson, "optimiser": {"epochs": 2}}), tmp_path / "run")
    dataset = open_dataset(Path(lesson["dataset"]))
    prepared = load(tmp_path / "run").prepare(Signal(sample_rate=16000, channels=2))
    rows = np.arange(len(dataset))
    both = dict(replay(prepared, dataset, rows[dataset.session < 2]))
    alone = dict(replay(prepared, dataset, rows[dataset.session == 1]))
    assert {row: both[row] for row in alone} == alone
    assert len(both) == (dataset.session < 2).sum()


def test_a_window_is_as_a_source_gives_it(learnable: Path) -> None:
    dataset = open_dataset(learnable)
    window = window_of(dataset, 7)
    assert (window.start, window.sample_rate, window.has_gap) == (11200, 16000, False)
    assert window.samples.flags.owndata
    np.testing.assert_array_equal(window.samples, dataset.window(7))
