"""A bag for Foxglove and rosbag2 with playable sound, force plots and poses."""

import heapq
import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import numpy as np
from msgspec import Meta

from monochord.core.files import written
from monochord.sessions import SessionReader, codec
from monochord.sessions.description import NANO
from monochord.sessions.exports.base import Export, folder_each
from monochord.sessions.tracks import LABELS

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

VERSION = 8
"""Storage format version of the bag, readable by rosbag2 of ROS 2 Iron and newer."""
LAYOUT = "layout.json"
"""The Foxglove layout file."""
AUDIO, WRENCH, LOG = (
    "foxglove_msgs/msg/RawAudio",
    "geometry_msgs/msg/WrenchStamped",
    "rcl_interfaces/msg/Log",
)
RAW_AUDIO = """\
builtin_interfaces/Time timestamp
uint8[] data
string format
uint32 sample_rate
uint32 number_of_channels
"""
"""Foxglove's audio message, playable in its Audio panel: 16 bits, frame by frame."""
FULL_SCALE = 32767
LOUDEST = 1e9  # of a sample before it is clipped, so that no gain overflows
INFO = 20
"""Log level of an event."""
Stamped: TypeAlias = tuple[int, str, bytes]
"""Time in ns since 1970, topic, and the bytes of a message."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Foxglove(Export):
    """One bag per session, readable by Foxglove, rosbag2 and rosbags, plus a Foxglove layout; needs no ROS.

    Each bag is a folder with ``NAME.mcap`` and ``metadata.yaml``. Topics: ``/audio``, Foxglove's RawAudio in
    16 bits, clipped at full scale; each force/torque stream as WrenchStamped, one message per reading,
    stamped at arrival; each pose as PoseStamped, with the sender's stamp; any other stream, and ``/labels``,
    as one message per reading with a field for each column; ``/rosout``, the events as Log; ``/description``.
    The file contains all message definitions. Device clocks, status words and clock offsets are left out:
    keep the session itself.

    Parameters
    ----------
    gain
        Gain of the sound in dB, for quiet recordings.
    """

    gain: Annotated[float, "dB", Meta(ge=-120.0, le=120.0)] = 0.0

    def write(self, sessions: Sequence[SessionReader], out: Path) -> list[Path]:
        """Write each session to a folder below `out` named after its file, and the layout beside them."""
        paths: list[Path] = []
        shown: dict[str, tuple[str, tuple[str, ...]]] = {}
        poses: dict[str, dict[str, None]] = {}
        for session, folder in folder_each(sessions, out):
            bag = _Bag(session, self.gain)
            paths += bag.write(folder)
            shown |= bag.topics
            for frame, topics in bag.frames.items():
                poses.setdefault(frame, {}).update(topics)
        layout = out / LAYOUT
        with written(layout):
            layout.write_text(json.dumps(_layout(shown, poses), indent=1) + "\n", encoding="utf-8")
        return [*paths, layout]


class _Bag:
    """A session as time-ordered ROS 2 messages.

    `topics` are the topics with their types and numeric fields. `frames` maps each frame of the written poses
    to its topics in order.
    """

    def __init__(self, session: SessionReader, gain: float) -> None:
        self._session, self._scale = session, FULL_SCALE * 10.0 ** (gain / 20.0)
        self._store = _typestore()
        self.topics: dict[str, tuple[str, tuple[str, ...]]] = {
            "/audio": (AUDIO, ()),
            "/rosout": (LOG, ()),
            "/description": (codec.TEXT, ()),
        }
        self.frames: dict[str, dict[str, None]] = {}
        parts: list[Iterable[Stamped]] = [self._audio(), self._events(), self._description()]
        for stream in session.streams:
            feed = session.description.feed(stream)
            kind, topic = codec.type_of(feed), codec.topic_of(stream)
            if kind == codec.WRENCHES:
                self.topics[topic] = WRENCH, tuple(f"wrench.force.{axis}" for axis in "xyz")
                parts.append(self._wrenches(topic))
            elif kind == codec.POSES:
                self.topics[topic] = codec.POSES, tuple(f"pose.position.{axis}" for axis in "xyz")
                parts.append(self._poses(topic))
            else:
                track = session.readings(stream)
                columns = {name: track.column(name) for name in feed.columns}
                parts.append(self._columns(topic, track.time, columns))
        labels = session.labels
        if len(labels.time):
            parts.append(self._columns(codec.topic_of(LABELS), labels.time, dict(labels.columns)))
        self._parts = parts

    def write(self, folder: Path) -> list[Path]:
        """Write the bag into an empty folder, and return its files."""
        from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: PLC0415

        folder.rmdir()  # the library makes it, and refuses one that is there
        with written(folder), Writer(folder, version=VERSION, storage_plugin=StoragePlugin.MCAP) as bag:
            connections = {
                topic: bag.add_connection(topic, kind, typestore=self._store)
                for topic, (kind, _) in self.topics.items()
            }
            for stamp, topic, data in heapq.merge(*self._parts, key=lambda message: message[0]):
                bag.write(connections[topic], stamp, data)
        return sorted(folder.iterdir())

    def _encode(self, kind: str, **fields: Any) -> bytes:
        return bytes(self._store.serialize_cdr(self._store.types[kind](**fields), kind))

    def _stamp(self, stamp: int) -> Any:
        seconds, nanoseconds = divmod(stamp, NANO)
        return self._store.types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)

    def _header(self, stamp: int, frame: str) -> Any:
        return self._store.types[codec.HEADER](stamp=self._stamp(stamp), frame_id=frame)

    def _audio(self) -> Iterator[Stamped]:
        for message, block in self._session.decoded("/audio"):
            samples = np.clip(np.nan_to_num(block.samples), -LOUDEST, LOUDEST) * self._scale
            frames = samples.reshape(block.channels, -1).T
            whole = np.clip(np.rint(frames), -FULL_SCALE - 1, FULL_SCALE).astype("<i2")
            data = self._encode(
                AUDIO,
                timestamp=self._stamp(message.log_time),
                data=np.frombuffer(whole.tobytes(), np.uint8),
                format="pcm-s16",
                sample_rate=block.sample_rate,
                number_of_channels=block.channels,
            )
            yield message.log_time, "/audio", data

    def _wrenches(self, topic: str) -> Iterator[Stamped]:
        types, frame = self._store.types, topic.strip("/")
        vector, wrench = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Wrench"]
        for _, batch in self._session.decoded(topic):
            force, torque = batch.force.reshape(-1, 3).tolist(), batch.torque.reshape(-1, 3).tolist()
            for stamp, f, t in zip(batch.arrival.tolist(), force, torque, strict=True):
                value = wrench(force=vector(*f), torque=vector(*t))
                yield stamp, topic, self._encode(WRENCH, header=self._header(stamp, frame), wrench=value)

    def _poses(self, topic: str) -> Iterator[Stamped]:
        for message, pose in self._session.decoded(topic):
            self.frames.setdefault(pose.header.frame_id, {})[topic] = None
            yield message.log_time, topic, bytes(message.data)

    def _columns(self, topic: str, time: Any, columns: dict[str, Any]) -> Iterator[Stamped]:
        """Return readings as messages of a type with one field per column."""
        from rosbags.typesys import get_types_from_msg  # noqa: PLC0415

        name = "".join(part.capitalize() for part in topic.strip("/").split("_"))
        kind = f"{codec.OURS}{name}Reading"
        fields = _field_names(columns)
        text = "std_msgs/Header header\n" + "".join(f"float64 {field}\n" for field in fields)
        self._store.register(get_types_from_msg(text, kind))
        self.topics[topic] = kind, fields

        def messages() -> Iterator[Stamped]:
            epoch = self._session.clock.epoch_ns
            stamps = epoch + np.rint(np.asarray(time) * NANO).astype(np.int64)
            rows = zip(stamps.tolist(), *(column.tolist() for column in columns.values()), strict=True)
            for stamp, *row in rows:
                values = dict(zip(fields, map(float, row), strict=True))
                yield stamp, topic, self._encode(kind, header=self._header(stamp, ""), **values)

        return messages()

    def _events(self) -> Iterator[Stamped]:
        epoch = self._session.clock.epoch_ns
        for event in self._session.events:
            stamp = epoch + round(event.time * NANO)
            more = json.dumps(event.data, sort_keys=True) if event.data else ""
            data = self._encode(
                LOG,
                stamp=self._stamp(stamp),
                level=INFO,
                name=event.kind,
                msg=" ".join(part for part in (event.text, more) if part),
                file="",
                function="",
                line=0,
            )
            yield stamp, "/rosout", data

    def _description(self) -> Iterator[Stamped]:
        data = self._encode(codec.TEXT, data=self._session.description.dump())
        yield self._session.clock.epoch_ns, "/description", data


def _typestore() -> "Typestore":
    """Return a separate type store, since column types differ from session to session."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: PLC0415

    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(RAW_AUDIO, AUDIO))
    return store


