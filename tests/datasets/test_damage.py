"""Nothing but what was built is taken for a dataset, and a forged one takes no memory."""

import json
import os
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.datasets.conftest import Make

from monochord.core.errors import InputError
from monochord.datasets.audit import audit
from monochord.datasets.split import Split, split_dataset
from monochord.datasets.store import Dataset, open_dataset, session_rows

LITTLE = 16 << 20
"""Bytes that a refusal may take."""


def flip(file: Path, at: int = -300, count: int = 200) -> None:
    data = bytearray(file.read_bytes())
    stop = len(data) + at + count if at < 0 else at + count
    data[at:stop] = bytes(255 - byte for byte in data[at:stop])
    file.write_bytes(data)


def refused(work: Callable[[], object], words: str) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(InputError) as caught:
            work()
        assert tracemalloc.get_traced_memory()[1] < LITTLE
    finally:
        tracemalloc.stop()
    assert words in str(caught.value)


def test_damage_in_any_file_is_detected_on_opening(own: Dataset) -> None:
    files = list(own.path.glob("*/*.npy"))
    assert len(files) == 2 + 5 + 2 * len(own.manifest.columns)
    for file in files:
        whole = file.read_bytes()
        flip(file, at=-1, count=1)
        refused(lambda: open_dataset(own.path), f"{file} (damaged")
        file.write_bytes(whole)
    assert len(open_dataset(own.path)) == len(own)


@pytest.mark.parametrize(
    "files", ['[""]', '["ab"]', "[[]]", "[3]", '[{"bytes": 2}]', "3", '{"a": 3}', '{"a": []}']
)
def test_checksums_in_another_form_are_one_line(own: Dataset, files: str) -> None:
    file = own.path / "manifest.json"
    tree = json.loads(file.read_text())
    file.write_text(json.dumps({**tree, "files": "FILES"}).replace('"FILES"', files))
    refused(lambda: open_dataset(own.path), "manifest.json")


def test_of_much_sound_a_draw_is_looked_at_and_the_audit_looks_at_all(make: Make) -> None:
    sound = 0.1 * np.random.default_rng(0).normal(size=(2, 1_200_000)).astype(np.float32)
    dataset = make({"long": {"samples": sound}}, hop=1.0)
    split = split_dataset(dataset, by="time")
    assert len(dataset.manifest.files["audio/0000.npy"].blocks) == 10
    flip(dataset.path / "audio" / "0000.npy", at=5_000_000)
    failures = 0
    for seed in range(20):
        try:
            open_dataset(dataset.path, sampled=3, seed=seed)
        except InputError:
            failures += 1
    assert 1 <= failures <= 13, "three of ten blocks are looked at"
    refused(lambda: open_dataset(dataset.path), "bytes from 4194304 on")
    opened = open_dataset(dataset.path, sampled=0)
    refused(opened.verify, "bytes from 4194304 on")
    refused(lambda: audit(opened, split, duplicates=False), "build the dataset again")


@pytest.mark.parametrize("name", ["audio/0000.npy", "labels/force.npy"])
def test_a_file_of_another_size_or_kind_is_not_read(own: Dataset, name: str) -> None:
    file = own.path / name
    whole = file.read_bytes()

    class Trap:
        def __reduce__(self) -> tuple[Any, ...]:
            return os.mkdir, (str(own.path / "unpickled"),)

    def cut() -> None:
        file.write_bytes(whole[:-1])

    def longer() -> None:
        file.write_bytes(whole + b"\0")

    def huge() -> None:
        file.write_bytes(whole.replace(b"'shape': (", b"'shape': (9", 1)[: len(whole)])

    def pickled() -> None:
        np.save(file, np.array([Trap()], dtype=object), allow_pickle=True)

    def folder() -> None:
        file.unlink()
        file.mkdir()

    for damage in (cut, longer, huge, pickled, folder):
        damage()
        refused(lambda: open_dataset(own.path), f"{file} (damaged")
    assert not (own.path / "unpickled").exists()


def part(**values: Any) -> Callable[[dict[str, Any]], None]:
    return lambda tree: tree["parts"][1].update(values)


def whole(**values: Any) -> Callable[[dict[str, Any]], None]:
    return lambda tree: tree.update(values)


def without_sums(tree: dict[str, Any]) -> None:
    del tree["files"]["audio/0001.npy"]


