"""Whatever is wrong with a run or its data: one line on stderr with status 2, and nothing is written."""

import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.cli.running import Capture, refusal

from monochord.core.types import Block
from monochord.datasets.split import Split
from monochord.datasets.store import open_dataset
from monochord.perception.features.reading import COLUMNS
from monochord.perception.model.bundled import bundled_folder
from monochord.physics.strings import load_string
from monochord.sessions import Description, SessionClock, SessionWriter

Damage = Callable[[Path], None]


def weights(change: Callable[[bytes], bytes]) -> Damage:
    def damage(folder: Path) -> None:
        file = folder / "weights.safetensors"
        file.write_bytes(change(file.read_bytes()))

    return damage


def changed_text(**values: Any) -> Damage:
    """Change what the text says, weights and their sum as they were."""

    def damage(folder: Path) -> None:
        file = folder / "model.json"
        file.write_text(json.dumps(json.loads(file.read_text(encoding="utf-8")) | values), encoding="utf-8")

    return damage


def columns(change: Callable[[list[str]], list[str]]) -> Damage:
    def damage(folder: Path) -> None:
        feature = json.loads((folder / "model.json").read_text(encoding="utf-8"))["feature"]
        changed_text(feature=feature | {"columns": change(feature["columns"])})(folder)

    return damage


def nested(folder: Path) -> None:
    (folder / "model.json").write_text("[" * 100_000, encoding="utf-8")


RUNS: dict[str, tuple[Damage, str]] = {
    "weights cut off": (weights(lambda blob: blob[:-1000]), "weights.safetensors"),
    "too many weights": (weights(lambda blob: blob + bytes(1 << 21)), "bytes"),
    "fewer columns": (columns(lambda names: names[:-1]), f"({len(COLUMNS) - 1},)"),
    "another column": (columns(lambda names: ["mic 1 own 1 hue", *names[1:]]), "'mic 1 own 1 hue'"),
    "a column that a head does not find": (columns(lambda names: ["mic hue", *names[1:]]), "'place'"),
    "another feature": (changed_text(feature={"name": "fft", "options": {}, "columns": []}), "fft"),
    "another rate": (changed_text(sample_rate=48000), "48000 Hz"),
    "huge window": (changed_text(window=1 << 50), "1125899906842624"),
    "wrong type": (changed_text(heads=[1]), "model.json.heads"),
    "nested deep": (nested, "model.json"),
    "no text": (lambda folder: (folder / "model.json").unlink(), "model.json"),
}
"""Damage that loading alone does not notice, and one of each that it does."""


@pytest.mark.parametrize(
    ("case", "command"),
    [*((case, "live") for case in RUNS), ("weights cut off", "evaluate"), ("no text", "locate")],
)
def test_a_damaged_model_is_refused(
    case: str, command: str, small: Path, tmp_path: Path, capsys: Capture
) -> None:
    damage, words = RUNS[case]
    bundled = bundled_folder("demo")
    assert bundled is not None
    shutil.copytree(bundled, tmp_path / "run" / "model")
    damage(tmp_path / "run" / "model")
    session, out = str(small / "hold_000.mcap"), tmp_path / "out"
    more = {
        "live": [session, "--sink", f"jsonl={out}"],
        "locate": [session],
        "evaluate": ["--sessions", session, "--out", str(out)],
    }
    line = refusal(capsys, *[command, str(tmp_path / "run"), *more[command]])
    assert words in line
    assert not out.exists()


@pytest.mark.parametrize("command", [["live", "--source", "session"], ["evaluate", "--sessions"]])
def test_a_session_at_a_lower_rate_is_refused_by_its_rate(
    command: list[str], tmp_path: Path, capsys: Capture
) -> None:
    rate, session, string = 32000, tmp_path / "take.mcap", load_string("prototype").string
    about = Description(name="take", sample_rate=rate, simulated=True, string=string)
    with SessionWriter(session, about, SessionClock(epoch_ns=10**18, origin=0.0)) as writer:
        writer.audio(Block(samples=np.zeros((2, rate), np.float32), start=0, adc_time=0.0))
        writer.labels(np.arange(100) / 100, {"contact": np.zeros(100)})
    line = refusal(capsys, command[0], "demo", *command[1:], session)
    assert f"{rate} Hz" in line
    assert "44100 Hz" in line


def emptied(part: str) -> Damage:
    def damage(folder: Path) -> None:
        split = Split.read(folder / "split.json")
        replace(split, parts={**split.parts, part: np.zeros(0, np.int64)}).write(folder / "split.json")

    return damage


def labelled(name: str, value: float, *, valid: bool | None = None) -> Damage:
    def damage(folder: Path) -> None:
        for kind, filled in (("labels", value), ("valid", valid)):
            file = folder / kind / f"{name}.npy"
            if filled is not None:
                np.save(file, np.full_like(np.load(file), filled))

    return damage


