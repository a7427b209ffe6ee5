from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from monochord.capture.recording.from_files import from_files
from monochord.core.errors import InputError
from monochord.sessions import SessionReader, check, read_session, recover

RATE = 44100


def sound(path: Path, *, channels: int = 2, subtype: str | None = None, seconds: float = 1.03) -> np.ndarray:
    samples = 0.1 * np.random.default_rng(1).standard_normal((round(seconds * RATE), channels))
    soundfile.write(path, samples, RATE, subtype=subtype)
    read, _ = soundfile.read(path, dtype="float32", always_2d=True)
    return read.T


def imported(audio: Path, table: str | None = None, **described: Any) -> SessionReader:
    labels = None
    if table is not None:
        labels = audio.with_suffix(".csv")
        labels.write_bytes(table.encode())
    out = audio.with_suffix(".mcap")
    from_files(audio, labels, out, described=described)
    return read_session(out)


@pytest.mark.parametrize(
    ("name", "subtype", "channels"), [("a.wav", "FLOAT", 2), ("a.wav", "PCM_16", 1), ("a.flac", "PCM_24", 2)]
)
def test_audio_is_imported_bit_for_bit(tmp_path: Path, name: str, subtype: str, channels: int) -> None:
    sent = sound(tmp_path / name, subtype=subtype, channels=channels)
    session = imported(tmp_path / name)
    assert session.audio.samples.tobytes() == sent.tobytes()
    assert session.audio.gaps == ()
    assert session.audio.time(RATE) == 1.0
    assert session.labels.columns == {}
    assert check(session.path).sound


def test_labels_keep_their_columns_times_and_blanks(tmp_path: Path) -> None:
    sound(tmp_path / "a.wav")
    head = "time,contact,position,force,slip,temperature"
    table = f"{head}\n0.1,0,,,0,21.5\n0.30000000000000004,1,0.12,1.5e-3,1,\n\n"
    labels = imported(tmp_path / "a.wav", table).labels
    np.testing.assert_allclose(labels.time, [0.1, 0.3], atol=1e-9)
    expected = {
        "contact": [0, 1],
        "position": [np.nan, 0.12],
        "force": [np.nan, 1.5e-3],
        "slip": [0, 1],
        "temperature": [21.5, np.nan],
    }
    assert set(labels.columns) == set(expected)
    for name, column in expected.items():
        np.testing.assert_array_equal(labels.columns[name], column)


@pytest.mark.parametrize(
    "table",
    [
        "\ufefftime\tposition\r\n0.1\t0.05\r\n0.2\t0.06\r\n",
        " time , position \n0.1, 0.05\n0.2, 0.06\n",
        "Unnamed: 0;time;position\n7;0.1;0.05\n3;0.2;0.06\n",
        ",Unnamed: 0,time,position\n0,0,0.1,0.05\n1,1,0.2,0.06\n",
    ],
)
def test_tables_of_spreadsheets_and_of_pandas_with_its_row_numbers_are_read(
    tmp_path: Path, table: str
) -> None:
    sound(tmp_path / "a.wav")
    labels = imported(tmp_path / "a.wav", table).labels
    assert {name: column.tolist() for name, column in labels.columns.items()} == {"position": [0.05, 0.06]}