def _field_names(columns: Iterable[str]) -> tuple[str, ...]:
    """Return valid, unique ROS 2 field names.

    >>> _field_names(["position", "2nd Force!", "header", "position_"])
    ('position', 'c2nd_force', 'c_header', 'position_2')
    """
    names: list[str] = []
    for column in columns:
        name = re.sub("_+", "_", re.sub("[^a-z0-9]", "_", column.lower())).strip("_")
        name = f"c_{name}" if name in ("", "header") else name
        name = name if name[0].isalpha() else f"c{name}"
        number, free = 1, name
        while free in names:
            number += 1
            free = f"{name}_{number}"
        names.append(free)
    return tuple(names)


def _layout(
    topics: Mapping[str, tuple[str, tuple[str, ...]]], poses: Mapping[str, Iterable[str]]
) -> dict[str, Any]:
    """Return a Foxglove layout: the sound, a plot for each numeric topic, poses, and the log.

    Each pose frame has its own view, since there are no transforms between frames.
    """
    panels: dict[str, dict[str, Any]] = {"Audio!sound": {"topic": "/audio"}}
    for topic, (_, fields) in topics.items():
        if fields:
            panels[f"Plot!{topic.strip('/')}"] = _plot(topic, fields)
    for k, (frame, shown) in enumerate(poses.items()):
        visible = {topic: {"visible": True} for topic in shown}
        # Without a frame Foxglove chooses one.
        follow = {"followTf": frame} if frame else {}
        panels[f"3D!pose{k + 1 if k else ''}"] = {**follow, "topics": visible}
    panels["RosOut!events"] = {"topicToRender": "/rosout", "minLogLevel": 1, "searchTerms": []}
    return {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1},
        "layout": _stacked(list(panels)),
    }


def _plot(topic: str, fields: tuple[str, ...]) -> dict[str, Any]:
    paths = [
        {"value": f"{topic}.{field}", "enabled": True, "timestampMethod": "receiveTime"}
        for field in fields
        if not field.endswith("_std")
    ]
    return {
        "title": topic,
        "paths": paths,
        "xAxisVal": "timestamp",
        "isSynced": True,
        "showXAxisLabels": True,
        "showYAxisLabels": True,
        "showLegend": True,
        "legendDisplay": "floating",
    }


def _stacked(panels: list[str]) -> Any:
    """Return panels stacked at equal height."""
    if len(panels) == 1:
        return panels[0]
    share = math.floor(100.0 / len(panels))
    return {
        "first": panels[0],
        "second": _stacked(panels[1:]),
        "direction": "column",
        "splitPercentage": share,
    }