def both(*damages: Damage) -> Damage:
    def damage(folder: Path) -> None:
        for each in damages:
            each(folder)

    return damage


NAN = float("nan")
UNTOUCHED = both(
    labelled("contact", 0.0, valid=True),
    *(labelled(name, NAN, valid=False) for name in ("position", "force", "slip")),
)


def all_to_test(folder: Path) -> None:
    split, count = Split.read(folder / "split.json"), len(open_dataset(folder))
    none = np.zeros(0, np.int64)
    parts = {"train": none, "validation": none, "test": np.arange(count)}
    replace(split, parts=parts).write(folder / "split.json")


EVERY_LABEL = ("contact", "position", "force", "slip")
DATASETS: dict[tuple[str, str], tuple[Damage, str]] = {
    ("train", "nothing to train on"): (emptied("train"), "train"),
    ("train", "nothing to choose by"): (emptied("validation"), "validation"),
    ("train", "no position"): (labelled("position", NAN, valid=False), "'position'"),
    ("train", "NaN in labels"): (labelled("force", NAN), "'force'"),
    ("train", "infinite labels"): (labelled("position", np.inf), "'position'"),
    ("train", "no contact"): (UNTOUCHED, "'contact'"),
    ("train", "one kind of slip"): (labelled("slip", 0.0), "'slip'"),
    ("evaluate", "nothing to test"): (emptied("test"), "windows"),
    ("evaluate", "NaN in labels"): (both(all_to_test, labelled("force", NAN)), "'force'"),
    ("evaluate", "no labels"): (
        both(*(labelled(name, NAN, valid=False) for name in EVERY_LABEL)), "label",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", DATASETS, ids=" ".join)
def test_data_from_which_nothing_can_be_learned_or_told_is_refused_before_anything_is_written(
    case: tuple[str, str], small: Path, tmp_path: Path, reseal: Damage, capsys: Capture
) -> None:
    pytest.importorskip("torch")
    damage, words = DATASETS[case]
    shutil.copytree(small / "dataset", tmp_path / "dataset")
    damage(tmp_path / "dataset")
    reseal(tmp_path / "dataset")
    command = ["train", "paper"] if case[0] == "train" else ["evaluate", "demo"]
    given = ["--dataset", str(tmp_path / "dataset"), "--out", str(tmp_path / "out")]
    assert words in refusal(capsys, *command, *given)
    assert not (tmp_path / "out").exists()


def changed(name: str) -> Damage:
    """Change 200 bytes in the middle of a file."""

    def damage(folder: Path) -> None:
        data = bytearray((folder / name).read_bytes())
        middle = slice(len(data) // 2 - 100, len(data) // 2 + 100)
        data[middle] = bytes(255 - byte for byte in data[middle])
        (folder / name).write_bytes(data)

    return damage


DAMAGED: dict[str, tuple[Damage, str]] = {
    "sound": (changed("audio/0000.npy"), "audio/0000.npy"),
    "labels": (changed("labels/force.npy"), "labels/force.npy"),
    "a column lost": (lambda folder: (folder / "labels" / "force.npy").unlink(), "force.npy"),
    "split cut": (lambda folder: os.truncate(folder / "split.json", 99), "split.json"),
}


@pytest.mark.parametrize(
    ("case", "command"),
    [*((case, "audit") for case in DAMAGED), ("sound", "train"), ("sound", "evaluate"), ("labels", "train")],
)
def test_a_damaged_dataset_is_one_line_that_names_the_file(
    case: str, command: str, small: Path, tmp_path: Path, capsys: Capture
) -> None:
    pytest.importorskip("torch")
    damage, words = DAMAGED[case]
    shutil.copytree(small / "dataset", tmp_path / "dataset")
    damage(tmp_path / "dataset")
    dataset = str(tmp_path / "dataset")
    more = {
        "train": ["paper", "--dataset", dataset, "--out", str(tmp_path / "run")],
        "audit": [dataset],
        "evaluate": ["demo", "--dataset", dataset],
    }
    line = refusal(capsys, *[command, *more[command]])
    assert words in line
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("out", ["{session}", "{session}/below"])
@pytest.mark.parametrize("command", ["train", "evaluate"])
def test_a_folder_that_cannot_be_made_is_one_line(
    command: str, out: str, small: Path, capsys: Capture
) -> None:
    pytest.importorskip("torch")
    session = small / "hold_000.mcap"
    size = session.stat().st_size
    more = {"train": ["paper", "--dataset", str(small / "dataset")], "evaluate": ["--sessions", str(session)]}
    assert session.name in refusal(capsys, *[command, *more[command], "--out", out.format(session=session)])
    assert session.stat().st_size == size
