"""What has no end is refused before it is read, and half a file never has its name."""

import os
import resource
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.sessions.made import make

from monochord.capture.recording.label_table import read_labels
from monochord.capture.sources.wav import Wav
from monochord.cli import run
from monochord.core.config import load_json, load_toml
from monochord.core.errors import InputError
from monochord.core.files import replacing
from monochord.perception.model import load
from monochord.physics.sensors import load_sensor
from monochord.sessions import check, read_session, recover
from monochord.sessions.exports.wav_csv import read_csv


def hear(path: Path) -> None:
    with Wav(path=path, allow_truncated=True).open():
        pass


READERS: dict[str, Callable[[Path], Any]] = {
    "a.toml": load_toml,
    "a.json": load_json,
    "sensor.toml": lambda path: load_sensor(str(path)),
    "a.csv": lambda path: read_labels(path, 1.0),
    "b.csv": lambda path: read_csv(path, {}),
    "a.wav": hear,
    "a.mcap": read_session,
    "b.mcap": check,
    "c.mcap": recover,
}


@pytest.mark.parametrize("kind", ["pipe", "device"])
@pytest.mark.parametrize("name", READERS)
def test_what_has_no_end_is_refused_at_once(tmp_path: Path, name: str, kind: str) -> None:
    path = tmp_path / name
    if kind == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to("/dev/zero")
    begin, before = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(InputError) as caught:
        READERS[name](path)
    assert f"a {kind}" in caught.value.given
    assert time.process_time() - begin < 1.0  # s
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # kB


@pytest.fixture
def small_files(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let no file grow beyond 20 kB, as on a disk that is full.

    Nor is bytecode kept of what is imported meanwhile: Python 3.11 would keep its first 20 kB, and every
    later import of that module would fail.
    """
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.parametrize("form", ["wav-csv", "parquet", "foxglove"])
def test_an_export_onto_a_full_disk_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest, form: str
) -> None:
    session = tmp_path / "a.mcap"
    make(session, seconds=0.4)
    request.getfixturevalue("small_files")
    assert run(["sessions", "export", form, str(session), "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert [*tmp_path.iterdir()] == [session]


@pytest.mark.usefixtures("small_files")
def test_a_simulation_onto_a_full_disk_leaves_what_was_there(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "a.wav"
    out.write_bytes(b"before")
    assert run(["simulate", "appendix", "--out", str(out)]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert out.read_bytes() == b"before"
    assert len([*tmp_path.iterdir()]) == 1


@pytest.mark.usefixtures("small_files")
def test_a_model_onto_a_full_disk_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="File too large"):
        load("demo").save(tmp_path / "mine")
    assert not [*tmp_path.iterdir()]


def test_a_link_keeps_pointing_to_what_is_replaced(tmp_path: Path) -> None:
    target, link = tmp_path / "a.npy", tmp_path / "link.npy"
    target.touch()
    link.symlink_to(target)
    with replacing(link) as part:
        np.save(part, np.zeros(3))
    assert link.is_symlink()
    assert np.load(target).shape == (3,)
    with replacing(Path("/dev/null")) as part:
        part.write_text("away")
