"""What is exported in a whole form is read by other programs, and imported again the same, to the bit."""

import csv
import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import soundfile
from hypothesis import given, settings
from hypothesis import strategies as st

from monochord.core.errors import InputError
from monochord.sessions import SessionReader, read_session
from monochord.sessions.exports import EXPORTS

Write = Callable[..., Path]
Same = Callable[[Path, Path], None]
FORMS = ("wav_csv", "parquet")


@pytest.mark.parametrize("form", FORMS)
@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 2**32), close=st.booleans())
def test_a_round_trip_loses_nothing_also_of_a_session_that_was_cut_off(
    write_random: Write, assert_same: Same, form: str, seed: int, *, close: bool
) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        take = write_random(folder / "take.mcap", seed, seconds=0.25, close=close)
        EXPORTS.build(form).write([read_session(take)], folder / "out")
        assert json.loads((folder / "out/take/session.json").read_text())["complete"] is close
        EXPORTS.build(form).read(folder / "out" / "take", folder / "again.mcap")
        assert_same(take, folder / "again.mcap")


@pytest.fixture(scope="module")
def take(write_random: Write, tmp_path_factory: pytest.TempPathFactory) -> SessionReader:
    """A session of all streams, with gaps."""
    path = tmp_path_factory.mktemp("take") / "take.mcap"
    session = read_session(write_random(path, 2, full=True))
    assert len(session.streams) == 3
    assert session.audio.gaps
    return session


def test_wav_and_csv_are_what_other_programs_read(take: SessionReader, tmp_path: Path) -> None:
    EXPORTS.build("wav_csv").write([take], tmp_path)
    folder = tmp_path / "take"
    assert {path.stem for path in folder.glob("*.csv")} >= {"labels", "events", "clocks", *take.streams}
    sound, rate = soundfile.read(folder / "audio.wav", dtype="float32", always_2d=True)
    assert rate == take.audio.sample_rate
    assert sound.T.tobytes() == take.audio.samples.tobytes()
    with (folder / "wrench.csv").open(newline="") as file:
        given = [float(row["fz"] or "nan") for row in csv.DictReader(file)]
    np.testing.assert_array_equal(given, take.readings("wrench").column("fz"))


def test_parquet_is_what_other_programs_read(take: SessionReader, tmp_path: Path) -> None:
    EXPORTS.build("parquet").write([take], tmp_path)
    folder = tmp_path / "take"
    assert {path.stem for path in folder.glob("*.parquet")} >= {"labels", "events", "clocks", *take.streams}
    wrench = pq.read_table(folder / "wrench.parquet")
    assert wrench.schema.field("fz").type == pa.float64()
    assert wrench.schema.field("status").type == pa.uint32()
    np.testing.assert_array_equal(wrench["fz"].to_numpy(), take.readings("wrench").column("fz"))
    row = pq.read_table(folder / "audio.parquet").to_pylist()[3]
    samples = take.audio.samples[0, row["start"] : row["start"] + len(row["channel_1"])]
    np.testing.assert_array_equal(np.array(row["channel_1"], np.float32), samples)


def test_another_compression_reads_again(take: SessionReader, assert_same: Same, tmp_path: Path) -> None:
    EXPORTS.build("parquet", {"compression": "gzip"}).write([take], tmp_path / "out")
    EXPORTS.build("parquet").read(tmp_path / "out" / "take", tmp_path / "again.mcap")
    assert_same(take.path, tmp_path / "again.mcap")


def test_what_cannot_be_exported_is_refused(
    take: SessionReader, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InputError, match="take"):
        EXPORTS.build("wav_csv").write([take, take], tmp_path / "out")
    with pytest.raises(InputError, match="lzw"):
        EXPORTS.build("parquet", {"compression": "lzw"}).write([], tmp_path / "out")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match="pip install"):
        EXPORTS.build("parquet").write([], tmp_path / "out")
