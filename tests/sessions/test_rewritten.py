"""Sessions that other programs wrote anew: the content is the same, and nothing of them is damaged."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from mcap.writer import CompressionType, IndexType, Writer
from tests.sessions.made import make

from monochord.core.errors import InputError
from monochord.sessions import SessionReader, check, read_session, recover
from monochord.sessions._layout import GUARD, TOTALS, guarded

Entry = tuple[Schema | None, Channel, Message]
Order = Callable[[list[Entry]], list[Entry]]


def rewrite(
    source: Path,
    out: Path,
    *,
    order: Order = list,
    library: str = "other tool",
    metadata: bool = True,
    older: bool = False,
    **how: Any,
) -> Path:
    """Write a session as other programs do: channels and schemas numbered anew, metadata at the end.

    `older` leaves out what sessions of older versions of ours did not have.
    """
    with source.open("rb") as file, out.open("wb") as to:
        reader, writer = make_reader(file), Writer(to, **how)
        writer.start(profile="ros2", library=library)
        schemas: dict[int, int] = {}
        channels: dict[int, int] = {}
        for schema, channel, message in order([*reader.iter_messages(log_time_order=True)]):
            assert schema
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if channel.id not in channels:
                kind = schemas[schema.id]
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, kind)
            writer.add_message(
                channels[channel.id],
                log_time=message.log_time,
                data=message.data,
                publish_time=message.publish_time,
                sequence=message.sequence,
            )
        for each in reader.iter_metadata() if metadata else ():
            values = each.metadata
            if older and TOTALS in values:
                values = guarded({name: v for name, v in values.items() if name not in (TOTALS, GUARD)})
            writer.add_metadata(each.name, values)
        writer.finish()
    return out


def by_topic(entries: list[Entry]) -> list[Entry]:
    return sorted(entries, key=lambda each: each[1].topic)


def backwards(entries: list[Entry]) -> list[Entry]:
    return entries[::-1]


def shuffled(entries: list[Entry]) -> list[Entry]:
    return [entries[k] for k in np.random.default_rng(0).permutation(len(entries))]


NONE = CompressionType.NONE
WAYS: dict[str, dict[str, Any]] = {
    "without chunks": {"use_chunking": False},
    "zstd": {},
    "lz4": {"compression": CompressionType.LZ4},
    "without compression": {"compression": NONE},
    "small chunks": {"compression": NONE, "chunk_size": 20_000},
    "chunk index only": {"index_types": IndexType.CHUNK},
    "small chunks without an index": {"chunk_size": 20_000, "index_types": IndexType.NONE},
    "no summary": {
        "index_types": IndexType.NONE,
        "use_statistics": False,
        "use_summary_offsets": False,
        "repeat_channels": False,
        "repeat_schemas": False,
    },
    "by topic": {"order": by_topic, "chunk_size": 20_000},
    "reversed": {"order": backwards, "chunk_size": 20_000},
    "reversed without chunks": {"order": backwards, "use_chunking": False},
    "shuffled": {"order": shuffled},
    "our name kept": {"library": "monochord", "compression": NONE},
    "our name kept, reversed": {"library": "monochord", "order": backwards, "chunk_size": 20_000},
    "a name as long as ours": {"library": "othertool", "compression": NONE},
}


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session whose last event is told later than it happened, and two of the same time."""
    path = tmp_path_factory.mktemp("original") / "a.mcap"
    with make(path, seconds=0.6, close=False) as writer:
        for n in range(2):
            writer.event(100.55, "note", "late", n=n)
        writer.event(100.05, "note", "later still")
    return path


def refuse_other_content(session: SessionReader, other: SessionReader, *, ties: bool = True) -> None:
    """Check that two sessions hold the same; with `ties`, also in which order equal times stand."""
    assert session.description == other.description
    assert session.clock.epoch_ns == other.clock.epoch_ns
    assert np.array_equal(session.audio.samples, other.audio.samples)
    assert session.audio.gaps == other.audio.gaps
    for stream in other.streams:
        one, two = session.readings(stream), other.readings(stream)
        assert np.array_equal(one.values, two.values)
        assert np.array_equal(one.time, two.time)
        assert np.array_equal(one.sequence, two.sequence)
    for name, column in other.labels.columns.items():
        assert np.array_equal(session.labels.columns[name], column, equal_nan=True)
    assert np.array_equal(session.clocks.offsets["realtime"], other.clocks.offsets["realtime"])
    if ties:
        assert session.events == other.events
    else:
        assert {str(each) for each in session.events} == {str(each) for each in other.events}


