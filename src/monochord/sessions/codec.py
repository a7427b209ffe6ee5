"""Session messages as ROS 2 types and CDR bytes."""

import struct
from collections.abc import Callable, Mapping
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import POSE, WRENCH, Feed
from monochord.sessions.bounds import MAX_COLUMNS, json_object
from monochord.sessions.description import NANO

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

ENCAPSULATION = 4
"""Bytes of CDR before a message's first field."""
OURS = "monochord_msgs/msg/"
AUDIO, WRENCHES, READINGS = OURS + "AudioBlock", OURS + "WrenchBatch", OURS + "Readings"
LABELS, EVENT, CLOCKS = OURS + "Labels", OURS + "Event", OURS + "Clocks"
POSES, TEXT, HEADER = "geometry_msgs/msg/PoseStamped", "std_msgs/msg/String", "std_msgs/msg/Header"
TOPICS = {
    "/audio": AUDIO,
    "/labels": LABELS,
    "/events": EVENT,
    "/clocks": CLOCKS,
    "/description": TEXT,
}
"""Topics of every session with their types; each stream of readings adds a topic of its name."""


def topic_of(stream: str) -> str:
    """Return the topic of a stream of readings.

    >>> topic_of("wrench")
    '/wrench'
    """
    return f"/{stream}"


def type_of(feed: Feed) -> str:
    """Return the message type of a stream of readings.

    >>> type_of(Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3))
    'monochord_msgs/msg/WrenchBatch'
    """
    if feed.columns == WRENCH:
        return WRENCHES
    stamped = feed.ticks in (0.0, float(NANO))
    return POSES if feed.columns == POSE and stamped else READINGS


@cache
def typestore() -> "Typestore":
    """Return the ROS 2 types that sessions use, Monochord's types included."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore  # noqa: PLC0415

    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in own_definitions().items():
        store.register(get_types_from_msg(text, OURS + name))
    return store


def own_definitions() -> dict[str, str]:
    """Return Monochord's message definitions by name; a type comes before the types that contain it.

    >>> list(own_definitions())[:3]
    ['AudioBlock', 'Clocks', 'Estimate']
    """
    folder = files("monochord.sessions").joinpath("msg")
    paths = sorted((file for file in folder.iterdir() if file.name.endswith(".msg")), key=lambda f: f.name)
    return {path.name.removesuffix(".msg"): path.read_text(encoding="utf-8") for path in paths}


def definition(name: str) -> str:
    """Return a type's definition with its dependencies, as an MCAP schema of encoding ros2msg."""
    return typestore().generate_msgdef(name, ros_version=2)[0]


