"""The ROS 2 messages that Monochord uses, as DDS types with ROS 2's names and layout.

The ROS 2 topic ``NAME`` is the DDS topic ``rt/NAME``. `TYPE_HASHES` holds the hashes of the definitions after
REP-2016, which ROS 2 tools compare; a writer announces them in its user data.
"""

from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.annotations import final
from cyclonedds.idl.types import float64, int8, int32, uint8, uint32, uint64

if TYPE_CHECKING:  # to a type checker the library's own is no sequence
    from collections.abc import Sequence as sequence  # noqa: N813
else:
    from cyclonedds.idl.types import sequence

TYPE_HASHES = MappingProxyType(
    {
        "geometry_msgs/msg/PoseStamped": (
            "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8"
        ),
        "geometry_msgs/msg/WrenchStamped": (
            "RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77"
        ),
        "geometry_msgs/msg/PointStamped": (
            "RIHS01_4c0296af86e01e562e9e0405d138a01537247580076c58ea38d7923ac1045897"
        ),
        "std_msgs/msg/Bool": "RIHS01_feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
        "diagnostic_msgs/msg/DiagnosticArray": (
            "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"
        ),
        "monochord_msgs/msg/Event": "RIHS01_9b8cf54af5d83ef54b860f77751929b18c423d863598f15b33ad94d895780b57",
        "monochord_msgs/msg/Touch": "RIHS01_7c015ad0689250638198f4669677c7e9eb5b4350e93327715a790f02db70c561",
        "tf2_msgs/msg/TFMessage": "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    }
)


@final
@dataclass
class Time(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):
    """Seconds and nanoseconds since the Unix epoch."""

    sec: int32
    nanosec: uint32


@final
@dataclass
class Header(IdlStruct, typename="std_msgs.msg.dds_.Header_"):
    """A time stamp and a coordinate frame."""

    stamp: Time
    frame_id: str


@final
@dataclass
class Point(IdlStruct, typename="geometry_msgs.msg.dds_.Point_"):
    """A position in m."""

    x: float64
    y: float64
    z: float64


@final
@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs.msg.dds_.Quaternion_"):
    """An orientation."""

    x: float64
    y: float64
    z: float64
    w: float64


@final
@dataclass
class Pose(IdlStruct, typename="geometry_msgs.msg.dds_.Pose_"):
    """A position and an orientation."""

    position: Point
    orientation: Quaternion


@final
@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs.msg.dds_.PoseStamped_"):
    """A pose with its time and frame."""

    header: Header
    pose: Pose


@final
@dataclass
class Vector3(IdlStruct, typename="geometry_msgs.msg.dds_.Vector3_"):
    """A force in N, a torque in N m, or a translation in m."""

    x: float64
    y: float64
    z: float64


@final
@dataclass
class Wrench(IdlStruct, typename="geometry_msgs.msg.dds_.Wrench_"):
    """A force and a torque."""

    force: Vector3
    torque: Vector3


@final
@dataclass
class WrenchStamped(IdlStruct, typename="geometry_msgs.msg.dds_.WrenchStamped_"):
    """A wrench with its time and frame."""

    header: Header
    wrench: Wrench


@final
@dataclass
class Transform(IdlStruct, typename="geometry_msgs.msg.dds_.Transform_"):
    """A translation and a rotation."""

    translation: Vector3
    rotation: Quaternion


@final
@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs.msg.dds_.TransformStamped_"):
    """The pose of frame `child_frame_id` in the header's frame."""

    header: Header
    child_frame_id: str
    transform: Transform


@final
@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs.msg.dds_.TFMessage_"):
    """Several transforms, as on the topic ``tf``."""

    transforms: sequence[TransformStamped]


@final
@dataclass
class PointStamped(IdlStruct, typename="geometry_msgs.msg.dds_.PointStamped_"):
    """A position with its time and frame."""

    header: Header
    point: Point


@final
@dataclass
class Bool(IdlStruct, typename="std_msgs.msg.dds_.Bool_"):
    """A truth value."""

    data: bool


@final
@dataclass
class KeyValue(IdlStruct, typename="diagnostic_msgs.msg.dds_.KeyValue_"):
    """A diagnostic value, as text."""

    key: str
    value: str


@final
@dataclass
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs.msg.dds_.DiagnosticStatus_"):
    """The state of one part of a robot: `level` 0 is ok, 1 warning, 2 error, 3 stale."""

    level: uint8
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@final
@dataclass
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs.msg.dds_.DiagnosticArray_"):
    """The states of several parts of a robot."""

    header: Header
    status: sequence[DiagnosticStatus]


@final
@dataclass
class Estimate(IdlStruct, typename="monochord_msgs.msg.dds_.Estimate_"):
    """One estimated quantity with its standard error, or the reason for an abstention."""

    value: float64
    std: float64
    valid: bool
    why_not: str


@final
@dataclass
class Touch(IdlStruct, typename="monochord_msgs.msg.dds_.Touch_"):
    """All estimates for one window of sound; `Touch.msg` describes each field."""

    header: Header
    start: uint64
    window: float64
    latency: float64
    contact: Estimate
    position: Estimate
    force: Estimate
    slip: Estimate
    touched: int8
    slides: int8
    tracked_position: Estimate
    tracked_force: Estimate


@final
@dataclass
class Event(IdlStruct, typename="monochord_msgs.msg.dds_.Event_"):
    """An event; `data` is a JSON object."""

    header: Header
    kind: str
    text: str
    data: str


def header(nanoseconds: int, frame: str) -> Header:
    """Return a header stamped with a time since the Unix epoch.

    >>> header(1_500_000_000, "string").stamp
    Time(sec=1, nanosec=500000000)
    """
    return Header(stamp=Time(*divmod(nanoseconds, 1_000_000_000)), frame_id=frame)


def nanoseconds(stamp: Time) -> int:
    """Return a stamp as nanoseconds since the Unix epoch.

    >>> nanoseconds(Time(sec=1, nanosec=500000000))
    1500000000
    """
    return stamp.sec * 1_000_000_000 + stamp.nanosec


def ros_name(message: type[Any]) -> str:
    """Return the ROS 2 name of a message type.

    >>> ros_name(PoseStamped)
    'geometry_msgs/msg/PoseStamped'
    """
    package, folder, _, name = str(message.__idl_typename__).replace("::", ".").split(".")
    return f"{package}/{folder}/{name.removesuffix('_')}"