FORGED: dict[str, tuple[Callable[[dict[str, Any]], None], str]] = {
    "a path that leaves the folder": (part(audio="../../x"), "parts[1].audio '../../x'"),
    "an absolute path": (part(audio="/etc/passwd"), "parts[1].audio '/etc/passwd'"),
    "a label that leaves the folder": (whole(columns=["../../x"]), "columns '../../x'"),
    "huge windows": (whole(windows=1 << 60), "windows"),
    "many windows": (part(windows=1 << 40), "windows"),
    "fewer than none": (part(windows=-4), "parts[1] of -4 windows"),
    "huge frames": (part(frames=1 << 50), "audio/0001.npy (damaged"),
    "huge channels": (whole(channels=1 << 40), "channels"),
    "no rate": (whole(sample_rate=0), "sample_rate 0"),
    "no hop": (whole(hop=0), "hop 0"),
    "a window longer than its sound": (whole(window=1 << 20), "windows outside of their sessions"),
    "a name for a number": (whole(windows="many"), "manifest.json.windows"),
    "a number for parts": (whole(parts=3), "manifest.json.parts"),
    "not a number": (part(late=float("nan")), "manifest.json.parts[1].late"),
    "fewer checksums": (without_sums, "checksums that do not match"),
    "no checksums": (whole(files={}), "checksums that do not match"),
    "a checksum of a number": (whole(files={"audio/0000.npy": 3}), "manifest.json.files"),
}


@pytest.mark.parametrize("case", FORGED)
def test_a_manifest_that_cannot_be_true_is_refused(case: str, own: Dataset) -> None:
    change, words = FORGED[case]
    file = own.path / "manifest.json"
    tree = json.loads(file.read_text())
    change(tree)
    file.write_text(json.dumps(tree))
    refused(lambda: open_dataset(own.path), words)


@pytest.mark.parametrize("text", ["[" * 100_000, '{"format":' + '{"a":' * 900, "\ud800", "9" * 5000, "{"])
def test_text_that_is_no_manifest_is_refused(own: Dataset, text: str) -> None:
    (own.path / "manifest.json").write_bytes(text.encode("utf-8", "surrogatepass"))
    refused(lambda: open_dataset(own.path), "manifest.json (damaged")


@pytest.mark.parametrize("text", ["[]", '{"format": 99}', '{"format": 1}', '{"format": 2}'])
def test_a_manifest_of_another_format_is_refused(own: Dataset, text: str) -> None:
    (own.path / "manifest.json").write_text(text)
    refused(lambda: open_dataset(own.path), "manifest.json" if "2" in text else str(own.path))


def test_text_without_end_is_not_read_whole(own: Dataset) -> None:
    os.truncate(own.path / "manifest.json", 1 << 40)
    with pytest.raises(InputError, match="more than"):
        open_dataset(own.path)


def test_windows_outside_of_the_sound_are_refused(own: Dataset, reseal: Callable[[Path], None]) -> None:
    start = np.load(own.path / "windows" / "start.npy")
    for value in (-1, 1 << 40):
        np.save(own.path / "windows" / "start.npy", np.where(np.arange(len(start)) == 7, value, start))
        reseal(own.path)
        refused(lambda: open_dataset(own.path), "windows outside of their sessions")


def test_a_label_whose_name_leaves_the_folder_is_not_built(make: Make, tmp_path: Path) -> None:
    labels = {"contact": np.zeros(1200), "../../../stray": np.zeros(1200)}
    with pytest.raises(InputError, match="label"):
        make({"one": {"labels": labels}})
    assert not list(tmp_path.parent.glob("stray*"))
    with pytest.raises(InputError, match="label"):
        session_rows({"start": np.zeros(3, np.int64)}, {"a/b": np.zeros(3)})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"by": 7}, "split.json.by"),
        ({"seed": "often"}, "split.json.seed"),
        ({"fractions": ["much"]}, "split.json.fractions"),
        ({"parts": [1]}, "split.json.parts"),
        ({"parts": {"train": [[0, 1 << 50]]}}, "split.json (damaged"),
        ({"parts": {"train": [[0, 1 << 24]] * 9}}, "split.json (damaged"),
        ({"parts": {"train": [[-3, 5]]}}, "split.json (damaged"),
        ({"parts": {"train": [[5, 3]]}}, "split.json (damaged"),
        ({"parts": {"train": [[0.5, 3]]}}, "split.json.parts"),
        ({"groups": {"train": 3}}, "split.json.groups"),
    ],
)
def test_a_split_that_cannot_be_is_refused(
    several: Dataset, tmp_path: Path, change: dict[str, Any], words: str
) -> None:
    file = tmp_path / "split.json"
    split_dataset(several).write(file)
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    refused(lambda: Split.read(file), words)
