"""The strings of a skin as links of a robot: a xacro macro, a URDF, or a URDF with them added.

Each string's link is named ``NAME_string``: x along the string from pickup 1, z away from it towards what
touches it, as the sink `ros2` has its frames. It has a visual and no mass.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Mapping
from html import escape
from pathlib import Path

import numpy as np

from monochord.core.config import MAX_BYTES
from monochord.core.errors import InputError, did_you_mean
from monochord.core.files import refuse_endless
from monochord.core.types import Floats
from monochord.core.units import Metres
from monochord.skin.geometry import SkinString

SHOWN_RADIUS: Metres = 5e-4
"""Radius of a string in pictures: a real one, of an eighth of a millimetre, could not be seen."""
UPRIGHT = 1e-9
"""Cosine of the pitch below which a string counts as upright, where roll and yaw are one turn."""
XACRO = "http://www.ros.org/wiki/xacro"


def refuse_other_link(link: str, robot: Path) -> None:
    """Raise `InputError` unless a robot's URDF has a link."""
    links = _links(robot, _robot(robot))
    if link not in links:
        raise InputError(f"link '{link}' in {robot}", ", ".join(links) or "links", did_you_mean(link, links))


def xacro(name: str, link: str, strings: Mapping[str, SkinString]) -> str:
    """Return a file with the xacro macro ``NAME_strings``, whose arguments are the link and a prefix.

    >>> top = SkinString(start=(0, 0, 0), end=(0.2, 0, 0), press=(0, 0, -1), sensor="prototype")
    >>> print(xacro("finger", "fingertip", {"top": top}).splitlines()[2])
      <xacro:macro name="finger_strings" params="link:=fingertip prefix:=''">
    """
    macro = f"{re.sub(r'[^A-Za-z0-9_]', '_', name)}_strings"
    parameters = f"link:={escape(link)} prefix:=''"
    inner = _elements("${link}", strings, "${prefix}", "    ")
    return (
        f'<?xml version="1.0"?>\n<robot xmlns:xacro="{XACRO}">\n'
        f'  <xacro:macro name="{macro}" params="{parameters}">\n{inner}  </xacro:macro>\n</robot>\n'
    )


def urdf(name: str, link: str, strings: Mapping[str, SkinString], robot: Path | None = None) -> str:
    """Return a robot of the link and its strings, or the text of a robot's URDF with the strings added.

    Raises `InputError` where the robot lacks the link, or has one that is named like a string's.

    >>> top = SkinString(start=(0, 0, 0), end=(0.2, 0, 0), press=(0, 0, -1), sensor="prototype")
    >>> [each.get("name") for each in ET.fromstring(urdf("finger", "fingertip", {"top": top})).iter("link")]
    ['fingertip', 'top_string']
    """
    inner = _elements(link, strings, "", "  ")
    if robot is None:
        opening = f'<robot name="{escape(name)}">\n  <link name="{escape(link)}"/>\n'
        return f'<?xml version="1.0"?>\n{opening}{inner}</robot>\n'
    refuse_other_link(link, robot)
    text = _robot(robot)
    taken = sorted({f"{each}_string" for each in strings} & {*_links(robot, text)})
    if taken:
        raise InputError(f"{robot} with a link {taken[0]}", "a robot without this skin's strings")
    before, end, after = text.rpartition("</robot>")
    return f"{before}{inner}{end}{after}"


def frame_of(string: SkinString) -> Floats:
    """Return a string's axes as columns (3, 3) in its link's frame: along it, aside, and away from it.

    >>> top = SkinString(start=(0, 0, 0), end=(0.2, 0, 0), press=(0, 0, -1), sensor="prototype")
    >>> frame_of(top).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    x, z = string.along / np.linalg.norm(string.along), -string.direction
    return np.column_stack([x, np.cross(z, x), z]) + 0.0  # 0.0 for -0.0


def pose_of(string: SkinString) -> tuple[float, ...]:
    """Return where a string's frame is in its link: x, y, z in m, roll, pitch, yaw in rad, as in URDF.

    >>> side = SkinString(start=(0.03, 0, 0), end=(0.03, 0.2, 0), press=(0, 0, -1), sensor="prototype")
    >>> [round(each, 4) for each in pose_of(side)]
    [0.03, 0.0, 0.0, 0.0, 0.0, 1.5708]
    """
    place = (*map(float, string.start), *_roll_pitch_yaw(frame_of(string)))
    return tuple(each + 0.0 for each in place)  # 0.0 for -0.0


def _elements(link: str, strings: Mapping[str, SkinString], prefix: str, indent: str) -> str:
    """Return a link and a fixed joint for each string."""
    lines: list[str] = []
    for name, string in strings.items():
        frame, pose = f'"{prefix}{name}_string"', pose_of(string)
        length = float(np.linalg.norm(np.subtract(string.end, string.start)))
        lines += [
            f"<link name={frame}>",
            "  <visual>",
            f'    <origin xyz="{0.5 * length:.9g} 0 0" rpy="0 {0.5 * np.pi:.9g} 0"/>',
            f'    <geometry><cylinder radius="{SHOWN_RADIUS:g}" length="{length:.9g}"/></geometry>',
            "  </visual>",
            "</link>",
            f'<joint name="{prefix}{name}_string_joint" type="fixed">',
            f'  <parent link="{escape(link)}"/>',
            f"  <child link={frame}/>",
            f'  <origin xyz="{_numbers(pose[:3])}" rpy="{_numbers(pose[3:])}"/>',
            "</joint>",
        ]
    return "".join(f"{indent}{line}\n" for line in lines)


def _roll_pitch_yaw(axes: Floats) -> tuple[float, float, float]:
    """Return the turns about the fixed axes x, y and z, in this order, that give these axes."""
    cosine = float(np.hypot(axes[0, 0], axes[1, 0]))
    pitch = float(np.arctan2(-axes[2, 0], cosine))
    if cosine < UPRIGHT:
        return float(np.arctan2(-axes[1, 2], axes[1, 1])), pitch, 0.0
    return float(np.arctan2(axes[2, 1], axes[2, 2])), pitch, float(np.arctan2(axes[1, 0], axes[0, 0]))


def _numbers(values: Iterable[float]) -> str:
    return " ".join(f"{each + 0.0:.9g}" for each in values)


def _robot(path: Path) -> str:
    """Return the text of a robot's URDF."""
    refuse_endless(path)
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError(f"robot {path} (of {path.stat().st_size} bytes)", f"{MAX_BYTES} at most")
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"robot {path} ({error.strerror})", "a readable URDF") from error
    except ValueError as error:
        raise InputError(f"robot {path} ({error})", "a URDF in UTF-8") from error


def _links(path: Path, text: str) -> list[str]:
    """Return the names of the links of a robot's URDF."""
    try:
        root = ET.fromstring(text)  # noqa: S314  (expat bounds entities)  # nosec B314
    except (ET.ParseError, ValueError) as error:
        raise InputError(f"robot {path} ({error})", "a URDF") from error
    if root.tag != "robot":
        raise InputError(f"robot {path} (an XML file of <{root.tag}>)", "a URDF: <robot>")
    if any(each.tag.startswith(f"{{{XACRO}}}") for each in root.iter()):
        raise InputError(f"robot {path} with xacro in it", "a URDF", f"expand it: xacro {path} > robot.urdf")
    return [each.get("name", "") for each in root.iter("link")]
