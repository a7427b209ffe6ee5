"""`monochord audit` ends with 0 for a split that is clean and with 2 for one that leaks."""

import json
from pathlib import Path

import numpy as np
import pytest
from tests.cli.running import Capture, record

from monochord.cli import run
from monochord.core.types import Block
from monochord.datasets.build import build_dataset
from monochord.datasets.split import Split, split_dataset
from monochord.sessions import Description, SessionClock, SessionWriter


@pytest.fixture(name="dataset")
def _dataset(tmp_path: Path) -> Path:
    path = tmp_path / "take.mcap"
    noise = np.random.default_rng(0).normal(size=(2, 80000)).astype(np.float32)
    description = Description(name="take", sample_rate=8000)
    with SessionWriter(path, description, SessionClock(epoch_ns=10**18)) as writer:
        writer.audio(Block(samples=noise, start=0, adc_time=0.0))
        writer.labels(np.arange(100) / 10, {"contact": np.zeros(100)})
    dataset = build_dataset([path], tmp_path / "dataset")
    split_dataset(dataset, by="time").write(dataset.path / "split.json")
    return dataset.path


def test_a_clean_split(dataset: Path, capsys: Capture) -> None:
    assert run(["audit", str(dataset)]) == 0
    assert capsys.readouterr().out == "no leak\n"
    assert record(capsys, "audit", dataset) == {"clean": True, "leaks": [], "notes": []}


def test_a_leak(dataset: Path, tmp_path: Path, capsys: Capture) -> None:
    parts = {"train": np.arange(50), "validation": np.arange(0), "test": np.arange(49, 100)}
    Split(by="session", parts=parts).write(tmp_path / "mine.json")
    assert run(["audit", str(dataset), "--split", str(tmp_path / "mine.json")]) == 2
    captured = capsys.readouterr()
    assert len([line for line in captured.out.splitlines() if line.startswith("leak: ")]) == 2
    assert captured.err.count("\n") == 1
    assert run(["audit", str(dataset), "--split", str(tmp_path / "mine.json"), "--json"]) == 2
    leaks = json.loads(capsys.readouterr().out)["leaks"]
    assert [(leak["kind"], leak["many"]) for leak in leaks] == [("shared window", 1), ("shared session", 50)]
