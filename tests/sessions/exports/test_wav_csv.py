import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import soundfile

from monochord.core.errors import InputError
from monochord.sessions import read_session
from monochord.sessions.exports.wav_csv import WavCsv

Write = Callable[..., Path]
Same = Callable[[Path, Path], None]


@pytest.fixture
def folder(write_random: Write, tmp_path: Path) -> Path:
    """A session as it was exported."""
    take = write_random(tmp_path / "take.mcap", 2, full=True)
    WavCsv().write([read_session(take)], tmp_path / "out")
    return tmp_path / "out" / "take"


def test_the_files_are_what_other_programs_read(folder: Path) -> None:
    session = read_session(folder.parents[1] / "take.mcap")
    assert len(session.streams) == 3
    names = {"audio.wav", "audio.csv", "labels.csv", "events.csv", "clocks.csv", "session.json"}
    streams = {"wrench.csv", "pose.csv", "odd.csv"}
    assert {path.name for path in folder.iterdir()} == names | streams
    sound, rate = soundfile.read(folder / "audio.wav", dtype="float32", always_2d=True)
    assert rate == session.audio.sample_rate
    assert sound.T.tobytes() == session.audio.samples.tobytes()
    with (folder / "wrench.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    given = [float(row["fz"] or "nan") for row in rows]
    np.testing.assert_array_equal(given, session.readings("wrench").column("fz"))
    assert session.audio.gaps


def test_sessions_of_one_name_are_refused(write_random: Write, tmp_path: Path) -> None:
    take = read_session(write_random(tmp_path / "take.mcap", 1, seconds=0.1))
    with pytest.raises(InputError, match=r"^two sessions called take: allowed is"):
        WavCsv().write([take, take], tmp_path / "out")


def _spoil_cell(folder: Path) -> None:
    lines = (folder / "pose.csv").read_text().splitlines()
    cells = lines[3].split(",")
    cells[5] = "ten"
    (folder / "pose.csv").write_text("\n".join([*lines[:3], ",".join(cells), *lines[4:]]))


SPOILT = {
    "not there": (lambda f: (f / "clocks.csv").unlink(), r"clocks\.csv \(No such file"),
    "no sound": (lambda f: (f / "audio.wav").unlink(), r"audio\.wav"),
    "no session": (lambda f: (f / "session.json").unlink(), r"no session\.json"),
    "other form": (lambda f: (f / "session.json").write_text('{"form": "parquet"}'), r"\(parquet\)"),
    "no form": (lambda f: (f / "session.json").write_text("{}"), "not as it was written"),
    "short row": (lambda f: (f / "labels.csv").write_text("time,contact\n1.0\n"), "row 2 of 1 cells"),
    "a word": (_spoil_cell, r"pose\.csv row 4, y 'ten': allowed is a number"),
    "no column": (lambda f: (f / "events.csv").write_text("time,kind\n"), "without data, text"),
    "no such frames": (
        lambda f: (f / "audio.csv").write_text(
            "time,start,frames,dropped,timed,device_frame\n0,0,999999,0,0,-1\n"
        ),
        "frames 0 to 999999: allowed is those of audio.wav",
    ),
}


@pytest.mark.parametrize("name", SPOILT)
def test_a_spoilt_folder_is_refused_in_one_line(folder: Path, name: str) -> None:
    spoil, message = SPOILT[name]
    spoil(folder)
    with pytest.raises(InputError, match=message) as caught:
        WavCsv().read(folder, folder.parent / "again.mcap")
    assert "\n" not in str(caught.value)
    assert not (folder.parent / "again.mcap").exists()
