"""Whatever a session's file holds: it is read past what is malformed, or refused."""

import json
import resource
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType
from tests.sessions.forged import (
    NANO,
    SOUND,
    Forgery,
    audio,
    clocks,
    described,
    event,
    forge,
    labels,
    oven,
    wrenches,
)
from tests.sessions.made import EPOCH

from monochord.core.errors import InputError
from monochord.sessions import SessionReader, check, chunks, codec, read_session
from monochord.sessions.alignment import align
from monochord.sessions.bounds import ALWAYS_UNPACKED, MAX_COLUMNS, MAX_DURATION
from monochord.sessions.facts import facts_lines, facts_of

MEMORY = 1 << 30
"""Bytes of address space that a child may add to what the interpreter and its libraries take."""


def read_all(path: Path) -> SessionReader:
    """Look at everything in a session as the commands do; raises nothing but `InputError`."""
    session = read_session(path)
    assert session.audio.samples.shape[0] == session.description.channels
    for stream in session.streams:
        track = session.readings(stream)
        counts = {
            len(getattr(track, name)) for name in ("time", "values", "sequence", "device_time", "status")
        }
        assert counts == {len(track.time)}
    assert all(len(column) == len(session.labels.time) for column in session.labels.columns.values())
    assert all(isinstance(each.data, dict) for each in session.events)
    json.dumps(facts_of(session))
    facts_lines(facts_of(session))
    check(path)
    align(session)
    return session


HUGE = 2**62
MALFORMED: dict[str, Forgery] = {
    "audio that starts in years": Forgery("/audio", audio(start=HUGE)),
    "audio that starts at the end of time": Forgery("/audio", audio(start=2**64 - 1)),
    "audio of no channels": Forgery("/audio", audio(channels=0)),
    "audio of too many channels": Forgery("/audio", audio(channels=2**32 - 1)),
    "audio of another count of channels": Forgery("/audio", audio(channels=1)),
    "audio of ragged channels": Forgery("/audio", audio(samples=np.zeros(881, np.float32))),
    "audio before 1970": Forgery("/audio", audio(), 0),
    "audio logged at the end of time": Forgery("/audio", audio(), 2**64 - 1),
    "readings without status": Forgery("/wrench", wrenches(status=np.zeros(0, np.uint32))),
    "readings with more counts": Forgery("/wrench", wrenches(sequence=np.arange(11))),
    "readings with less force": Forgery("/wrench", wrenches(force=np.zeros(29))),
    "readings that arrive before all time": Forgery("/wrench", wrenches(arrival=np.full(10, -(2**63)))),
    "readings that arrive after all time": Forgery("/wrench", wrenches(arrival=np.full(10, 2**63 - 1))),
    "readings of another width": Forgery("/oven", oven(columns=["temperature"], values=np.zeros(2))),
    "readings with values left over": Forgery("/oven", oven(values=np.zeros(5))),
    "a pose at the end of time": Forgery("/pose", SOUND[3].data, 2**64 - 1),
    "a pose that is cut off": Forgery("/pose", SOUND[3].data[:40]),
    "ragged labels": Forgery("/labels", labels(values=np.zeros(3))),
    "labels of no column": Forgery("/labels", labels(columns=[])),
    "labels with a name twice": Forgery("/labels", labels(columns=["a", "a"], values=np.zeros(4))),
    "labels after all time": Forgery("/labels", labels(time=np.array([0, 2**63 - 1]))),
    "labels of too many columns": Forgery(
        "/labels", labels(columns=[str(k) for k in range(300)], values=np.zeros(600))
    ),
    "ragged clocks": Forgery("/clocks", clocks(names=["jack", "realtime"])),
    "clocks with a name twice": Forgery("/clocks", clocks(names=["a", "a"], offsets=np.zeros(2))),
    "an event that is no JSON": Forgery("/events", event(data="{not json")),
    "an event that is a list": Forgery("/events", event(data="[1]")),
    "an event nested deeply": Forgery("/events", event(data='{"a":' + "[" * 100_000 + "]" * 100_000 + "}")),
    "an event nested a little": Forgery("/events", event(data='{"a":' + "[" * 40 + "]" * 40 + "}")),
    "an event of endless digits": Forgery("/events", event(data='{"a": ' + "9" * 5000 + "}")),
    "an event of half a pair": Forgery("/events", event(data='{"a": "\\ud800"}')),
    "an event in another encoding": Forgery("/events", event(text="Zeit").replace(b"Zeit", b"Z\xffit")),
    "an event before all time": Forgery("/events", event(header=codec.header(-(2**31) * NANO))),
    "nothing": Forgery("/audio", b""),
    "no CDR": Forgery("/labels", b"\x07\x07\x07\x07" * 8),
    "an array that claims GBs": Forgery(
        "/audio", audio()[:-3532] + struct.pack("<I", 2**32 - 1) + bytes(3528)
    ),
}


