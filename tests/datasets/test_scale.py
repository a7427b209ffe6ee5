"""What a session adds to the memory of a dataset's manifest, and that its file is as before."""

import json
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from hashlib import sha256
from pathlib import Path

import pytest

from monochord.core.config import to_tree
from monochord.core.labels import Rules
from monochord.datasets.checksums import FileSums
from monochord.datasets.manifest import TABLE, DatasetSession, Manifest, audio_name
from monochord.datasets.records import PackedFiles

FEW, MANY = 100, 500
A_SESSION = 1000
"""Bytes that a session may take while its manifest is read or written; objects of all of it take 2.3 kB."""


def manifest(count: int) -> Manifest:
    """A manifest of sessions with a window each."""
    sums = [sha256(str(number).encode()).hexdigest() for number in range(count)]
    parts = tuple(
        DatasetSession(
            name=f"take_{number}",
            source=f"take_{number}.mcap",
            checksum=sums[number],
            audio=audio_name(number),
            audio_checksum=sums[-number],
            frames=800,
            first=number,
            windows=1,
            labels="recorded",
            object="Rübe",
            late=0.1 * number,
            flags=("no taps",),
        )
        for number in range(count)
    )
    tables = [f"windows/{name}.npy" for name in TABLE]
    names = [*(part.audio for part in parts), *tables, "labels/force.npy", "valid/force.npy"]
    return Manifest(
        sample_rate=8000,
        channels=2,
        window=800,
        hop=800,
        windows=count,
        columns=("force",),
        rules=Rules(),
        labelling="what a\nlabel is",
        parts=parts,
        files={name: FileSums(bytes=6528, blocks=(sums[0][:16],)) for name in names},
    )


def taken(work: Callable[[], object]) -> int:
    """Return the most memory in bytes during a piece of work, its result included."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_a_session_takes_less_than_a_kilobyte_of_a_manifest(tmp_path: Path) -> None:
    peaks: list[int] = []
    for count in (FEW, MANY):
        home = tmp_path / str(count)
        home.mkdir()
        manifest(count).write(home)
        peaks.append(
            max(taken(partial(Manifest.read, home)), taken(partial(Manifest.read(home).write, home)))
        )
    assert peaks[1] - peaks[0] < A_SESSION * (MANY - FEW)


@pytest.mark.parametrize("count", [0, 3])
def test_the_file_is_the_one_that_json_writes(tmp_path: Path, count: int) -> None:
    made = manifest(count) if count else replace(manifest(1), parts=(), files={})
    made.write(tmp_path)
    text = json.dumps(to_tree(made), indent=1, sort_keys=True, ensure_ascii=False) + "\n"
    assert (tmp_path / "manifest.json").read_text(encoding="utf-8") == text
    if count:
        again = Manifest.read(tmp_path)
        assert again == made
        assert again.parts[-1] == made.parts[-1]
        assert again.parts[1:] == made.parts[1:]


def test_checksums_are_found_by_name_in_any_order() -> None:
    numbers = [3, 10_000, 2, 1_000, 9_999]
    sums = {audio_name(number): FileSums(bytes=number, blocks=()) for number in numbers}
    files = PackedFiles(sums.items())
    assert list(files) == sorted(sums)
    assert files == sums
    assert [files[name].bytes for name in sums] == numbers
    for name in ("", "audio/0004.npy", "z"):
        assert name not in files
