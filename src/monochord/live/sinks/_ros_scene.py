"""A string as RViz shows it: where its frame is, and markers of string, touch and force."""

import math
from collections.abc import Sequence
from functools import cache
from types import SimpleNamespace
from typing import Any, TypeAlias

import numpy as np

from monochord.core.ranges import Finite
from monochord.core.units import Metres, Newtons, Seconds
from monochord.live.sinks._ros_messages import Answer
from monochord.sessions.codec import header, typestore

PARTS = (
    "builtin_interfaces/msg/Duration",
    "geometry_msgs/msg/Point",
    "geometry_msgs/msg/Pose",
    "geometry_msgs/msg/Quaternion",
    "geometry_msgs/msg/Transform",
    "geometry_msgs/msg/TransformStamped",
    "geometry_msgs/msg/Vector3",
    "sensor_msgs/msg/CompressedImage",
    "std_msgs/msg/ColorRGBA",
    "visualization_msgs/msg/Marker",
    "visualization_msgs/msg/MeshFile",
)
Pose: TypeAlias = tuple[
    Finite[float], Finite[float], Finite[float], Finite[float], Finite[float], Finite[float]
]
"""x, y, z in m, then roll, pitch and yaw in rad about the fixed axes, as in URDF."""
Colour: TypeAlias = tuple[float, float, float, float]
STRING, WITHHELD = (0.85, 0.85, 0.88, 1.0), (0.85, 0.85, 0.88, 0.25)
"""The string; where contact is unknown, or its position is withheld."""
TOUCHED, SLIDES, FORCE = (0.10, 0.65, 0.95, 1.0), (0.98, 0.60, 0.10, 1.0), (0.90, 0.20, 0.25, 1.0)
DIM = 0.35
"""Opacity of a touch whose force is withheld."""
MILLIMETRE = 1e-3
LINE, TOUCH_SIZE, SHAFT, HEAD, TEXT = 0.002, 0.006, 0.002, 0.005, 0.008
"""Widths of the string, the touch, the arrow's shaft and head, and the height of the text, in m."""
LENGTH_OF_NEWTON: Metres = 0.04
"""Length of the arrow of 1 N."""
TEXT_BELOW: Metres = 0.015
LIFETIME: Seconds = 1.0
"""Lifetime of markers: RViz drops those of a sensor that ended."""
LINE_STRIP, SPHERE, ARROW, TEXT_FACING = 4, 2, 0, 9
"""Types of markers: a line, a sphere, an arrow, and a text that faces the camera."""
ADD, DELETE = 0, 2
NO_SIZE = 0.0, 0.0, 0.0
SMALLEST: Newtons = 1e-3
"""Smallest force that is drawn."""


def transform(pose: Pose, link: str, frame: str, stamp: int) -> Any:
    """Return where a string's frame is on its link.

    >>> turned = transform((0.1, 0.0, 0.0, 0.0, 0.0, math.pi / 2), "finger", "string", 0).transform
    >>> turned.translation.x, round(turned.rotation.z, 4), round(turned.rotation.w, 4)
    (0.1, 0.7071, 0.7071)
    """
    from scipy.spatial.transform import Rotation  # noqa: PLC0415

    make, (x, y, z) = parts(), pose[:3]
    a, b, c, d = Rotation.from_euler("xyz", pose[3:]).as_quat().tolist()
    turn = make.Quaternion(x=a, y=b, z=c, w=d)
    at = make.Transform(translation=make.Vector3(x=x, y=y, z=z), rotation=turn)
    return make.TransformStamped(header=header(stamp, link), child_frame_id=frame, transform=at)


