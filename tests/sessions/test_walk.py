from pathlib import Path

from mcap.records import Metadata
from mcap.writer import CompressionType, Writer

from monochord.sessions import walk


def written(path: Path, compression: CompressionType) -> None:
    with path.open("wb") as file:
        writer = Writer(file, compression=compression)
        writer.start()
        schema = writer.register_schema("a", "ros2msg", b"int32 a")
        channel = writer.register_channel("/a", "cdr", schema)
        for k in range(100):
            writer.add_message(channel, log_time=k, data=bytes([k]) * 20, publish_time=2 * k, sequence=3 * k)
        writer.add_metadata("note", {"b": "c"})
        writer.finish()


def test_files_of_any_compression_are_walked(tmp_path: Path) -> None:
    for compression in CompressionType:
        path = tmp_path / compression.name
        written(path, compression)
        records = list(walk.records(walk.mapped(path)))
        assert records[-1].opcode == walk.FOOTER
        (chunk,) = (walk.chunk(r.body) for r in records if r.opcode == walk.CHUNK)
        assert chunk.sound
        messages = [walk.message(b) for op, _, b in walk.inside(chunk.records) if op == walk.MESSAGE]
        assert [m.log_time for m in messages] == list(range(100))
        assert [m.publish_time for m in messages] == list(range(0, 200, 2))
        assert [m.sequence for m in messages] == list(range(0, 300, 3))
        assert bytes(messages[7].data) == bytes([7]) * 20
        assert [r.content for r in records if r.opcode == walk.METADATA] == [Metadata("note", {"b": "c"})]


def test_a_walk_ends_where_the_file_was_cut(tmp_path: Path) -> None:
    path = tmp_path / "a"
    written(path, CompressionType.NONE)
    whole = path.read_bytes()
    ends = [record.end for record in walk.records(walk.mapped(path))]
    for length in range(len(walk.MAGIC), len(whole), 7):
        path.write_bytes(whole[:length])
        record_ends = [record.end for record in walk.records(walk.mapped(path))]
        assert record_ends == [end for end in ends if end <= length]


def test_damage_in_a_compressed_chunk_is_no_error(tmp_path: Path) -> None:
    for compression in (CompressionType.ZSTD, CompressionType.LZ4):
        path = tmp_path / compression.name
        written(path, compression)
        view = bytearray(path.read_bytes())
        body = next(r for r in walk.records(walk.mapped(path)) if r.opcode == walk.CHUNK)
        view[body.end - 20] ^= 0xFF
        assert not walk.chunk(memoryview(view)[body.offset + 9 : body.end]).sound
