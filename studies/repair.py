"""What is read of damaged sessions: by the mcap library, in every chunk it can unpack, after our repair.

Makes the table of `docs/design/sessions.md`, in some two minutes: ``python -m studies.repair``.
"""

import mmap
import os
import resource
import signal
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from io import BytesIO
from pathlib import Path

import click
import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata
from mcap.stream_reader import StreamReader, breakup_chunk
from studies._command import lines_of, main, progress_bar

from monochord.core.errors import MonochordError
from monochord.core.types import WRENCH, Block, Feed, Readings
from monochord.core.units import Seconds
from monochord.sessions import Description, SessionClock, SessionWriter, codec, read_session, recover

RATE = 44100
FLUSH: Seconds = 0.1
FRAMES, COUNT = round(FLUSH * RATE), 100
"""Frames of audio and readings of force in a chunk."""
PAGE = 4096
Counts = tuple[int, int]
"""Frames of audio, readings."""
FEEDS = (Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3, rate=COUNT / FLUSH),)


def record(path: Path, seconds: Seconds, seed: int = 0, done: "mmap.mmap | None" = None) -> None:
    """Record noise and forces, a chunk each 0.1 s; `done` is told how many are flushed."""
    rng = np.random.default_rng(seed)
    with SessionWriter(
        path, Description(name="noise", sample_rate=RATE, feeds=FEEDS), SessionClock(epoch_ns=10**18)
    ) as writer:
        for k in range(round(seconds / FLUSH)):
            samples = rng.standard_normal((2, FRAMES)).astype(np.float32)
            writer.audio(Block(samples=samples, start=k * FRAMES, adc_time=k * FLUSH))
            index = np.arange(k * COUNT, (k + 1) * COUNT)
            writer.readings(
                Readings(
                    stream="wrench",
                    time=index * FLUSH / COUNT,
                    values=rng.standard_normal((COUNT, len(WRENCH))),
                    sequence=index,
                    device_time=index,
                    status=np.zeros(COUNT, np.uint32),
                )
            )
            writer.flush()
            if done is not None:
                done[:8] = (k + 1).to_bytes(8, "little")


def library_records(content: bytes) -> Iterator[McapRecord]:
    """Yield what the mcap library reads up to its first error."""
    with suppress(Exception):
        yield from StreamReader(BytesIO(content), emit_chunks=True, record_size_limit=1 << 30).records


def chunk_records(content: bytes) -> Iterator[McapRecord]:
    """Yield metadata that the mcap library reads, and each chunk, wherever it begins, that it can unpack."""
    yield from (each for each in library_records(content) if isinstance(each, Metadata))
    at = 0
    while (at := content.find(bytes([Opcode.CHUNK]), at + 1)) >= 0:
        length = int.from_bytes(content[at + 1 : at + 9], "little")
        if length > len(content) - at - 9:
            continue
        with suppress(Exception):
            chunk = Chunk.read(ReadDataStream(BytesIO(content[at + 9 : at + 9 + length])))
            if chunk.uncompressed_crc and breakup_chunk(chunk, validate_crc=True):
                yield chunk
                at += 8 + length


def counted(records: Iterator[McapRecord]) -> Counts:
    """Return what is in chunks whose checksum is right; nothing where no description came with them."""
    topics: dict[int, str] = {}
    frames = readings = 0
    described = False
    for each in records:
        described |= isinstance(each, Metadata) and each.name == "monochord"
        inner: list[McapRecord] = []
        with suppress(Exception):
            inner = breakup_chunk(each, validate_crc=True) if isinstance(each, Chunk) else []
        for record_ in inner:
            if isinstance(record_, Channel):
                topics[record_.id] = record_.topic
            elif isinstance(record_, Message):
                topic = topics.get(record_.channel_id)
                described |= topic == "/description"
                if topic == "/audio":
                    frames += len(codec.decode(codec.AUDIO, memoryview(record_.data)).samples) // 2
                elif topic == "/wrench":
                    readings += len(codec.decode(codec.WRENCHES, memoryview(record_.data)).arrival)
    return (frames, readings) if described else (0, 0)


def repaired(content: bytes, folder: Path) -> Counts:
    """Return what is read of a session after Monochord's repair."""
    path = folder / "damaged.mcap"
    path.write_bytes(content)
    try:
        recover(path)
        session = read_session(path)
        lost = sum(stop - first for first, stop in session.audio.gaps)
        return session.audio.samples.shape[1] - lost, len(session.readings("wrench").time)
    except MonochordError:
        return 0, 0
    finally:
        for each in folder.glob("damaged.mcap*"):
            each.unlink()


def in_child(run: Callable[[], None]) -> int:
    """Fork and run; return the child's number."""
    child = os.fork()
    if child == 0:
        with suppress(BaseException):
            run()
        os._exit(0)
    return child


