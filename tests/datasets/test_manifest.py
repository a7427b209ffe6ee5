"""A manifest is read as it was written, and anything else is refused."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest

from monochord.core.errors import InputError
from monochord.datasets.manifest import FILE, Manifest, file_checksum
from monochord.datasets.store import Dataset


def test_what_is_written_is_read(several: Dataset, tmp_path: Path) -> None:
    several.manifest.write(tmp_path)
    assert Manifest.read(tmp_path) == several.manifest
    assert (tmp_path / FILE).read_bytes() == (several.path / FILE).read_bytes()


def test_it_tells_what_a_reader_needs_without_monochord(several: Dataset) -> None:
    manifest = json.loads((several.path / FILE).read_text())
    assert manifest["rules"] == {
        "touched": 0.9,
        "untouched": 0.1,
        "sliding": 0.5,
        "still": 0.1,
        "known": 0.9,
        "hold": 0.2,
    }
    assert "**contact** is 1 if" in manifest["labelling"]
    assert manifest["versions"]["monochord"]
    assert {part["labels"] for part in manifest["parts"]} == {"recorded"}
    assert str(several.path.parent) not in (several.path / FILE).read_text()


def test_it_tells_whether_there_was_music_and_an_older_one_does_not(
    make: Callable[..., Dataset], tmp_path: Path
) -> None:
    sessions = {"a": {"more": {"music": "synthetic"}}, "b": {"more": {"music": ""}}, "c": {}}
    dataset = make(sessions)
    assert [part.music for part in dataset.manifest.parts] == ["synthetic", "", None]
    dataset.manifest.write(tmp_path)
    assert Manifest.read(tmp_path) == dataset.manifest


def test_checksums_are_those_of_the_session_files(several: Dataset) -> None:
    for part in several.manifest.parts:
        assert part.checksum == file_checksum(several.path.parent / "sessions" / part.source)
    assert len({part.audio_checksum for part in several.manifest.parts}) == 10


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("{", "damaged"),
        ("[]", "another format"),
        ('{"format": 99}', "another format"),
        ('{"format": 1}', "another format.*build the dataset again"),
        ('{"format": 2}', "not given"),
    ],
)
def test_something_else_is_refused(tmp_path: Path, text: str, line: str) -> None:
    (tmp_path / FILE).write_text(text)
    with pytest.raises(InputError, match=line):
        Manifest.read(tmp_path)


def test_a_folder_without_one_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="a folder that monochord build made"):
        Manifest.read(tmp_path)