def header(stamp: int, frame: str = "") -> Any:
    """Return a std_msgs/Header with a stamp in nanoseconds."""
    types = typestore().types
    time = types["builtin_interfaces/msg/Time"](sec=int(stamp // NANO), nanosec=int(stamp % NANO))
    return types[HEADER](stamp=time, frame_id=frame)


def nanoseconds(stamp: Any) -> int:
    """Return a builtin_interfaces/Time in nanoseconds."""
    return int(stamp.sec) * NANO + int(stamp.nanosec)


def encode(name: str, /, **fields: Any) -> bytes:
    """Return a message of type `name` as little-endian CDR bytes with the encapsulation header.

    Raises `InputError` for a text that cannot be written in UTF-8.
    """
    store = typestore()
    try:
        return bytes(store.serialize_cdr(store.types[name](**fields), name))
    except UnicodeEncodeError as error:
        raise InputError(f"text {error.object[:40]!a} of a session", "text in UTF-8") from error


def decode(name: str, data: bytes | memoryview) -> Any:
    """Return the message of type `name` in CDR bytes; its arrays are views of the bytes.

    Raises `InputError` for bytes that are not of that type, or whose array lengths disagree.
    """
    from rosbags.serde import SerdeError  # noqa: PLC0415

    try:
        message: Any = typestore().deserialize_cdr(data, name)
    except SerdeError as error:
        raise InputError(f"message of {len(data)} bytes ({error})", f"CDR bytes of {name}") from error
    refuse = _REFUSE.get(name)
    if refuse is not None:
        refuse(message)
    return message


def _refuse_counts(name: str, counts: Mapping[str, int], allowed: Mapping[str, int]) -> None:
    """Raise `InputError` for a message whose array lengths disagree."""
    for part, count in counts.items():
        if count != allowed[part]:
            raise InputError(f"{name} with {count} {part}", f"{allowed[part]}, to match its other fields")


def _refuse_names(name: str, names: list[str]) -> None:
    if len(names) > MAX_COLUMNS or len(set(names)) < len(names):
        raise InputError(f"{name} with {len(names)} names", f"{MAX_COLUMNS} at most, all different")


def _refuse_audio(m: Any) -> None:
    if not m.channels or len(m.samples) % m.channels:
        given = f"audio of {len(m.samples)} samples in {m.channels} channels"
        raise InputError(given, "the same number of samples in each channel")


def _refuse_readings(m: Any) -> None:
    count, width = len(m.arrival), len(m.columns)
    counts = {"sequence": len(m.sequence), "device_time": len(m.device_time), "status": len(m.status)}
    allowed = dict.fromkeys(counts, count) | {"values": count * width}
    _refuse_counts("readings", counts | {"values": len(m.values)}, allowed)


def _refuse_wrenches(m: Any) -> None:
    count = len(m.arrival)
    counts = {"sequence": len(m.sequence), "device_time": len(m.device_time), "status": len(m.status)}
    allowed = dict.fromkeys(counts, count) | {"force": 3 * count, "torque": 3 * count}
    _refuse_counts("readings", counts | {"force": len(m.force), "torque": len(m.torque)}, allowed)


def _refuse_labels(m: Any) -> None:
    _refuse_names("labels", m.columns)
    _refuse_counts("labels", {"values": len(m.values)}, {"values": len(m.time) * len(m.columns)})


def _refuse_clocks(m: Any) -> None:
    _refuse_names("clocks", m.names)
    _refuse_counts("clocks", {"offsets": len(m.offsets)}, {"offsets": len(m.names)})


_REFUSE: dict[str, Callable[[Any], object]] = {
    AUDIO: _refuse_audio,
    WRENCHES: _refuse_wrenches,
    READINGS: _refuse_readings,
    LABELS: _refuse_labels,
    EVENT: lambda m: json_object(m.data or "{}"),
    CLOCKS: _refuse_clocks,
}
"""Consistency check of each message type."""


def encode_pose(stamp: int, values: np.ndarray[Any, np.dtype[np.float64]], frame: str = "string") -> bytes:
    """Return a pose (7,) in a frame, with the sender's stamp in nanoseconds, 0 where the sender gave none."""
    before, between = _around_stamp(frame)
    time = _STAMP.pack(*divmod(int(stamp), NANO))
    return before + time + between + np.asarray(values, "<f8").tobytes()


_STAMP = struct.Struct("<iI")
"""A builtin_interfaces/Time: seconds and nanoseconds."""


@cache
def _around_stamp(frame: str) -> tuple[bytes, bytes]:
    """Return the bytes of a frame's poses before the stamp, and between the stamp and the seven values."""
    types = typestore().types
    pose = types["geometry_msgs/msg/Pose"](
        position=types["geometry_msgs/msg/Point"](x=0.0, y=0.0, z=0.0),
        orientation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=0.0),
    )
    data = encode(POSES, header=header(0, frame), pose=pose)
    return data[:ENCAPSULATION], data[ENCAPSULATION + _STAMP.size : -8 * len(POSE)]


def pose_of(message: Any) -> tuple[int, tuple[float, ...]]:
    """Return the sender's stamp in nanoseconds and the seven values of a decoded pose."""
    p, q = message.pose.position, message.pose.orientation
    return nanoseconds(message.header.stamp), (p.x, p.y, p.z, q.x, q.y, q.z, q.w)
