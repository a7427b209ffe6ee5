import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from monochord.core.errors import InputError
from monochord.sessions import read_session
from monochord.sessions.exports.parquet import Parquet

Write = Callable[..., Path]
Same = Callable[[Path, Path], None]


@pytest.fixture
def folder(write_random: Write, tmp_path: Path) -> Path:
    """A session as it was exported."""
    take = write_random(tmp_path / "take.mcap", 2, full=True)
    Parquet().write([read_session(take)], tmp_path / "out")
    return tmp_path / "out" / "take"


def test_the_files_are_what_other_programs_read(folder: Path) -> None:
    session = read_session(folder.parents[1] / "take.mcap")
    names = {"audio", "labels", "events", "clocks", "wrench", "pose", "odd"}
    assert {path.name for path in folder.iterdir()} == {f"{name}.parquet" for name in names} | {
        "session.json"
    }
    wrench = pq.read_table(folder / "wrench.parquet")
    assert wrench.schema.field("fz").type == pa.float64()
    assert wrench.schema.field("status").type == pa.uint32()
    np.testing.assert_array_equal(wrench["fz"].to_numpy(), session.readings("wrench").column("fz"))
    audio = pq.read_table(folder / "audio.parquet").to_pylist()
    first = audio[3]
    samples = session.audio.samples[0, first["start"] : first["start"] + len(first["channel_1"])]
    np.testing.assert_array_equal(np.array(first["channel_1"], np.float32), samples)


@pytest.mark.parametrize("compression", ["none", "snappy", "gzip"])
def test_any_compression_reads_again(folder: Path, assert_same: Same, compression: str) -> None:
    take = folder.parents[1] / "take.mcap"
    Parquet(compression=compression).write([read_session(take)], folder / "other")
    Parquet().read(folder / "other" / "take", folder / "again.mcap")
    assert_same(take, folder / "again.mcap")


def test_an_unknown_compression_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^compression 'lzw': allowed is zstd, snappy, gzip, none$"):
        Parquet(compression="lzw").write([], tmp_path / "out")


def _without(column: str) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        name = "audio" if column == "channel_1" else "wrench"
        table = pq.read_table(folder / f"{name}.parquet").drop_columns([column])
        pq.write_table(table, folder / f"{name}.parquet")

    return spoil


SPOILT: dict[str, tuple[Callable[[Path], Any], str]] = {
    "not there": (lambda f: (f / "clocks.parquet").unlink(), r"clocks\.parquet"),
    "no sound": (lambda f: (f / "audio.parquet").write_text("PAR1"), r"audio\.parquet"),
    "no session": (lambda f: (f / "session.json").unlink(), r"no session\.json"),
    "other form": (lambda f: (f / "session.json").write_text('{"form": "wav_csv"}'), r"\(wav_csv\)"),
    "no column": (_without("fy"), r"wrench.parquet without fy: allowed is time, sequence"),
    "no channel": (_without("channel_1"), r"audio.parquet with time, start, dropped"),
}


@pytest.mark.parametrize("name", SPOILT)
def test_a_spoilt_folder_is_refused_in_one_line(folder: Path, name: str) -> None:
    spoil, message = SPOILT[name]
    spoil(folder)
    with pytest.raises(InputError, match=message) as caught:
        Parquet().read(folder, folder.parent / "again.mcap")
    assert "\n" not in str(caught.value)
    assert not (folder.parent / "again.mcap").exists()


def test_without_pyarrow_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"requires pyarrow.*pip install"):
        Parquet().write([], tmp_path / "out")