@pytest.mark.parametrize(
    "table",
    [
        "begin;end;position;force\n0,2;0,5;0,07;1\n",
        "begin\tend\tposition\tforce\n0,2\t0,5\t0,07\t1,0\n",
        "sep=;\r\nbegin;end;position;force\r\n0.2;0.5;0.07;1\r\n",
        "\ufeffsep=,\nBegin,END,Position,Force\n0.2,0.5,0.07,1\n",
    ],
)
def test_tables_of_any_spreadsheet_s_commas_and_capitals_are_read(tmp_path: Path, table: str) -> None:
    sound(tmp_path / "a.wav")
    columns = imported(tmp_path / "a.wav", table).labels.columns
    assert {name: column[30] for name, column in columns.items()} == {
        "contact": 1.0, "position": 0.07, "force": 1.0
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("position (m)", "position"), ("Position [mm]", "position"), ("position_mm", "position"),
        ("pos", "position"), ("positoin", "position"), ("force (N)", "force"), ("force_g", "force"),
        ("Force in grams", "force"), ("forces", "force"), ("slips", "slip"), ("cont", "contact"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("times", ["time", "begin,end"])
def test_a_label_s_misspelt_name_is_refused(tmp_path: Path, times: str, name: str, meant: str) -> None:
    sound(tmp_path / "a.wav")
    with pytest.raises(InputError, match=r"a\.csv") as caught:
        imported(tmp_path / "a.wav", f"{times},{name}\n{'0.1,' * times.count(',')}0.5,1\n")
    assert f"'{name}'" in caught.value.given
    assert f"did you mean '{meant}'" in caught.value.remedy
    assert not (tmp_path / "a.mcap").exists()


def test_names_unlike_the_labels_are_kept_and_so_are_those_beside_them(tmp_path: Path) -> None:
    sound(tmp_path / "a.wav")
    names = ["motion", "Source", "friction", "contacts", "slip_across", "force", "force_2", "force (raw)"]
    columns = imported(tmp_path / "a.wav", f"time,{','.join(names)}\n0.5{',1' * len(names)}\n").labels.columns
    assert [*columns] == names


def test_a_column_without_a_name_that_is_no_row_number_is_refused(tmp_path: Path) -> None:
    sound(tmp_path / "a.wav")
    with pytest.raises(InputError, match=r"a\.csv"):
        imported(tmp_path / "a.wav", ",time,position\n0.5,0.1,0.05\n")


@pytest.mark.parametrize("share", [0.4, 0.8])
def test_an_imported_session_that_was_cut_keeps_what_is_whole(tmp_path: Path, share: float) -> None:
    samples = sound(tmp_path / "a.wav", subtype="FLOAT", seconds=2.0)
    path = imported(tmp_path / "a.wav", "time,contact\n0.0,0\n0.5,1\n").path
    content = path.read_bytes()
    path.write_bytes(content[: round(share * len(content))])
    for _ in range(2):
        kept = read_session(path).audio.samples
        assert (share - 0.1) * samples.shape[1] < kept.shape[1]
        assert np.array_equal(kept, samples[:, : kept.shape[1]])
        recover(path)
    assert check(path).sound


def test_a_row_may_be_a_touch(tmp_path: Path) -> None:
    sound(tmp_path / "a.wav")
    table = "begin,end,position,force\n0.2,0.5,0.12,1.5\n0.6,0.8,0.05,\n"
    labels = imported(tmp_path / "a.wav", table).labels
    assert [np.interp(at, labels.time, labels.columns["contact"]) for at in (0.1, 0.3, 0.55, 0.7, 0.9)] == [
        0, 1, 0, 1, 0
    ]  # fmt: skip
    at = np.searchsorted(labels.time, [0.1, 0.3, 0.7])
    np.testing.assert_array_equal(labels.columns["position"][at], [np.nan, 0.12, 0.05])
    np.testing.assert_array_equal(labels.columns["force"][at], [np.nan, 1.5, np.nan])
    assert "slip" not in labels.columns


def test_a_recorded_session_gets_labels(tmp_path: Path) -> None:
    sent = sound(tmp_path / "a.wav", subtype="FLOAT")
    recorded = imported(tmp_path / "a.wav", sensor={"name": "mine"}, object="key", notes="first")
    table = tmp_path / "touches.csv"
    table.write_text("begin,end,position,force\n0.2,0.5,0.12,1.5\n")
    from_files(recorded.path, table, tmp_path / "b.mcap", described={"object": "tube"})
    session = read_session(tmp_path / "b.mcap")
    assert session.audio.samples.tobytes() == sent.tobytes()
    about = session.description
    assert (about.object, about.notes, about.sensor) == ("tube", "first", {"name": "mine"})
    assert session.clock.epoch_ns == recorded.clock.epoch_ns
    assert session.labels.columns["force"][30] == 1.5
    with pytest.raises(InputError, match=r"b\.mcap"):
        from_files(session.path, table, tmp_path / "c.mcap")


def test_the_description_is_imported(tmp_path: Path) -> None:
    sound(tmp_path / "a.wav")
    string = {"length": 0.65, "linear_density": 6.5e-4, "tension": 65.0}
    description = imported(
        tmp_path / "a.wav", "time,contact\n0,1\n", object="key", string=string, radius=0.003
    ).description
    assert (description.name, description.object, description.radius) == ("a", "key", 0.003)
    assert description.string
    assert description.string.length == 0.65
    assert description.more == {"imported": "a.wav", "imported_labels": "a.csv"}


def test_the_same_files_make_the_same_session(tmp_path: Path) -> None:
    sound(tmp_path / "a.wav")
    first = imported(tmp_path / "a.wav", "time,contact\n0,1\n").path
    from_files(tmp_path / "a.wav", tmp_path / "a.csv", tmp_path / "b.mcap")
    assert first.read_bytes() == (tmp_path / "b.mcap").read_bytes()


BAD = {
    "times,contact\n1,1\n": "times, contact",
    "begin,end\n0.2,0.1\n": "row 2, end 0.1",
    "begin,end\n0.1,0.5\n0.4,0.8\n": "row 3, begin 0.4",
    "begin,end\n0.6,0.8\n0.1,0.5\n": "row 3, begin 0.1",
    "begin,end\n0.1,0.5\n1.5,1.8\n": "row 3, begin 1.5",
    "begin,end\n0.505,0.506\n": "row 2, begin 0.505, end 0.506",
    "begin,end\n0.5,0.5\n": "row 2, begin 0.5, end 0.5",
    "begin,end\n,0.5\n": "row 2, begin nan",
    "begin,end,contact\n0.1,0.5,0.5\n": "row 2, contact 0.5",
    "time,slip\n0.1,0.5\n": "row 2, slip 0.5",
    "time;contact\n0,1;1\n0.2;1\n": "row 2, time '0,1'",
    "sep=;\ntime;contact\n0;yes\n": "row 3, contact 'yes'",
    "time,Contact,contact\n0,1,1\n": "contact, contact",
    "begin,contact\n0.1,1\n": "begin, contact",
    "": "empty",
    "time,contact\n0,1\n0.1,yes\n": "row 3, contact 'yes'",
    "time,contact\n0,1\n0.1\n": "row 3",
    "time,contact\n0,2\n": "row 2, contact 2",
    "time,position\n0,0.1\n\n0.2,120\n": "row 4, position 120",
    "time,force\n0,inf\n": "row 2, force inf",
    "time,force\n500,1\n": "row 2, time 500",
    "time,force\n,1\n": "row 2, time nan",
    "time,force\n0.5,1\n0.4,1\n": "row 3, time 0.4",
    "time,force,force\n0,1,1\n": "force, force",
    'time,force\n0,"1\n': "",
}


@pytest.mark.parametrize("table", BAD)
def test_a_bad_table_is_refused_in_one_line_and_leaves_nothing(tmp_path: Path, table: str) -> None:
    sound(tmp_path / "a.wav")
    with pytest.raises(InputError) as caught:
        imported(tmp_path / "a.wav", table)
    assert BAD[table] in caught.value.given
    assert "a.csv" in caught.value.given
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "a.mcap").exists()


REMEDIES = {
    "begin,end\n0.2,0.1\n": "swapped",
    "begin,end\n0.1,0.5\n0.4,0.8\n": "before the next",
    "begin,end\n0.6,0.8\n0.1,0.5\n": "sort",
    "begin,end,force\n0,1,0,5,1,2\n": "decimal points",
    'begin,end\n"0,1","0,5"\n': "decimal point",
    "time (s),force\n0.1,1\n": "did you mean 'time'",
    "begin_s,end_s\n0.1,0.5\n": "did you mean 'begin'",
    "start,stop\n0.1,0.5\n": "'begin' and 'end'",
}


@pytest.mark.parametrize("table", REMEDIES)
def test_a_bad_table_s_error_says_what_to_change(tmp_path: Path, table: str) -> None:
    sound(tmp_path / "a.wav")
    with pytest.raises(InputError) as caught:
        imported(tmp_path / "a.wav", table)
    assert REMEDIES[table] in caught.value.remedy


def test_a_short_row_without_a_touch_is_no_lost_touch(tmp_path: Path) -> None:
    sound(tmp_path / "a.wav")
    labels = imported(tmp_path / "a.wav", "begin,end,contact\n0.105,0.106,0\n0.2,0.5,1\n").labels
    assert labels.columns["contact"][30] == 1.0


def test_a_truncated_file_is_imported_up_to_its_end_if_allowed(tmp_path: Path) -> None:
    sent, path = sound(tmp_path / "a.wav", subtype="FLOAT"), tmp_path / "a.wav"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(InputError, match="sessions import") as caught:
        imported(path)
    assert "--allow-truncated" in caught.value.remedy
    from_files(path, None, tmp_path / "a.mcap", allow_truncated=True)
    kept = read_session(tmp_path / "a.mcap").audio.samples
    assert kept.shape[1] > 0.4 * sent.shape[1]
    assert np.array_equal(kept, sent[:, : kept.shape[1]])


TOUCHES = "begin,end,position,force\n0.1,0.2,{},{}\n0.3,0.4,{},{}\n"
WIRE = {"length": 0.2, "linear_density": 4.0e-4, "tension": 65.0, "core_diameter": 2.54e-4}


@pytest.mark.parametrize("string", [None, WIRE])
@pytest.mark.parametrize(
    "cells",
    [
        (0.05, 51.0, 0.15, 153.0), (0.05, 0.5, 0.15, -1.5), (0.05, 0.5, 0.15, 0.0), (-0.05, 0.5, 0.15, 1.5),
        (50.0, 0.5, 150.0, 1.5),
    ],
)  # fmt: skip
def test_touches_that_cannot_be_are_refused_whatever_the_string(
    tmp_path: Path, string: dict[str, float] | None, cells: tuple[float, ...]
) -> None:
    sound(tmp_path / "a.wav", seconds=0.5)
    with pytest.raises(InputError, match=r"a\.csv"):
        imported(tmp_path / "a.wav", TOUCHES.format(*cells), **({"string": string} if string else {}))
    assert not (tmp_path / "a.mcap").exists()


@pytest.mark.parametrize(
    "cells", [(0.4, 0.05, 1.5, 0.15), (0.05, 0.5, 0.15, 48.0), (0.05, 0.5, 0.3, 0.5)],
    ids=["exchanged", "grams", "beyond the string"],
)  # fmt: skip
def test_touches_that_a_known_string_cannot_have_are_refused(
    tmp_path: Path, cells: tuple[float, ...]
) -> None:
    sound(tmp_path / "a.wav", seconds=0.5)
    with pytest.raises(InputError, match=r"a\.csv"):
        imported(tmp_path / "a.wav", TOUCHES.format(*cells), string=WIRE)
    assert imported(tmp_path / "a.wav", TOUCHES.format(*cells)).labels.time.size


def test_a_force_sensor_s_noise_about_zero_is_no_touch(tmp_path: Path) -> None:
    sound(tmp_path / "a.wav")
    rows = ["0.0,-0.02", "0.1,0.01", "0.2,-0.01", "0.3,1.0", "0.4,1.1", "0.5,0.0"]
    table = "\n".join(["time,force", *rows])
    assert imported(tmp_path / "a.wav", table).labels.columns["force"][3] == 1.0
    (tmp_path / "a.mcap").unlink()
    pulled = table.replace(",1.", ",-1.")
    with pytest.raises(InputError, match=r"row 2, force -0\.02"):
        imported(tmp_path / "a.wav", pulled)


def test_bad_files_are_refused_as_the_source_does(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.wav"):
        imported(tmp_path / "none.wav")
    sound(tmp_path / "three.wav", channels=3)
    with pytest.raises(InputError, match="3 channels"):
        imported(tmp_path / "three.wav")
    sound(tmp_path / "a.wav")
    with pytest.raises(InputError, match=r"none\.csv"):
        from_files(tmp_path / "a.wav", tmp_path / "none.csv", tmp_path / "a.mcap")
    (tmp_path / "b.csv").write_bytes(b"time,\xff\xfe\n")
    with pytest.raises(InputError, match=r"b\.csv"):
        from_files(tmp_path / "a.wav", tmp_path / "b.csv", tmp_path / "a.mcap")
    with pytest.raises(InputError, match="objekt"):
        imported(tmp_path / "a.wav", objekt="key")
    assert not list(tmp_path.glob("*.mcap"))


def test_a_session_that_is_there_stays(tmp_path: Path) -> None:
    sound(tmp_path / "a.wav")
    (tmp_path / "a.mcap").write_text("mine")
    with pytest.raises(InputError, match=r"a\.mcap"):
        imported(tmp_path / "a.wav")
    assert (tmp_path / "a.mcap").read_text() == "mine"


def test_a_file_s_name_may_be_of_any_bytes(tmp_path: Path) -> None:
    sound(tmp_path / "a.wav", seconds=0.1)
    audio = (tmp_path / "a.wav").rename(tmp_path / "b\udcff\x1b.wav")
    from_files(audio, None, tmp_path / "a.mcap")
    assert read_session(tmp_path / "a.mcap").description.name == "b\ufffd\x1b"


def test_notes_that_no_file_can_hold_are_refused(tmp_path: Path) -> None:
    sound(tmp_path / "a.wav", seconds=0.1)
    with pytest.raises(InputError):
        from_files(tmp_path / "a.wav", None, tmp_path / "a.mcap", described={"notes": "\udcff"})
    assert not (tmp_path / "a.mcap").exists()
