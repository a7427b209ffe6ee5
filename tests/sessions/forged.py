"""Sessions that no writer of ours makes: written with the `mcap` library, a field or a byte at a time."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer
from tests.sessions.made import EPOCH, FEEDS, RATE, description

from monochord.sessions import codec
from monochord.sessions._layout import BEGIN, END

NANO = 10**9


@dataclass(frozen=True)
class Forgery:
    """A message of a topic: its bytes, and the times in its record."""

    topic: str
    data: bytes
    log_time: int = EPOCH
    sequence: int = 0


def audio(**fields: Any) -> bytes:
    defaults = {
        "header": codec.header(EPOCH),
        "start": 0,
        "dropped": 0,
        "timed": True,
        "frame_time": 7,
        "sample_rate": RATE,
        "channels": 2,
        "samples": np.zeros(882, np.float32),
    }
    return codec.encode(codec.AUDIO, **{**defaults, **fields})


def wrenches(**fields: Any) -> bytes:
    defaults = {
        "header": codec.header(EPOCH),
        "arrival": EPOCH + np.arange(10) * NANO // 1000,
        "sequence": np.arange(10),
        "device_time": 7 * np.arange(10),
        "status": np.zeros(10, np.uint32),
        "force": np.zeros(30),
        "torque": np.zeros(30),
    }
    return codec.encode(codec.WRENCHES, **{**defaults, **fields})


def oven(**fields: Any) -> bytes:
    defaults = {
        "header": codec.header(EPOCH),
        "columns": ["temperature", "door"],
        "arrival": np.array([EPOCH, EPOCH + NANO]),
        "sequence": np.arange(2),
        "device_time": np.arange(2),
        "status": np.zeros(2, np.uint32),
        "values": np.zeros(4),
    }
    return codec.encode(codec.READINGS, **{**defaults, **fields})


def labels(**fields: Any) -> bytes:
    defaults = {
        "header": codec.header(EPOCH),
        "columns": ["contact"],
        "time": np.array([EPOCH, EPOCH + NANO]),
        "values": np.zeros(2),
    }
    return codec.encode(codec.LABELS, **{**defaults, **fields})


def event(**fields: Any) -> bytes:
    defaults = {"header": codec.header(EPOCH), "kind": "note", "text": "", "data": "{}"}
    return codec.encode(codec.EVENT, **{**defaults, **fields})


def clocks(**fields: Any) -> bytes:
    defaults = {"header": codec.header(EPOCH), "names": ["jack"], "offsets": np.zeros(1)}
    return codec.encode(codec.CLOCKS, **{**defaults, **fields})


SOUND = (
    Forgery("/audio", audio()),
    Forgery("/audio", audio(start=441), EPOCH + NANO // 100),
    Forgery("/wrench", wrenches()),
    Forgery("/pose", codec.encode_pose(EPOCH, np.array([0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]))),
    Forgery("/oven", oven()),
    Forgery("/labels", labels()),
    Forgery("/events", event()),
    Forgery("/clocks", clocks()),
)
"""A session that is as it should be, one message or two of each topic."""


def forge(
    path: Path,
    messages: Iterable[Forgery] = SOUND,
    *,
    begin: dict[str, str] | None = None,
    description_text: str | None = None,
    end: dict[str, str] | None = None,
    compression: CompressionType = CompressionType.NONE,
    chunk_size: int = 1 << 20,
) -> Path:
    """Write a session of any messages; `begin` replaces entries of its metadata."""
    text = description().dump() if description_text is None else description_text
    metadata = {"format": "1", "epoch_ns": str(EPOCH), "origin": "100.0", "description": text}
    types = codec.TOPICS | {codec.topic_of(feed.stream): codec.type_of(feed) for feed in FEEDS}
    with path.open("wb") as file:
        writer = Writer(file, compression=compression, chunk_size=chunk_size)
        writer.start(profile="ros2", library="forged")
        writer.add_metadata(BEGIN, {**metadata, **(begin or {})})
        schemas = {
            kind: writer.register_schema(kind, "ros2msg", codec.definition(kind).encode())
            for kind in dict.fromkeys(types.values())
        }
        channels = {
            topic: writer.register_channel(topic, "cdr", schemas[kind]) for topic, kind in types.items()
        }
        for each in messages:
            writer.add_message(
                channels[each.topic],
                log_time=each.log_time,
                publish_time=each.log_time,
                sequence=each.sequence,
                data=each.data,
            )
        if end is not None:
            writer.add_metadata(END, end)
        writer.finish()
    return path


def described(**changes: Any) -> str:
    """Return a description as text, with entries of its tree replaced."""
    return json.dumps({**json.loads(description().dump()), **changes})
