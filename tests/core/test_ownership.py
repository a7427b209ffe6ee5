"""What belongs to a running process, and what one that was killed left behind."""

import errno
import logging
import os
import signal
import subprocess
import sys
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pytest

from monochord.core.errors import InputError
from monochord.core.ownership import LOCK, part_folder, scratch_folder, sole_use

HOLDER = """
import sys
from pathlib import Path
from monochord.core import ownership
with getattr(ownership, sys.argv[1])(*map(Path, sys.argv[2:])) as folder:
    if folder:
        (folder / "data").write_bytes(bytes(1000))
    print(folder, flush=True)
    sys.stdin.read()
"""


@contextmanager
def holding(name: str, *arguments: Path) -> Generator["tuple[subprocess.Popen[str], str]"]:
    """Run a process that owns a folder, and yield it with that folder; kill it at the end."""
    command = [sys.executable, "-c", HOLDER, name, *map(str, arguments)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) as process:
        assert process.stdout
        try:
            yield process, process.stdout.readline().strip()
        finally:
            process.kill()


def test_a_folder_has_one_owner_at_a_time(tmp_path: Path) -> None:
    with (
        holding("sole_use", tmp_path) as (process, _),
        pytest.raises(InputError) as refused,
        sole_use(tmp_path),
    ):
        pytest.fail("two own it")
    assert f"process {process.pid} " in refused.value.given
    assert process.returncode == -signal.SIGKILL
    assert (tmp_path / LOCK).exists()
    with sole_use(tmp_path), pytest.raises(InputError), sole_use(tmp_path):
        pass
    assert not list(tmp_path.iterdir())


def test_a_disk_without_locks_is_used_unguarded_where_that_will_do(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(number: int, kind: int) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.flock", refused)
    with pytest.raises(InputError, match="does not support locks"), sole_use(tmp_path):
        pass
    (tmp_path / LOCK).unlink()
    with sole_use(tmp_path, anywhere=True), part_folder(tmp_path / "data") as part:
        part.rename(tmp_path / "data")
    assert [path.name for path in tmp_path.iterdir()] == ["data"]


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr("tempfile.tempdir", None)
    return tmp_path


def test_a_scratch_folder_goes_at_the_next_start_once_its_process_was_killed(
    temporary: Path, caplog: pytest.LogCaptureFixture
) -> None:
    mine = temporary / "monochord-scratch-recorded"
    mine.mkdir()
    with holding("scratch_folder") as (_, folder):
        with scratch_folder() as own:
            assert {path.name for path in temporary.iterdir()} == {mine.name, own.name, Path(folder).name}
        assert not caplog.records
    assert (Path(folder) / "data").exists()
    with scratch_folder():
        pass
    assert list(temporary.iterdir()) == [mine]
    (record,) = caplog.records
    assert record.levelno == logging.WARNING
    assert folder in record.getMessage()


def test_a_part_goes_at_the_next_start_once_its_process_was_killed(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    others = [tmp_path / ".data[1].part-old", tmp_path / ".data1.part-99", tmp_path / "data[1]"]
    for other in others:
        other.mkdir()
    older = tmp_path / f".data[1].part-{os.getpid()}"  # of a process that had our number
    older.mkdir()
    with holding("part_folder", tmp_path / "data[1]") as (process, folder):
        with pytest.raises(InputError, match=f"process {process.pid} "), part_folder(tmp_path / "data[1]"):
            pytest.fail("two fill it")
        with part_folder(tmp_path / "data2") as other:
            assert {*others, other, Path(folder)} < {*tmp_path.iterdir()}
    with part_folder(tmp_path / "data[1]"):
        pass
    assert {*tmp_path.iterdir()} == {*others}
    assert folder in caplog.text


def test_a_part_that_was_renamed_stays(tmp_path: Path) -> None:
    with part_folder(tmp_path / "data") as part:
        (part / "file").touch()
        part.rename(tmp_path / "data")
    assert [path.name for path in tmp_path.iterdir()] == ["data"]
    assert [path.name for path in (tmp_path / "data").iterdir()] == ["file"]
