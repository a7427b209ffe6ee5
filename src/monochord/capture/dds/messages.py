"""ROS 2 messages as DDS types with ROS 2's names and layout, made from their definitions: ``messages.Touch``.

The ROS 2 topic ``NAME`` is the DDS topic ``rt/NAME``. A type is found by its short name.
"""

from functools import cache
from typing import Any

from monochord.sessions.codec import typestore

__all__ = ["header", "message_type", "ros_name"]

PACKAGES = [
    "monochord_msgs",
    "builtin_interfaces",
    "std_msgs",
    "geometry_msgs",
    "diagnostic_msgs",
    "tf2_msgs",
    "visualization_msgs",
    "rmw_dds_common",
]
SPELLED = {"bool": bool, "string": str}
"""Types of Python that stand for a type of ROS 2."""
BYTES = frozenset({"byte", "char"})
"""Types of ROS 2 that are unsigned numbers of eight bits."""


def __getattr__(name: str) -> Any:
    known = typestore().fielddefs
    for package in PACKAGES:
        if f"{package}/msg/{name}" in known:
            return message_type(f"{package}/msg/{name}")
    raise AttributeError(f"module {__name__!r} has no message {name!r}")


@cache
def message_type(name: str) -> type[Any]:
    """Return the DDS type of a message with its ROS 2 name, such as ``geometry_msgs/msg/Pose``."""
    from cyclonedds.idl import make_idl_struct  # noqa: PLC0415
    from cyclonedds.idl.annotations import final  # noqa: PLC0415

    package, folder, short = name.split("/")
    fields = {field: _field_type(described) for field, described in typestore().fielddefs[name][1]}
    return final(make_idl_struct(short, f"{package}.{folder}.dds_.{short}_", fields))


def _field_type(described: Any) -> Any:
    """Return the DDS type of a field that rosbags describes as a kind, and what it is of."""
    from cyclonedds.idl import types  # noqa: PLC0415

    kind, of = described
    match kind.name:
        case "NAME":
            return message_type(of)
        case "SEQUENCE":
            return types.sequence[_field_type(of[0])]
        case "ARRAY":
            return types.array[_field_type(of[0]), of[1]]
        case _:
            return SPELLED.get(of[0]) or getattr(types, "uint8" if of[0] in BYTES else of[0])


def header(nanoseconds: int, frame: str) -> Any:
    """Return a header stamped with a time since the Unix epoch.

    >>> header(1_500_000_000, "string").stamp
    Time(sec=1, nanosec=500000000)
    """
    time, header = message_type("builtin_interfaces/msg/Time"), message_type("std_msgs/msg/Header")
    return header(stamp=time(*divmod(nanoseconds, 1_000_000_000)), frame_id=frame)


def ros_name(message: type[Any]) -> str:
    """Return the ROS 2 name of a message type.

    >>> ros_name(message_type("geometry_msgs/msg/PoseStamped"))
    'geometry_msgs/msg/PoseStamped'
    """
    package, folder, _, name = str(message.__idl_typename__).replace("::", ".").split(".")
    return f"{package}/{folder}/{name.removesuffix('_')}"