@pytest.mark.parametrize("way", WAYS)
def test_the_content_is_the_same_and_nothing_is_damaged(original: Path, tmp_path: Path, way: str) -> None:
    path = rewrite(original, tmp_path / "b.mcap", **WAYS[way])
    before = path.read_bytes()
    refuse_other_content(read_session(path), read_session(original), ties=way != "shuffled")
    report, due = check(path), check(original)
    assert (report.faults, report.remarks) == ((), due.remarks)
    assert (report.content_checksum, report.messages) == (due.content_checksum, due.messages)
    assert not recover(path).repaired
    assert path.read_bytes() == before


def test_a_session_of_an_older_version_is_compared_too(tmp_path: Path) -> None:
    make(tmp_path / "a.mcap", seconds=0.3)
    assert check(rewrite(tmp_path / "a.mcap", tmp_path / "b.mcap", older=True, **WAYS["by topic"])).sound


@pytest.mark.parametrize("way", ["reversed", "without chunks"])
def test_without_metadata_the_description_is_found_and_the_check_says_what_it_lacks(
    original: Path, tmp_path: Path, way: str
) -> None:
    path = rewrite(original, tmp_path / "b.mcap", metadata=False, **WAYS[way])
    refuse_other_content(read_session(path), read_session(original))
    report = check(path)
    assert report.sound
    assert len(report.remarks) == len(check(original).remarks) + 1
    assert not recover(path).repaired


def test_content_that_was_changed_is_bad_and_no_repair_is_proposed(original: Path, tmp_path: Path) -> None:
    def without_sound(entries: list[Entry]) -> list[Entry]:
        return [each for each in entries if each[1].topic != "/audio"]

    path = rewrite(original, tmp_path / "b.mcap", order=without_sound)
    report = check(path)
    assert len(report.faults) == 1
    assert "/audio" in report.faults[0]
    assert not recover(path).repaired


@pytest.mark.parametrize(("way", "share"), [("small chunks", 0.35), ("without chunks", 0.8)])
def test_what_is_whole_of_one_that_was_cut_stays(
    original: Path, tmp_path: Path, way: str, share: float
) -> None:
    path = rewrite(original, tmp_path / "b.mcap", **WAYS[way])
    content = path.read_bytes()
    path.write_bytes(content[: round(share * len(content))])
    whole = read_session(original).audio.samples
    before = read_session(path).audio.samples
    assert before.shape[1] > (share - 0.2) * whole.shape[1]
    assert np.array_equal(whole[:, : before.shape[1]], before)
    assert any("sessions recover" in fault for fault in check(path).faults)
    done = recover(path)
    assert done.repaired
    assert np.array_equal(read_session(path).audio.samples, before)
    assert check(path).sound
    with path.open("rb") as file:
        assert sum(1 for _ in make_reader(file).iter_messages()) == done.messages


@pytest.mark.parametrize(
    ("which", "compression"), [(0, NONE), (3, CompressionType.ZSTD), (3, CompressionType.LZ4)]
)
def test_damage_costs_its_chunk_alone(
    original: Path, tmp_path: Path, which: int, compression: CompressionType
) -> None:
    path = rewrite(original, tmp_path / "b.mcap", compression=compression, chunk_size=20_000)
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary
    index = summary.chunk_indexes[which]
    content = bytearray(path.read_bytes())
    content[index.chunk_start_offset + index.chunk_length - 100] ^= 4
    path.write_bytes(content)
    assert "1 damaged chunk" in check(path).faults
    recover(path)
    assert check(path).sound
    session, whole = read_session(path), read_session(original)
    assert session.description == whole.description
    wrench = session.readings("wrench").values
    assert 0.7 * 600 < len(wrench) < 600
    assert np.isin(wrench[:, 0], whole.readings("wrench").values[:, 0]).all()


def test_what_cannot_be_unpacked_here_is_not_taken_for_damage(original: Path, tmp_path: Path) -> None:
    path = rewrite(original, tmp_path / "b.mcap", **WAYS["zstd"])
    content = path.read_bytes().replace(b"\x04\0\0\0zstd", b"\x04\0\0\0blz9")
    path.write_bytes(content)
    assert not any("sessions recover" in fault for fault in check(path).faults)
    with pytest.raises(InputError, match=path.name):
        recover(path)
    assert path.read_bytes() == content
