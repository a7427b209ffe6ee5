"""Whatever is wrong with a run or its data: one line on stderr with status 2, and nothing is written."""

import hashlib
import json
import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from safetensors.numpy import load as unpacked
from safetensors.numpy import save as packed

from monochord.cli import run
from monochord.core.config import from_tree, load_toml
from monochord.datasets.build import build_dataset
from monochord.datasets.split import Split, split_dataset
from monochord.datasets.store import open_dataset
from monochord.lab.offline import make
from monochord.lab.plan import Plan, assignments
from monochord.perception.model.bundled import bundled_folder

Damage = Callable[[Path], None]
PLAN = """
name = "tiny"
sensor = "prototype"
build = 1
sample_rate = {rate}
[[groups]]
name = "slide"
protocol = "slide"
grid = [2, 1]
forces = [0.3, 1.4]
hold = 0.5
strokes = 2
days = [10]
"""


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a session at 44.1 kHz and one at 48 kHz, and a dataset of the first."""
    folder = tmp_path_factory.mktemp("home")
    for rate in (44100, 48000):
        (folder / "plan.toml").write_text(PLAN.format(rate=rate), encoding="utf-8")
        plan = from_tree(Plan, load_toml(folder / "plan.toml"))
        make(assignments(plan)[0], folder).path.rename(folder / f"{rate}.mcap")
    dataset = build_dataset([folder / "44100.mcap"], folder / "dataset")
    split_dataset(dataset, by="time", fractions=(0.5, 0.25, 0.25)).write(dataset.path / "split.json")
    return folder


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


def not_numbers(folder: Path) -> None:
    file = folder / "weights.safetensors"
    arrays = {name: array.copy() for name, array in unpacked(file.read_bytes()).items()}
    arrays["force.0.bias"][:] = np.nan
    file.write_bytes(packed(arrays))
    changed_text(weights=hashlib.sha256(file.read_bytes()).hexdigest())(folder)


def of_half_precision(folder: Path) -> None:
    file = folder / "weights.safetensors"
    arrays = unpacked(file.read_bytes())
    file.write_bytes(packed(arrays | {"force.0.bias": arrays["force.0.bias"].astype(np.float16)}))
    changed_text(weights=hashlib.sha256(file.read_bytes()).hexdigest())(folder)


def nested(folder: Path) -> None:
    (folder / "model.json").write_text("[" * 100_000, encoding="utf-8")


def without(name: str) -> Damage:
    return lambda folder: (folder / name).unlink()


RUNS: dict[str, tuple[Damage, str]] = {
    "weights cut off": (weights(lambda blob: blob[:-1000]), "weights.safetensors with sha256"),
    "no bytes": (weights(lambda _: b""), "weights.safetensors with sha256"),
    "a bit flipped": (weights(lambda blob: blob[:9000] + bytes([blob[9000] ^ 1]) + blob[9001:]), "sha256"),
    "another sum": (changed_text(weights="0" * 64), "allowed is 000000000000..., as model.json says"),
    "no numbers": (not_numbers, "force.0.bias is not finite"),
    "fewer columns": (columns(lambda names: names[:-1]), "scaler.mean is float32 (392,): allowed is"),
    "another column": (
        columns(lambda names: ["mic 1 own 1 hue", *names[1:]]),
        "'mic 1 own 1 hue' where there is",
    ),
    "a column that the detector does not see": (
        columns(lambda names: ["mic hue", *names[1:]]),
        "known.0.weight is float32 (128, 316): allowed is finite float32 (128, 315)",
    ),
    "another feature": (
        changed_text(feature={"name": "fft", "options": {}, "columns": []}),
        "fft, which has none",
    ),
    "another rate": (changed_text(sample_rate=48000), "sound at 44100 Hz for a model: allowed is 48000 Hz"),
    "another format": (changed_text(format=99), "of format 99: allowed is format 2"),
    "huge window": (changed_text(window=1 << 50), "window 1125899906842624 of a model"),
    "wrong type": (changed_text(heads=[1]), "model.json.heads"),
    "nested deep": (nested, "model.json ("),
    "too many weights": (weights(lambda blob: blob + bytes(1 << 21)), "bytes at most"),
    "another dtype": (of_half_precision, "force.0.bias is float16"),
    "no heads": (changed_text(heads={}), "heads (none): allowed is one that learns the label contact"),
    "no text": (without("model.json"), "there is no model.json in it"),
    "no weights": (without("weights.safetensors"), "weights.safetensors (No such file"),
}


def one_line(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert run(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = [line for line in captured.err.splitlines() if line.startswith("monochord: ")]
    assert words in line  # beside it, a first use may say that it compiles


@pytest.mark.parametrize(
    ("case", "command"),
    [*((case, "live") for case in RUNS), ("weights cut off", "evaluate"), ("no text", "locate")],
)
def test_a_damaged_model_is_refused(
    case: str, command: str, home: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    damage, words = RUNS[case]
    bundled = bundled_folder("demo")
    assert bundled is not None
    shutil.copytree(bundled, tmp_path / "run" / "model")
    damage(tmp_path / "run" / "model")
    session, out = str(home / "44100.mcap"), tmp_path / "out"
    more = {
        "live": [session, "--sink", f"jsonl={out}"],
        "locate": [session],
        "evaluate": ["--sessions", session, "--out", str(out)],
    }
    one_line([command, str(tmp_path / "run"), *more[command]], words, capsys)
    assert not out.exists()


@pytest.mark.parametrize("command", ["live", "evaluate"])
def test_a_session_at_another_rate_is_refused_by_its_rate(
    command: str, home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    session = str(home / "48000.mcap")
    more = {"live": [session, "--source", "session"], "evaluate": ["--sessions", session]}
    words = "sound at 48000 Hz for a model: allowed is 44100 Hz, as it was trained"
    one_line([command, "demo", *more[command]], words, capsys)


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
DATASETS: dict[str, tuple[Damage, str]] = {
    "nothing to train on": (emptied("train"), "a split that leaves nothing to train"),
    "nothing to choose by": (emptied("validation"), "a split that leaves nothing to validation"),
    "no position": (
        labelled("position", NAN, valid=False),
        "part 'train' without windows for the head 'position'",
    ),
    "no force": (labelled("force", NAN, valid=False), "part 'train' without windows for the head 'force'"),
    "no slip": (labelled("slip", NAN, valid=False), "part 'train' without windows of yes and of no for the"),
    "NaN in labels": (labelled("force", NAN), "label 'force' that is no number in "),
    "infinite labels": (labelled("position", np.inf), "label 'position' that is no number in "),
    "no contact": (UNTOUCHED, "part 'train' without windows of yes and of no for the head 'contact'"),
    "one kind of slip": (labelled("slip", 0.0), "of yes and of no for the head 'slip': allowed is some of"),
}


@pytest.mark.parametrize("case", DATASETS)
def test_data_that_nothing_can_be_learned_from_is_refused_before_anything_is_written(
    case: str, home: Path, tmp_path: Path, reseal: Damage, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("torch")
    damage, words = DATASETS[case]
    shutil.copytree(home / "dataset", tmp_path / "dataset")
    damage(tmp_path / "dataset")
    reseal(tmp_path / "dataset")
    arguments = ["train", "paper", "--dataset", str(tmp_path / "dataset"), "--out", str(tmp_path / "run")]
    one_line(arguments, words, capsys)
    assert not (tmp_path / "run").exists()


def changed(name: str) -> Damage:
    """Change 200 bytes in the middle of a file."""

    def damage(folder: Path) -> None:
        data = bytearray((folder / name).read_bytes())
        middle = slice(len(data) // 2 - 100, len(data) // 2 + 100)
        data[middle] = bytes(255 - byte for byte in data[middle])
        (folder / name).write_bytes(data)

    return damage


def rewritten(name: str, **values: Any) -> Damage:
    def damage(folder: Path) -> None:
        text = json.loads((folder / name).read_text(encoding="utf-8"))
        (folder / name).write_text(json.dumps(text | values), encoding="utf-8")

    return damage


DAMAGED: dict[str, tuple[Damage, str]] = {
    "sound": (changed("audio/0000.npy"), "audio/0000.npy (damaged: bytes from"),
    "labels": (changed("labels/force.npy"), "labels/force.npy (damaged: bytes from"),
    "masks": (changed("valid/slip.npy"), "valid/slip.npy (damaged: "),
    "table": (changed("windows/start.npy"), "windows/start.npy (damaged: bytes from"),
    "a column lost": (lambda folder: (folder / "labels" / "force.npy").unlink(), "force.npy (absent or dam"),
    "an older dataset": (rewritten("manifest.json", format=1), "build the dataset again"),
    "manifest cut": (lambda folder: os.truncate(folder / "manifest.json", 999), "build the dataset again"),
    "split cut": (lambda folder: os.truncate(folder / "split.json", 99), "split.json (damaged"),
    "split of no rows": (rewritten("split.json", parts={"train": "all"}), "split.json.parts.train"),
    "split too large": (rewritten("split.json", parts={"train": [[0, 1 << 60]]}), "split.json (damaged"),
}


@pytest.mark.parametrize(
    ("case", "command"),
    [*((case, "audit") for case in DAMAGED), ("sound", "train"), ("sound", "evaluate"), ("labels", "train")],
)
def test_a_damaged_dataset_is_one_line_that_names_the_file(
    case: str, command: str, home: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("torch")
    damage, words = DAMAGED[case]
    shutil.copytree(home / "dataset", tmp_path / "dataset")
    damage(tmp_path / "dataset")
    dataset = str(tmp_path / "dataset")
    more = {
        "train": ["paper", "--dataset", dataset, "--out", str(tmp_path / "run")],
        "audit": [dataset],
        "evaluate": ["demo", "--dataset", dataset],
    }
    one_line([command, *more[command]], words, capsys)
    assert not (tmp_path / "run").exists()


def all_to_test(folder: Path) -> None:
    split, count = Split.read(folder / "split.json"), len(open_dataset(folder))
    none = np.zeros(0, np.int64)
    parts = {"train": none, "validation": none, "test": np.arange(count)}
    replace(split, parts=parts).write(folder / "split.json")


EVERY_LABEL = ("contact", "position", "force", "slip")
UNTESTED: dict[str, tuple[Damage, str]] = {
    "nothing to test": (emptied("test"), "no windows to evaluate"),
    "NaN in labels": (both(all_to_test, labelled("force", NAN)), "label 'force' that is no number in "),
    "no labels": (both(*(labelled(name, NAN, valid=False) for name in EVERY_LABEL)), "without a known label"),
}


@pytest.mark.parametrize("case", UNTESTED)
def test_data_that_cannot_test_is_refused(
    case: str, home: Path, tmp_path: Path, reseal: Damage, capsys: pytest.CaptureFixture[str]
) -> None:
    damage, words = UNTESTED[case]
    shutil.copytree(home / "dataset", tmp_path / "dataset")
    damage(tmp_path / "dataset")
    reseal(tmp_path / "dataset")
    one_line(["evaluate", "demo", "--dataset", str(tmp_path / "dataset")], words, capsys)


@pytest.mark.parametrize("out", ["{session}", "{session}/below"])
@pytest.mark.parametrize("command", ["train", "evaluate"])
def test_a_folder_that_cannot_be_made_is_one_line(
    command: str, out: str, home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("torch")
    session = home / "44100.mcap"
    size = session.stat().st_size
    more = {"train": ["paper", "--dataset", str(home / "dataset")], "evaluate": ["--sessions", str(session)]}
    one_line([command, *more[command], "--out", out.format(session=session)], "44100.mcap", capsys)
    assert session.stat().st_size == size
