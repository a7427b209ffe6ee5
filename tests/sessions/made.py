"""Sessions made for tests: every kind of content, from a seed."""

from pathlib import Path

import numpy as np

from monochord.core.types import POSE, WRENCH, Block, Feed, Readings
from monochord.sessions import Description, SessionClock, SessionWriter

RATE = 44100
EPOCH = 1_700_000_000_123_456_789
FEEDS = (
    Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3, rate=1000.0, ticks=7000.0),
    Feed(stream="pose", columns=POSE, units=("m",) * 3 + ("",) * 4, rate=250.0, ticks=1e9),
    Feed(stream="oven", columns=("temperature", "door"), units=("K", ""), details={"address": "here"}),
)


def description(**more: object) -> Description:
    fields = {
        "name": "made",
        "sample_rate": RATE,
        "simulated": True,
        "feeds": FEEDS,
        "plan": "title = 'made'\n",
    }
    return Description(**{**fields, **more})  # pyright: ignore[reportArgumentType]


def block(k: int, samples: np.ndarray, *, start: int, dropped: int = 0) -> Block:
    return Block(
        samples=samples, start=start, dropped=dropped, adc_time=100.0 + start / RATE, frame_time=start + 7
    )


def plain_readings(
    stream: str, time: np.ndarray, values: np.ndarray, *, sequence: np.ndarray | None = None, status: int = 0
) -> Readings:
    """Readings without a device's clock, and without counts unless given."""
    none = np.full(len(time), -1)
    return Readings(
        stream=stream,
        time=time,
        values=values,
        sequence=none if sequence is None else sequence,
        device_time=none,
        status=np.full(len(time), status, np.uint32),
    )


def readings(
    stream: str, first: int, count: int, columns: int, rate: float, random: np.random.Generator
) -> Readings:
    index = np.arange(first, first + count)
    status = np.zeros(count, np.uint32)
    if stream != "pose":
        status[index % 97 == 5] = 1 << 31
    return Readings(
        stream=stream,
        time=100.0 + index / rate,
        values=random.standard_normal((count, columns)),
        sequence=index.astype(np.int64),
        device_time=EPOCH + np.rint(index * 1e9 / rate).astype(np.int64) if stream == "pose" else 7 * index,
        status=status,
    )


def make(path: Path, *, seconds: float = 2.0, seed: int = 0, close: bool = True) -> SessionWriter:
    """Write a session with a gap of 100 frames in its middle."""
    random = np.random.default_rng(seed)
    writer = SessionWriter(path, description(seed=seed), SessionClock(epoch_ns=EPOCH, origin=100.0))
    steps, start = round(seconds * 100), 0
    for k in range(steps):
        lost = 100 * (k == steps // 2)
        start += lost
        samples = random.standard_normal((2, 441)).astype(np.float32)
        writer.audio(block(k, samples, start=start, dropped=lost))
        start += 441
        writer.readings(readings("wrench", 10 * k, 10, 6, 1000.0, random))
        writer.readings(readings("pose", 2 * k, 2, 7, 200.0, random))
        writer.readings(readings("oven", k, 1, 2, 100.0, random))
        time = 100.0 + 0.01 * k + np.arange(10) / 1000
        place = np.where(np.arange(10) < 5, np.nan, 0.08)
        writer.labels(time, {"contact": np.ones(10), "position": place})
        if k % 50 == 0:
            writer.event(100.0 + 0.01 * k, "phase", "press", n=k, soft=True)
            writer.clocks(100.0 + 0.01 * k, {"realtime": 1.5e9 + k, "jack": 0.25})
        if k % 20 == 19:
            writer.flush()
    if close:
        writer.close()
    return writer


def as_killed(writer: SessionWriter) -> None:
    """Leave a session as a kill leaves it: with what was flushed, and nobody who writes it."""
    left = writer.path.read_bytes()
    writer.close()
    writer.path.write_bytes(left)
