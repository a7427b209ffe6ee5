"""Each command on a disk that is full: one line that names the file or folder being written, status 2."""

import errno
from collections.abc import Generator
from pathlib import Path

import pytest
from tests.cli.running import Capture
from tests.sessions.disks import small_disk

import monochord as mc
from monochord.cli import run
from monochord.core.files import replacing, written
from monochord.core.ownership import part_folder

PLAN = ["groups=[{name='hold', sessions=2, grid=[2, 1], hold=0.3}]"]
FREE = 64 << 10
"""Bytes free on the disk: enough for a lock and a first file, not for the rest."""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sessions, and a dataset of them."""
    folder = tmp_path_factory.mktemp("made")
    mc.build(mc.collect("quick", folder / "sessions", settings=PLAN), folder / "dataset")
    return folder


@pytest.fixture
def small(tmp_path: Path) -> Generator[Path]:
    """A disk with little space left."""
    with small_disk(tmp_path / "small", 1 << 20) as folder:
        (folder / "filling").write_bytes(bytes((1 << 20) - FREE))
        yield folder


COMMANDS = {
    "collect": (["collect", "quick", "--out", "{out}"], "out"),
    "build": (["build", "{made}/sessions", "--out", "{out}"], "out"),
    "export wav-csv": (["sessions", "export", "wav-csv", "{sessions}", "--out", "{out}"], "out"),
    "export parquet": (["sessions", "export", "parquet", "{sessions}", "--out", "{out}"], "out"),
    "export lerobot": (["sessions", "export", "lerobot", "{sessions}", "--out", "{out}"], "out"),
    "export foxglove": (["sessions", "export", "foxglove", "{sessions}", "--out", "{out}"], "out"),
    "resample": (["sessions", "resample", "{session}", "--rate", "22050", "--out", "{out}.mcap"], "out.mcap"),
    "publish": (["publish", "{made}/dataset", "--licence", "mit", "--out", "{out}"], "out"),
    "publish a model": (["publish", "demo", "--licence", "mit", "--out", "{out}"], "out"),
    "simulate": (["simulate", "appendix", "--seconds", "2", "--out", "{out}.wav"], "out.wav"),
    "evaluate": (["evaluate", "demo", "--sessions", "{made}/sessions", "--out", "{out}"], "out"),
    "live csv": (["live", "demo", "{session}", "--sink", "csv={out}.csv"], "out.csv"),
    "live jsonl": (
        ["live", "demo", "{session}", "--sink", "jsonl={out}.jsonl"],
        "out.jsonl",
    ),
    "live mcap": (
        ["live", "demo", "{session}", "--sink", "mcap={out}.mcap"],
        "out.mcap",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_the_line_names_what_was_being_written(name: str, made: Path, small: Path, capsys: Capture) -> None:
    if "export" in name:
        pytest.importorskip("pyarrow")
    words, named = COMMANDS[name]
    sessions = sorted((made / "sessions").glob("*.mcap"))
    given: list[str] = []
    for word in words:
        places = {"out": small / "out", "made": made, "session": sessions[0]}
        given += map(str, sessions) if word == "{sessions}" else [word.format(**places)]
    if name.startswith("live"):
        (small / "more").write_bytes(bytes(FREE - (16 << 10)))
    status = run(given)
    error = capsys.readouterr().err
    lines = [line for line in error.splitlines() if line.startswith("monochord: ")]
    assert "Traceback" not in error
    assert status == 2, error
    assert str(small / named) in lines[-1], error
    assert ".part-" not in lines[-1]


def test_an_error_of_the_system_names_the_file(tmp_path: Path) -> None:
    file = tmp_path / "a.npy"
    with pytest.raises(OSError, match=r"a\.npy") as failure, written(file):
        raise OSError("1000 requested and 131 written")  # as NumPy tells of a full disk
    assert (failure.value.errno, failure.value.filename) == (errno.ENOSPC, str(file))
    with pytest.raises(BrokenPipeError), written(file):
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")
    with pytest.raises(OSError, match="data") as failure, part_folder(tmp_path / "data"):
        raise OSError(errno.ENOSPC, "full")
    assert failure.value.filename == str(tmp_path / "data")
    with pytest.raises(OSError, match="data") as failure, part_folder(tmp_path / "data") as part:
        raise OSError(errno.ENOSPC, "full", "from", None, str(part / "b" / "to"))  # as shutil copies
    assert failure.value.filename == str(tmp_path / "data" / "b" / "to")
    with pytest.raises(OSError, match=r"'.*/b'") as failure, replacing(tmp_path / "b"):
        raise OSError(errno.ENOSPC, "full")
    assert not list(tmp_path.iterdir())
