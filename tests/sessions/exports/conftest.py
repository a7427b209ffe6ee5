"""Sessions of everything that a session can hold, drawn at random, and how to compare two of them."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.types import POSE, WRENCH, Block, Feed, Readings, StringParams
from monochord.sessions import Description, SessionClock, SessionReader, SessionWriter, read_session

RATE = 16000
TEXTS = ("", "plain", 'a "quoted", text', "zwei\nZeilen\r\nund Ümläute", "=1+1", " space ", "over\rwritten")
FEEDS = (
    Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3, rate=7000.0, ticks=7000.0),
    Feed(stream="pose", columns=POSE, units=("m",) * 3 + ("",) * 4, rate=250.0, ticks=1e9),
    Feed(stream="odd", columns=("time", "status", "a,b"), units=("s", "", "1"), details={"k": "v"}),
)


def write(path: Path, seed: int, *, seconds: float = 1.0, close: bool = True, full: bool = False) -> Path:
    """Write a session of random content with gaps, odd numbers, odd texts and unknown values."""
    rng = np.random.default_rng(seed)
    channels = int(rng.integers(1, 3))
    feeds = FEEDS[: len(FEEDS) if full else int(rng.integers(0, len(FEEDS) + 1))]
    description = Description(
        name=f"session {seed}",
        sample_rate=RATE,
        channels=channels,
        simulated=bool(rng.integers(2)),
        sensor={"length": 0.2, "names": ["a", "b"]},
        string=StringParams(length=0.65, linear_density=6.5e-4, tension=65.0),
        object="plastic",
        radius=float(rng.uniform(1e-3, 1e-2)),
        preamp_gains=(20.0, 19.5),
        day=3,
        seed=seed,
        plan='title = "plan"\n',
        notes=str(rng.choice(TEXTS)),
        feeds=feeds,
        more={"operator": "Ümit"},
    )
    origin = float(rng.choice([0.0, rng.uniform(0.0, 1e6)]))
    clock = SessionClock(epoch_ns=int(rng.integers(0, 2 * 10**18)), origin=origin)
    writer = SessionWriter(path, description, clock)
    start = 0
    while start < seconds * RATE:
        frames = int(rng.choice([1, 64, 512, 3000]))
        lost = int(rng.choice([0, 0, 0, 1, 777]))
        start += lost
        bits = rng.integers(0, 2**32, (channels, frames), dtype=np.uint32)
        timed = rng.random() < 0.9
        writer.audio(
            Block(
                samples=bits.view(np.float32)
                if rng.random() < 0.2
                else rng.normal(size=bits.shape).astype("f4"),
                start=start,
                dropped=lost,
                adc_time=origin + start / RATE + 1e-4 * rng.normal() if timed else None,
                frame_time=int(rng.integers(0, 2**32)) if timed else None,
            )
        )
        start += frames
        for feed in feeds:
            writer.readings(_readings(rng, feed, origin + start / RATE))
        if rng.random() < 0.3:
            writer.clocks(origin + start / RATE, {"realtime": rng.normal(), "jack": rng.normal()})
        if rng.random() < 0.3:
            writer.event(
                origin + start / RATE, "note", str(rng.choice(TEXTS)), force=rng.normal(), tap=True, n=1
            )
        if rng.random() < 0.5:
            times = origin + (start + np.arange(5)) / RATE
            columns = {
                "contact": np.ones(5),
                "position": np.where(rng.random(5) < 0.5, np.nan, rng.normal(size=5)),
            }
            writer.labels(times, columns if rng.random() < 0.5 else {**columns, "own": np.full(5, -0.0)})
        if rng.random() < 0.2:
            writer.flush()
    if close:
        writer.close()
    else:
        writer.flush()
        writer._file.close()
    return path


def _readings(rng: np.random.Generator, feed: Feed, time: float) -> Readings:
    count = int(rng.integers(0, 300))
    values = rng.normal(size=(count, len(feed.columns))) * 10.0 ** rng.integers(-300, 300, (count, 1))
    values[rng.random(values.shape) < 0.01] = np.nan
    values[rng.random(values.shape) < 0.01] = np.inf
    return Readings(
        stream=feed.stream,
        time=time + np.sort(rng.random(count)) * 0.1,
        values=values,
        sequence=rng.integers(-1, 2**31, count),
        device_time=rng.integers(-1, 2**60, count),
        status=rng.integers(0, 2**32, count, dtype=np.uint32),
    )


def assert_equal(one: SessionReader, other: SessionReader) -> None:
    """Fail where two sessions differ in anything that a reader can see, to the bit."""
    assert one.description == other.description
    assert one.clock == other.clock
    assert one.audio.samples.tobytes() == other.audio.samples.tobytes()
    assert one.audio.gaps == other.audio.gaps
    pairs: list[tuple[Any, Any]] = [
        (getattr(one.audio, name), getattr(other.audio, name))
        for name in ("anchor_frame", "anchor_time", "device_frame")
    ]
    for stream in one.streams:
        ours, theirs = one.readings(stream), other.readings(stream)
        assert ours.feed == theirs.feed
        names = ("time", "values", "sequence", "device_time", "status")
        pairs += [(getattr(ours, name), getattr(theirs, name)) for name in names]
    for ours, theirs in (
        (one.labels.columns, other.labels.columns),
        (one.clocks.offsets, other.clocks.offsets),
    ):
        assert set(ours) == set(theirs)
        pairs += [(ours[name], theirs[name]) for name in ours]
    pairs += [(one.labels.time, other.labels.time), (one.clocks.time, other.clocks.time)]
    for ours, theirs in pairs:
        assert ours.dtype == theirs.dtype
        np.testing.assert_array_equal(ours, theirs)
    assert one.events == other.events


@pytest.fixture(scope="session")
def write_random() -> Callable[..., Path]:
    return write


@pytest.fixture(scope="session")
def assert_same() -> Callable[[Path, Path], None]:
    return lambda one, other: assert_equal(read_session(one), read_session(other))