@pytest.mark.parametrize("topic", sorted({each.topic for each in MALFORMED.values()}))
def test_malformed_messages_are_left_out_and_named(tmp_path: Path, topic: str) -> None:
    forged = [each for each in MALFORMED.values() if each.topic == topic]
    session = read_all(forge(tmp_path / "a.mcap", [*SOUND, *forged]))
    assert {name: count for name, (count, _) in session.malformed.items()} == {topic: len(forged)}
    (fault,) = (fault for fault in check(session.path).faults if "malformed" in fault)
    assert f"{len(forged)} malformed" in fault
    assert topic in fault
    # Everything else is there.
    assert session.audio.samples.shape == (2, 882)
    assert [len(session.readings(stream).time) for stream in session.streams] == [10, 1, 2]
    assert (len(session.labels.time), len(session.events), len(session.clocks.time)) == (2, 1, 1)


def test_a_session_as_it_should_be_has_nothing_malformed(tmp_path: Path) -> None:
    assert not read_all(forge(tmp_path / "a.mcap")).malformed


NESTED = "[" * 100_000 + "]" * 100_000
FEED = {"stream": "oven", "columns": ["t"], "units": ["K"]}
DESCRIPTIONS: dict[str, str] = {
    "a description that is a list": "[1, 2]",
    "a description that is no JSON": "{",
    "a description nested deeply": '{"sensor": ' + NESTED + "}",
    "a sensor nested deeply": '{"sensor": {"a": ' + "[" * 900 + "]" * 900 + "}}",
    "a strange key nested deeply": '{"strange": ' + "[" * 900 + "]" * 900 + "}",
    "a description of half a pair": described(name="\ud800"),
    "a rate that is a table": described(sample_rate={}),
    "a rate of 1e30": described(sample_rate=10**30),
    "a rate that is not a number": described(sample_rate=float("nan")),
    "a rate of nothing": described(sample_rate=0),
    "channels without end": described(channels=10**9),
    "feeds that are text": described(feeds="wrench"),
    "a feed without columns": described(feeds=[FEED | {"columns": [], "units": []}]),
    "a feed with a column twice": described(feeds=[FEED | {"columns": ["a", "a"], "units": ["", ""]}]),
    "a feed without its units": described(feeds=[FEED | {"units": []}]),
    "a feed at 1e400": described(feeds=[FEED]).replace('"K"]', '"K"], "rate": 1e400'),
    "a feed of negative ticks": described(feeds=[FEED | {"ticks": -1.0}]),
    "feeds without end": described(feeds=[FEED | {"stream": f"s{k}"} for k in range(10_000)]),
}
REFUSED: dict[str, dict[str, Any]] = {
    **{name: {"description_text": text} for name, text in DESCRIPTIONS.items()},
    "a clock of 1e30": {"begin": {"epoch_ns": str(10**30)}},
    "a clock before 1970": {"begin": {"epoch_ns": "-1"}},
    "a clock of endless digits": {"begin": {"epoch_ns": "9" * 5000}},
    "an origin that is not a number": {"begin": {"origin": "nan"}},
    "an origin of 1e300": {"begin": {"origin": "1e300"}},
    "more label columns than a table has": {
        "messages": [
            Forgery("/labels", labels(columns=[f"c{k}"], time=np.array([EPOCH]), values=np.zeros(1)))
            for k in range(MAX_COLUMNS + 1)
        ]
    },
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_session_that_cannot_be_read_is_refused(tmp_path: Path, case: str) -> None:
    path = forge(tmp_path / "a.mcap", **REFUSED[case])
    with pytest.raises(InputError, match=path.name):
        read_all(path)


def test_an_ending_that_is_damaged_is_a_fault(tmp_path: Path) -> None:
    for number, end in enumerate(({"sha256": "[1]"}, {"sha256": NESTED}, {"checksum": "\x1b"})):
        assert any("checksum" in fault for fault in check(forge(tmp_path / f"{number}.mcap", end=end)).faults)


def test_counts_that_leap_cost_no_memory(tmp_path: Path) -> None:
    n = 5000
    leaps = np.concatenate([np.arange(n // 2), 2**62 + np.arange(n // 2)])
    message = wrenches(
        arrival=EPOCH + np.arange(n) * NANO // 1000,
        sequence=leaps,
        device_time=leaps,
        status=np.zeros(n, np.uint32),
        force=np.zeros(3 * n),
        torque=np.zeros(3 * n),
    )
    track = read_all(forge(tmp_path / "a.mcap", [Forgery("/wrench", message)])).readings("wrench")
    assert track.missing == 2**62 - n // 2


def test_a_recording_of_twelve_hours_is_within_all_bounds(tmp_path: Path) -> None:
    start = 12 * 3600 * 96_000
    path = forge(
        tmp_path / "a.mcap",
        [Forgery("/audio", audio(start=start, sample_rate=96_000), EPOCH + 12 * 3600 * NANO)],
        description_text=described(sample_rate=96_000),
    )
    session = read_session(path)
    assert [block.start for _, block in session.decoded("/audio")] == [start]
    assert not session.malformed


def bombed(path: Path, packed: bytes, size: int, compression: str, count: int = 1) -> Path:
    """Write a sound session with chunks before its own that unpack to, or claim, `size` bytes each."""
    content = forge(path).read_bytes()
    name = compression.encode()
    body = struct.pack("<QQQI", EPOCH, EPOCH, size, 0) + struct.pack("<I", len(name)) + name
    body += struct.pack("<Q", len(packed)) + packed
    at = next(each.offset for each in chunks.records(memoryview(content)) if each.opcode == chunks.CHUNK)
    chunk = struct.pack("<BQ", chunks.CHUNK, len(body)) + body
    path.write_bytes(content[:at] + chunk * count + content[at:])
    return path


def zeros(size: int) -> bytes:
    """Return a zstd frame of zeros: blocks of 128 KiB, each a length and the byte that is repeated."""
    head = b"\x28\xb5\x2f\xfd\xe0" + struct.pack("<Q", size)
    block = ((1 << 17) << 3 | 1 << 1).to_bytes(3, "little") + b"\0"
    last = ((1 << 17) << 3 | 1 << 1 | 1).to_bytes(3, "little") + b"\0"
    return head + block * ((size >> 17) - 1) + last


def lz4_zeros(size: int) -> bytes:
    import lz4.frame

    return lz4.frame.compress(bytes(size))


def bombs() -> dict[str, tuple[bytes, int, str, int]]:
    """Return chunks by name: what is packed, the size that is claimed, the compression, how many of them."""
    lz4 = lz4_zeros(1 << 28)
    return {
        "zstd of 1 GiB": (zeros(1 << 30), 1 << 30, "zstd", 1),
        "zstd of 1 GiB that claims little": (zeros(1 << 30), 1 << 20, "zstd", 1),
        "zstd of 16 MiB, many times": (zeros(1 << 24), 1 << 24, "zstd", 1000),
        "zstd that claims everything": (b"\x28\xb5\x2f\xfd", 2**64 - 1, "zstd", 100),
        "lz4 of 256 MiB": (lz4, 1 << 28, "lz4", 1),
        "lz4 of 256 MiB that claims little": (lz4, 1 << 20, "lz4", 1),
        "nothing that claims GBs, many times": (b"", 1 << 32, "zstd", 10_000),
        "a compression of its own": (b"", 0, "x" * 1000, 1),
        "plain bytes that claim GBs": (bytes(1000), 1 << 40, "", 10),
    }


CHILD = """
import resource, sys
from tests.sessions.test_forged import read_all, limit_memory
from monochord.core.errors import InputError
from pathlib import Path
limit_memory()
for name in sys.argv[1:]:
    try:
        session = read_all(Path(name))
    except InputError:
        print("refused", resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
    else:
        print(session.damaged, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
"""


def limit_memory() -> None:
    """Let this process take no more than `MEMORY` beside what it has."""
    taken = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (taken + MEMORY, taken + MEMORY))


def test_no_compressed_chunk_takes_memory_that_is_not_due(tmp_path: Path) -> None:
    assert zstandard.decompress(zeros(1 << 20)) == bytes(1 << 20)
    chunks = bombs()
    paths = [bombed(tmp_path / f"{k}.mcap", *args) for k, args in enumerate(chunks.values())]
    paths.append(forge(tmp_path / "gap.mcap", [Forgery("/audio", audio(start=44100 * 600_000))]))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        [sys.executable, "-c", CHILD, *map(str, paths)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 30.0  # s
    outcomes = dict(
        zip([*chunks, "gap"], (line.split()[0] for line in done.stdout.splitlines()), strict=True)
    )
    refused = {name for name, word in outcomes.items() if word == "refused"}
    assert refused == {
        "zstd of 1 GiB",
        "zstd of 16 MiB, many times",
        "zstd that claims everything",
        "lz4 of 256 MiB",
        "nothing that claims GBs, many times",
        "gap",
    }
    assert all(int(word) > 0 for name, word in outcomes.items() if name not in refused)


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_silence_that_was_compressed_by_others_is_read(tmp_path: Path, compression: CompressionType) -> None:
    blocks = [audio(start=4410 * k, samples=np.zeros(8820, np.float32)) for k in range(400)]
    messages = [Forgery("/audio", block, EPOCH + k * NANO // 10) for k, block in enumerate(blocks)]
    session = read_session(forge(tmp_path / "a.mcap", messages, compression=compression))
    assert session.audio.samples.shape == (2, 400 * 4410)
    assert session.audio.samples.nbytes < ALWAYS_UNPACKED
    assert not session.damaged


def test_a_gap_longer_than_a_session_is_no_gap(tmp_path: Path) -> None:
    last = round(MAX_DURATION * 44100)
    session = read_session(forge(tmp_path / "a.mcap", [SOUND[0], Forgery("/audio", audio(start=last))]))
    assert session.audio.samples.shape == (2, 441)
    assert "/audio" in session.malformed