def killed(folder: Path, rng: np.random.Generator) -> tuple[bytes, Counts]:
    """Return what a recorder leaves that is killed at a random moment, and what it had flushed."""
    path, done = folder / "killed.mcap", mmap.mmap(-1, 8)
    child = in_child(lambda: record(path, 3600.0, done=done))
    while not done[0]:
        time.sleep(0.001)
    time.sleep(float(rng.uniform(0.0, 0.1)))
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    content, chunks = path.read_bytes(), int.from_bytes(done[:8], "little")
    path.unlink()
    return content, (chunks * FRAMES, chunks * COUNT)


def full(folder: Path, rng: np.random.Generator) -> tuple[bytes, Counts]:
    """Return what a recorder leaves where no file may be larger than some size."""
    path, done = folder / "full.mcap", mmap.mmap(-1, 8)
    limit = int(rng.integers(3_000_000, 4_000_000))

    def run() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
        record(path, 3600.0, done=done)

    os.waitpid(in_child(run), 0)
    content, chunks = path.read_bytes(), int.from_bytes(done[:8], "little")
    path.unlink()
    return content, (chunks * FRAMES, chunks * COUNT)


def damages(content: bytes, rng: np.random.Generator) -> dict[str, Callable[[], bytes]]:
    """Return by name what makes a damaged copy, at another place in each call."""
    starts: list[int] = []
    at = 8
    while at < len(content):
        starts.append(at)
        at += 9 + int.from_bytes(content[at + 1 : at + 9], "little")
        if content[starts[-1]] == Opcode.FOOTER:
            break
    chunks = [each for each in starts if content[each] == Opcode.CHUNK]
    behind = starts[starts.index(chunks[-1]) + 1]
    indices = [each for each in starts if content[each] == Opcode.MESSAGE_INDEX]

    def flipped(place: int) -> bytes:
        return content[:place] + bytes([content[place] ^ int(rng.integers(1, 256))]) + content[place + 1 :]

    def zeroed() -> bytes:
        page = PAGE * int(rng.integers(len(content) // PAGE))
        return content[:page] + bytes(PAGE) + content[page + PAGE :]

    return {
        "truncated at a random byte": lambda: content[: int(rng.integers(chunks[1], len(content)))],
        "a flipped byte": lambda: flipped(int(rng.integers(len(content)))),
        "a zeroed page of 4 KiB": zeroed,
        "a flipped byte before the second chunk": lambda: flipped(int(rng.integers(chunks[1]))),
        "a flipped byte in a chunk's head": lambda: flipped(int(rng.choice(chunks[1:]) + rng.integers(49))),
        "a flipped byte in an index": lambda: flipped(int(rng.choice(indices) + rng.integers(31))),
        "a flipped byte behind the last chunk": lambda: flipped(int(rng.integers(behind, len(content)))),
    }


def measured(seconds: Seconds, number: int, seed: int) -> list[list[str]]:
    """Return a line for each damage: what there was, what each way reads, how often it reads nothing."""
    rng = np.random.default_rng(seed)
    lines: list[list[str]] = []
    with tempfile.TemporaryDirectory() as name, progress_bar("sessions") as progress:
        folder = Path(name)
        record(folder / "whole.mcap", seconds, seed)
        content = (folder / "whole.mcap").read_bytes()
        chunks = round(seconds / FLUSH)
        whole = chunks * FRAMES, chunks * COUNT
        cases: dict[str, Callable[[], tuple[bytes, Counts]]] = {
            "kill -9": lambda: killed(folder, rng),
            "no more space": lambda: full(folder, rng),
        }
        for what, damage in damages(content, rng).items():
            cases[what] = lambda damage=damage: (damage(), whole)
        for what, case in cases.items():
            found = np.zeros((number, 4, 2), int)
            for k in range(number):
                damaged, there = case()
                found[k] = (
                    there,
                    counted(library_records(damaged)),
                    counted(chunk_records(damaged)),
                    repaired(damaged, folder),
                )
                progress(what, k + 1, number)
            means = (f"{each:.0f}" for each in found.mean(axis=0).T.ravel())
            lines.append([what, *means, *(f"{(found[:, way, 0] == 0).sum()}" for way in range(1, 4))])
    return lines


@click.command()
@click.option("--seconds", default=3.0, show_default=True, help="Length of the session that is damaged.")
@click.option("--number", default=100, show_default=True, help="Damaged sessions of each kind.")
@click.option("--seed", default=0, show_default=True, help="Random seed.")
def repair(seconds: float, number: int, seed: int) -> None:
    """Print how many frames and readings each way recovers of damaged sessions, and of how many nothing."""
    ways = ("library", "chunks", "repair")
    for line in lines_of(
        ("damage", "frames", *ways, "readings", *ways, *ways), measured(seconds, number, seed)
    ):
        print(line)


if __name__ == "__main__":
    main(repair)