def markers(answer: Answer, length: Metres, frame: str, stamp: int) -> list[Any]:
    """Return the markers of a string in its frame: 0 the string, 1 the touch, 2 its force, 3 a text.

    The string is dimmed where contact is unknown or the position withheld, and the touch where its force is.
    The arrow is the force on the object, from the touch along z. The touch is as wide as two standard errors
    on each side.
    """
    position, force, touched = answer.position, answer.force, answer.contact is not False
    at = float(position.value) if touched and position.valid else None
    newtons = float(force.value) if at is not None and force.valid else 0.0
    head, colour = header(stamp, frame), STRING if at is not None or not touched else WITHHELD
    line = [_point(0.0), _point(length)]
    string = _marker(head, 0, LINE_STRIP, colour, (LINE, 0.0, 0.0), points=line)
    touch, arrow = (_marker(head, *each, FORCE, NO_SIZE, action=DELETE) for each in ((1, SPHERE), (2, ARROW)))
    if at is not None:
        colour = SLIDES if answer.slip else TOUCHED
        colour = colour if force.valid else (*colour[:3], DIM)
        wide = 4.0 * float(position.std) if math.isfinite(position.std) else 0.0
        size = min(max(wide, TOUCH_SIZE), length), TOUCH_SIZE, TOUCH_SIZE
        touch = _marker(head, 1, SPHERE, colour, size, at=_point(at))
    if at is not None and newtons > SMALLEST:
        tip = [_point(at), _point(at, LENGTH_OF_NEWTON * newtons)]
        arrow = _marker(head, 2, ARROW, FORCE, (SHAFT, HEAD, 0.0), points=tip)
    below = _point(0.5 * length, -TEXT_BELOW)
    text = _marker(head, 3, TEXT_FACING, STRING, (0.0, 0.0, TEXT), at=below, text=words(answer))
    return [string, touch, arrow, text]


def words(answer: Answer) -> str:
    """Return an answer as text.

    >>> from monochord.core.types import Estimate
    >>> at, unknown = Estimate(value=0.08, std=3e-4, unit="m"), Estimate.abstain("N", "not at rest")
    >>> words(Answer(True, False, at, unknown))
    '80.0 mm ± 0.3, force: not at rest'
    """
    if answer.contact is False:
        return "untouched"
    position, force = answer.position, answer.force
    where = (
        f"{position.value / MILLIMETRE:.1f} mm ± {position.std / MILLIMETRE:.1f}"
        if position.valid
        else f"position: {position.reason}"
    )
    if not position.valid and force.reason == position.reason:
        return where
    newtons = f"{force.value:.2f} N ± {force.std:.2f}" if force.valid else f"force: {force.reason}"
    return f"{where}, {newtons}"


@cache
def parts() -> SimpleNamespace:
    """Return the types that the messages of a scene consist of, by their short names."""
    types = typestore().types
    return SimpleNamespace(**{name.rpartition("/")[2]: types[name] for name in PARTS})


@cache
def _constants() -> dict[str, Any]:
    """Return the fields that all markers share: how long they last, and what they do not have."""
    make, nothing = parts(), np.zeros(0, np.uint8)
    return {
        "lifetime": make.Duration(sec=int(LIFETIME), nanosec=0),
        "frame_locked": True,
        "colors": [],
        "texture_resource": "",
        "texture": make.CompressedImage(header=header(0), format="", data=nothing),
        "uv_coordinates": [],
        "mesh_resource": "",
        "mesh_file": make.MeshFile(filename="", data=nothing),
        "mesh_use_embedded_materials": False,
    }


def _marker(
    head: Any,
    number: int,
    kind: int,
    colour: Colour,
    size: tuple[float, float, float],
    *,
    action: int = ADD,
    at: Any = None,
    points: Sequence[Any] = (),
    text: str = "",
) -> Any:
    make, (width, depth, height), (r, g, b, a) = parts(), size, colour
    ahead = make.Quaternion(x=0.0, y=0.0, z=0.0, w=1.0)
    return make.Marker(
        header=head,
        ns=head.frame_id,
        id=number,
        type=kind,
        action=action,
        pose=make.Pose(position=at or _point(0.0), orientation=ahead),
        scale=make.Vector3(x=width, y=depth, z=height),
        color=make.ColorRGBA(r=r, g=g, b=b, a=a),
        points=list(points),
        text=text,
        **_constants(),
    )


def _point(x: Metres, z: Metres = 0.0) -> Any:
    return parts().Point(x=x, y=0.0, z=z)
