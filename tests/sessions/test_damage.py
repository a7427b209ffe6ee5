"""One flipped bit anywhere in a session: it is noticed, and repair loses at most the chunk it lies in."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from tests.sessions.made import EPOCH, RATE, as_killed, block, description, readings

from monochord.sessions import SessionClock, SessionWriter, check, chunks, read_session, recover

FLUSH = 0.1
LOST = 0.5


def record(path: Path, seconds: float) -> SessionWriter:
    """Write noise and readings as the recorder does, a chunk each tenth of a second."""
    random = np.random.default_rng(1)
    frames = round(FLUSH * RATE)
    writer = SessionWriter(path, description(), SessionClock(epoch_ns=EPOCH, origin=100.123456))
    for k in range(round(seconds / FLUSH)):
        samples = random.standard_normal((2, frames)).astype(np.float32)
        writer.audio(block(k, samples, start=frames * k))
        writer.readings(readings("wrench", 100 * k, 100, 6, 1000.0, random))
        writer.readings(readings("oven", 10 * k, 10, 2, 100.0, random))
        if k % 10 == 0:
            writer.clocks(100 + FLUSH * k, {"realtime": 1.5e9})
            writer.event(100 + FLUSH * k, "phase", "press", n=k)
        writer.flush()
    return writer


def sound_frames(path: Path, whole: np.ndarray) -> int:
    """Return how many frames of `whole` a session has; those it has must be the same."""
    audio = read_session(path).audio
    there = np.zeros(whole.shape[1], bool)
    there[: audio.samples.shape[1]] = True
    for first, stop in audio.gaps:
        there[first:stop] = False
    assert np.array_equal(audio.samples[:, there[: audio.samples.shape[1]]], whole[:, there])
    return int(there.sum())


def frames_by_mcap(path: Path) -> int:
    """Read every record in the order of the file, and the audio by way of the index, with another library."""
    with path.open("rb") as file:
        assert sum(1 for _ in StreamReader(file, validate_crcs=True).records) > 0
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        messages = reader.iter_decoded_messages(topics=["/audio"])
        return sum(len(message.samples) for _, _, _, message in messages) // 2


def mend(path: Path, content: bytes, at: int, bit: int, whole: np.ndarray) -> bytes:
    """Flip a bit of a session, repair it, and check what came of it; return the file."""
    for old in path.parent.glob(f"{path.name}*"):
        old.unlink()
    hurt = bytearray(content)
    hurt[at] ^= 1 << bit
    path.write_bytes(hurt)
    report = check(path)
    message = f"bit {bit} of byte {at}: {report.faults}"
    assert not report.sound, message
    assert "was not closed" not in " ".join(report.faults), message
    assert whole.shape[1] - sound_frames(path, whole) <= LOST * RATE, f"read without repair: {message}"
    recovery = recover(path)
    after = check(path)
    assert recovery.repaired, message
    assert after.sound, f"{message}, then {after.faults}"
    frames = sound_frames(path, whole)
    assert whole.shape[1] - frames <= LOST * RATE, message
    assert frames_by_mcap(path) == frames, message
    assert recovery.cut, message
    assert hurt[at : at + 1] in recovery.cut.read_bytes(), f"what is gone lies beside: {message}"
    assert not recover(path).repaired, message
    return path.read_bytes()


def aimed(path: Path) -> list[int]:
    """Return places in every kind of record of a session, and in its magic bytes."""
    view = chunks.mapped(path)
    records = list(chunks.records(view))
    found = [record for record in records if record.opcode == chunks.CHUNK]
    few = [*records[:3], *found[:2], found[len(found) // 2], found[-1]]
    few += [record for record in records if record.offset > found[-1].offset]
    places = {*range(8), *range(len(view) - 8, len(view))}
    for record in few:
        places |= {*range(record.offset, min(record.offset + 60, record.end)), record.end - 1}
        if record.opcode == chunks.METADATA:
            places |= {*range(record.offset, record.end, 7)}
    return sorted(places)


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("short") / "short.mcap"
    record(path, 0.8).close()
    return path


def test_a_flipped_bit_is_noticed_and_mended(short: Path, tmp_path: Path) -> None:
    content, whole = short.read_bytes(), read_session(short).audio.samples
    random = np.random.default_rng(0)
    places = [*random.choice(aimed(short), 8, replace=False), *random.integers(0, len(content), 3)]
    for at in places:
        mend(tmp_path / "a.mcap", content, int(at), int(random.integers(8)), whole)


def test_where_the_rest_tells_what_was_there_nothing_is_lost(short: Path, tmp_path: Path) -> None:
    content, whole = short.read_bytes(), read_session(short).audio.samples
    records = list(chunks.records(chunks.mapped(short)))
    chunk = next(r for r in records[8:] if r.opcode == chunks.CHUNK)
    end = next(r for r in reversed(records) if r.opcode == chunks.METADATA)
    index = next(r for r in records[8:] if r.opcode == chunks.MESSAGE_INDEX)
    first = next(r for r in records if r.opcode == chunks.CHUNK)
    places = {
        "magic": 3,
        "profile": records[0].offset + 14,
        "length of the start": records[1].offset + 2,
        "description": content.index(b'"sample_rate"') + 16,
        "plan": next(r for r in records if r.opcode == chunks.ATTACHMENT).end - 10,
        "schema": first.offset + 200,
        "first time of a chunk": chunk.offset + 10,
        "length of an index": index.offset + 1,
        "time in an index": index.offset + 20,
        "name of the end": end.offset + 15,
    }
    for name, at in places.items():
        assert mend(tmp_path / "a.mcap", content, at, 2, whole) == content, name


def test_a_damaged_head_costs_its_chunk_alone(short: Path, tmp_path: Path) -> None:
    path, content, whole = tmp_path / "a.mcap", short.read_bytes(), read_session(short).audio.samples
    chunk = [r for r in chunks.records(chunks.mapped(short)) if r.opcode == chunks.CHUNK][2]
    for name, place in {"opcode": 0, "length": 3, "size": 26, "checksum": 34, "compression": 38}.items():
        mend(path, content, chunk.offset + place, 2, whole)
        assert whole.shape[1] - sound_frames(path, whole) == round(FLUSH * RATE), name


def test_a_session_that_was_cut_off_is_mended_too(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    as_killed(record(path, 1.0))
    content, whole = path.read_bytes(), read_session(path).audio.samples
    found = [r for r in chunks.records(chunks.mapped(path)) if r.opcode == chunks.CHUNK]
    for at in (found[4].offset + 3, found[4].offset + 5000, 2, found[0].offset + 100):
        hurt = bytearray(content)
        hurt[at] ^= 4
        path.write_bytes(hurt[:-1000])
        recovery = recover(path)
        assert check(path).sound
        assert recovery.cut
        frames = sound_frames(path, whole)
        assert whole.shape[1] - frames <= (1 + (at > found[4].offset)) * FLUSH * RATE
        assert frames_by_mcap(path) == frames


def test_data_behind_a_hole_of_many_bytes_is_recovered(short: Path, tmp_path: Path) -> None:
    path, content = tmp_path / "a.mcap", short.read_bytes()
    whole = read_session(short).audio.samples
    found = [r for r in chunks.records(chunks.mapped(short)) if r.opcode == chunks.CHUNK]
    hole = slice(found[3].offset - 700, found[3].offset + 700)
    for filling in (bytes(1400), np.random.default_rng(0).bytes(1400)):
        path.write_bytes(content[: hole.start] + filling + content[hole.stop :])
        assert not check(path).sound
        recovery = recover(path)
        assert check(path).sound
        assert recovery.cut
        assert filling in recovery.cut.read_bytes()
        assert whole.shape[1] - sound_frames(path, whole) <= 2 * FLUSH * RATE
        recovery.cut.unlink()


@pytest.mark.slow
@pytest.mark.timeout(3000)
@pytest.mark.parametrize("kind", ["random", "aimed"])
def test_a_flipped_bit_anywhere_in_twenty_seconds(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "long.mcap"
    record(path, 20.0).close()
    content, whole = path.read_bytes(), read_session(path).audio.samples
    random = np.random.default_rng(0)
    places = random.integers(0, len(content), 200) if kind == "random" else random.choice(aimed(path), 200)
    for at in places:
        mend(tmp_path / "a.mcap", content, int(at), int(random.integers(8)), whole)
