"""Whatever a folder that is imported holds: a session, or a refusal and no file; see also tests/fuzz."""

import json
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import soundfile

from monochord.core.errors import InputError
from monochord.sessions import read_session
from monochord.sessions.exports import EXPORTS, form_of, parquet

Write = Callable[..., Path]
FORMS = ("wav_csv", "parquet")


@pytest.fixture(scope="module")
def exported(write_random: Write, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A short session in each form."""
    folder = tmp_path_factory.mktemp("exported")
    take = write_random(folder / "take.mcap", 39, seconds=0.03, full=True)
    for form in FORMS:
        EXPORTS.build(form).write([read_session(take)], folder / form)
    return {form: folder / form / "take" for form in FORMS}


def bring_in(folder: Path, out: Path) -> None:
    """Import a folder, and look at the session; what fails leaves no file."""
    out.unlink(missing_ok=True)
    try:
        EXPORTS.build(form_of(folder)).read(folder, out)
    except BaseException:
        assert not out.exists()
        raise
    session = read_session(out)
    assert session.complete
    _ = session.audio, session.labels, session.events, session.clocks
    assert [len(session.readings(stream).time) for stream in session.streams]
    assert not session.malformed


def refused_or_imported(folder: Path, out: Path) -> bool:
    """Import a folder, and return whether it was taken; an error but `InputError` passes on."""
    try:
        bring_in(folder, out)
    except InputError:
        return False
    return True


def description_with(**changes: Any) -> Callable[[Path], object]:
    """Replace entries of session.json."""

    def spoil(folder: Path) -> None:
        path = folder / "session.json"
        path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))

    return spoil


def about(**changes: Any) -> Callable[[Path], object]:
    """Replace entries of the description in session.json."""

    def spoil(folder: Path) -> None:
        path = folder / "session.json"
        tree = json.loads(path.read_text())
        path.write_text(json.dumps({**tree, "description": {**tree["description"], **changes}}))

    return spoil


def text(name: str, content: str | bytes) -> Callable[[Path], object]:
    data = content if isinstance(content, bytes) else content.encode()
    return lambda folder: (folder / name).write_bytes(data)


def cell(name: str, column: str, content: str) -> Callable[[Path], object]:
    """Replace a cell of the first row of a CSV file."""

    def spoil(folder: Path) -> None:
        path = folder / name
        head, first, *rest = path.read_text().split("\n")
        cells = first.split(",")
        cells[head.replace('"', "").split(",").index(column)] = content
        path.write_text("\n".join([head, ",".join(cells), *rest]))

    return spoil


ABOUT: dict[str, Callable[[Path], object]] = {
    "no JSON": text("session.json", "{"),
    "JSON in another encoding": text("session.json", b'{"form": "\xff"}'),
    "JSON of 20 MB": text("session.json", b" " * 20_000_000),
    "no file": lambda folder: (folder / "session.json").unlink(),
    "another form": description_with(form="lerobot"),
    "a form that is a list": description_with(form=["wav_csv"]),
    "a description that is a list": description_with(description=[1]),
    "a clock that is a number": description_with(clock={"epoch_ns": 1e30, "origin": 0.0}),
    "a rate of 1e30": about(sample_rate=10**30),
}


@pytest.mark.parametrize(("number", "case"), [*enumerate(ABOUT)])
def test_what_the_folder_says_of_itself_is_looked_at(
    exported: dict[str, Path], tmp_path: Path, number: int, case: str
) -> None:
    refuse(exported[FORMS[number % 2]], tmp_path, ABOUT[case])  # which both forms read alike


def refuse(exported: Path, tmp_path: Path, spoil: Callable[[Path], object]) -> None:
    shutil.copytree(exported, tmp_path / "take")
    spoil(tmp_path / "take")
    with pytest.raises(InputError):
        bring_in(tmp_path / "take", tmp_path / "a.mcap")


def wav(**head: int) -> Callable[[Path], object]:
    """Write a number over one in the head of the WAV file: of RIFF, of ``fmt``, of the sound."""

    def spoil(folder: Path) -> None:
        path = folder / "audio.wav"
        content = bytearray(path.read_bytes())
        at = {"riff": 4, "channels": 22, "rate": 24, "sound": content.index(b"data") + 4}
        for name, number in head.items():
            size = 2 if name == "channels" else 4
            content[at[name] : at[name] + size] = number.to_bytes(size, "little")
        path.write_bytes(content)

    return spoil


def other_sound(name: str, subtype: str) -> Callable[[Path], object]:
    def spoil(folder: Path) -> None:
        samples, rate = soundfile.read(folder / "audio.wav", always_2d=True)
        soundfile.write(folder / "audio.wav", np.zeros_like(samples), rate, subtype, format=name)

    return spoil


def twice_the_rows(folder: Path) -> None:
    path = folder / "audio.csv"
    path.write_text(path.read_text() + "\n".join(path.read_text().split("\n")[1:]))


CSV: dict[str, Callable[[Path], object]] = {
    "a table that is missing": lambda folder: (folder / "clocks.csv").unlink(),
    "a column that is missing": text("events.csv", "time,kind\n"),
    "a start in years": cell("audio.csv", "start", str(2**62)),
    "frames without end": cell("audio.csv", "frames", str(2**62)),
    "stretches over each other": twice_the_rows,
    "more lost than can be": cell("audio.csv", "dropped", str(2**62)),
    "a device frame beyond 64 bits": cell("audio.csv", "device_frame", str(2**64)),
    "a stretch at no time": cell("audio.csv", "time", ""),
    "a stretch at 1e300 s": cell("audio.csv", "time", "1e300"),
    "a time that is not a number": cell("wrench.csv", "time", "nan"),
    "a count of 10000 digits": cell("wrench.csv", "sequence", "9" * 10_000),
    "a status beyond 32 bits": cell("wrench.csv", "status", str(2**32)),
    "a status that is a fraction": cell("wrench.csv", "status", "0.5"),
    "a value that is text": cell("wrench.csv", "fz", "much"),
    "data that is no JSON": text("events.csv", '"time","kind","text","data"\n0.1,"a","","{"\n'),
    "data nested deeply": text(
        "events.csv",
        '"time","kind","text","data"\n0.1,"a","","{""a"":' + "[" * 60_000 + "]" * 60_000 + '}"\n',
    ),
    "a column twice": text("labels.csv", "time,a,a\n0,1,2\n"),
    "a ragged table": text("labels.csv", "time,a\n0,1,2\n"),
    "too many labels": text("labels.csv", ",".join(["time", *map(str, range(300))]) + "\n"),
    "a huge field": text("labels.csv", "time,a\n0," + "1" * 200_000 + "\n"),
    "NUL bytes": text("labels.csv", b"time,a\n0,\x00\n"),
    "another encoding": text("labels.csv", b"time,\xff\n0,1\n"),
    "sound of another rate": wav(rate=44100),
    "sound of no channels": wav(channels=0),
    "a folder for sound": lambda folder: ((folder / "audio.wav").unlink(), (folder / "audio.wav").mkdir()),
    "flac for sound": other_sound("FLAC", "PCM_16"),
    "sound cut off": lambda folder: text("audio.wav", (folder / "audio.wav").read_bytes()[:2000])(folder),
    "no sound": text("audio.wav", b""),
}


@pytest.mark.parametrize("case", CSV)
def test_spoilt_csv_and_wav_are_refused(exported: dict[str, Path], tmp_path: Path, case: str) -> None:
    refuse(exported["wav_csv"], tmp_path, CSV[case])


@pytest.mark.parametrize("head", [{"riff": 0xFFFFFFFF}, {"sound": 0xFFFFFFFF}])
def test_sound_that_claims_more_than_there_is_takes_no_memory(
    exported: dict[str, Path], tmp_path: Path, head: dict[str, int]
) -> None:
    shutil.copytree(exported["wav_csv"], tmp_path / "take")
    wav(**head)(tmp_path / "take")
    refused_or_imported(tmp_path / "take", tmp_path / "a.mcap")


def test_an_event_may_have_data_of_any_name(exported: dict[str, Path], tmp_path: Path) -> None:
    shutil.copytree(exported["wav_csv"], tmp_path / "take")
    names = {"self": 1, "time": 2, "kind": 3, "text": 4}
    quoted = json.dumps(names).replace('"', '""')
    text("events.csv", f'"time","kind","text","data"\n0.1,"a","","{quoted}"\n')(tmp_path / "take")
    bring_in(tmp_path / "take", tmp_path / "a.mcap")
    assert read_session(tmp_path / "a.mcap").events[0].data == names


def table(name: str, change: Callable[[Any], Any]) -> Callable[[Path], object]:
    """Put a table in another's place."""

    def spoil(folder: Path) -> None:
        path = folder / f"{name}.parquet"
        pq.write_table(change(pq.read_table(path)), path)

    return spoil


def column(name: str, key: str, change: Callable[[Any], Any]) -> Callable[[Path], object]:
    """Put another column in a column's place."""

    def changed(table_in: Any) -> Any:
        changed_column = change(table_in[key])
        return table_in.set_column(table_in.column_names.index(key), key, changed_column)

    return table(name, changed)


def lists(change: Callable[[list[Any]], list[Any]], kind: Any = None) -> Callable[[Any], Any]:
    return lambda table_in: pa.array(change(table_in.to_pylist()), kind or table_in.type)


def first(value: Any, kind: Any = None) -> Callable[[Any], Any]:
    return lists(lambda cells: [value, *cells[1:]], kind)


def bomb(folder: Path) -> None:
    """Write a file of some kilobytes that holds 128 MB of zeros."""
    zeros = pa.repeat(pa.scalar(0.0), 1 << 22)
    with pq.ParquetWriter(folder / "labels.parquet", pa.schema([("time", pa.float64())])) as writer:
        for _ in range(4):
            writer.write_table(pa.table({"time": zeros}))


def audio_bomb(folder: Path) -> None:
    """Write a file of some kilobytes of which a row holds 64 MB of zeros in each channel."""
    path = folder / "audio.parquet"
    schema = pq.read_schema(path)
    zeros = pa.repeat(pa.scalar(0.0, pa.float32()), 1 << 24)
    samples = pa.ListArray.from_arrays(pa.array([0, len(zeros)], pa.int32()), zeros)
    columns = {"time": [0.0], "start": [0], "dropped": [0], "timed": [True], "device_frame": [0]}
    arrays = [
        pa.array(columns[field.name], field.type) if field.name in columns else samples for field in schema
    ]
    pq.write_table(pa.table(arrays, schema=schema), path)


def garbage(folder: Path) -> None:
    """Write zeros over pages of a file."""
    path = folder / "wrench.parquet"
    content = path.read_bytes()
    path.write_bytes(content[:100] + bytes(400) + content[500:])


def many_labels(rows: Any) -> Any:
    return pa.table({"time": rows["time"], **{str(k): rows["time"] for k in range(300)}})


def misnamed(folder: Path) -> None:
    """Write a name that is no UTF-8 over a column's."""
    path = folder / "labels.parquet"
    path.write_bytes(path.read_bytes().replace(b"contact", b"\xff\xfentact"))


PARQUET: dict[str, Callable[[Path], object]] = {
    "cut off": lambda folder: text("wrench.parquet", (folder / "wrench.parquet").read_bytes()[:-100])(folder),
    "garbage within": garbage,
    "a table that is missing": lambda folder: (folder / "clocks.parquet").unlink(),
    "counts that are fractions": column(
        "wrench", "sequence", lists(lambda cells: [cell + 0.5 for cell in cells], pa.float64())
    ),
    "counts that are missing": column("wrench", "sequence", first(None)),
    "times that are dates": column(
        "wrench", "time", lists(lambda cells: [0] * len(cells), pa.timestamp("s"))
    ),
    "too many labels": table("labels", many_labels),
    "a name that is no UTF-8": misnamed,
    "a sample that is missing": column(
        "audio", "channel_1", lists(lambda cells: [[None] * len(each) for each in cells])
    ),
    "audio of ragged channels": column("audio", "channel_1", first([0.0] * 7)),
}


@pytest.mark.parametrize("held", ["", "print(0); print(1, flush=True)"])
def test_columns_that_are_never_read_are_refused_in_time(
    exported: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, held: str
) -> None:
    monkeypatch.setattr(parquet, "READ_TIMEOUT", 2.0)
    monkeypatch.setattr(parquet, "READ_METADATA", f"import time\n{held}\ntime.sleep(30)")
    begun = time.monotonic()
    with pytest.raises(InputError, match=r"\.parquet \(its columns are not read in 2 s\)"):
        bring_in(exported["parquet"], tmp_path / "back.mcap")
    assert time.monotonic() - begun < 15


def test_columns_that_end_the_process_are_refused(
    exported: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parquet, "READ_METADATA", "import os\nprint(0, flush=True)\nos.abort()")
    with pytest.raises(InputError, match=r"\.parquet \(its columns are described wrongly\)"):
        bring_in(exported["parquet"], tmp_path / "back.mcap")


@pytest.mark.parametrize("case", PARQUET)
def test_spoilt_parquet_is_refused(exported: dict[str, Path], tmp_path: Path, case: str) -> None:
    refuse(exported["parquet"], tmp_path, PARQUET[case])


CHILD = """
import sys, resource
from pathlib import Path
from tests.sessions.exports.test_spoilt import refused_or_imported
from monochord.sessions.exports.parquet import Parquet
import pyarrow.parquet
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for folder in map(Path, sys.argv[1:]):
    assert not refused_or_imported(folder, folder / "a.mcap")
print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) // 1024)
"""


def test_a_file_that_unpacks_to_gigabytes_takes_none_of_them(
    exported: dict[str, Path], tmp_path: Path
) -> None:
    folders = [tmp_path / str(number) for number in range(2)]
    for folder, spoil in zip(folders, (bomb, audio_bomb), strict=True):
        shutil.copytree(exported["parquet"], folder)
        spoil(folder)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-c", CHILD, *map(str, folders)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert int(done.stdout) < 60  # MB
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 20.0  # s


def test_a_lerobot_folder_is_no_session(exported: dict[str, Path], tmp_path: Path) -> None:
    for info in ("{}", "{", "[" * 100_000, "\xff"):
        meta = tmp_path / "set" / "meta"
        meta.mkdir(parents=True, exist_ok=True)
        (meta / "info.json").write_bytes(info.encode("latin-1"))
        assert not refused_or_imported(tmp_path / "set", tmp_path / "a.mcap"), info
