"""Which columns of a table of poses hold the orientation, by their names.

Robots' makers use one name for different rotations: A, B, C are turns about z, y, x on a KUKA, and about x,
y, z elsewhere. Names alone never decide: `ROTATIONS` lists what they may mean.
"""

import re
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeAlias

from monochord.core.errors import InputError

PLACE = ("time", "x", "y", "z")
TURN = ("qx", "qy", "qz", "qw")
NONE = "none"
ROTATIONS: Mapping[str, str] = MappingProxyType(
    {
        "vector": "axis times angle",
        "fixed_xyz": "about the fixed x, y, z: roll, pitch, yaw",
        "moving_xyz": "about x, the rotated y, the rotated z",
        "moving_zyx": "about z, the rotated y, the rotated x: A, B, C of KUKA",
        "moving_zyz": "about z, the rotated y, the rotated z",
        "wxyz": "a quaternion, w first",
        "xyzw": "a quaternion, w last",
    }
)
"""Meanings of the columns of a rotation, by their value of the option `rotation`."""
_ANGLES = ("fixed_xyz", "moving_xyz", "moving_zyx", "moving_zyz")
_BY_AXIS = ("vector", "fixed_xyz", "moving_xyz", "moving_zyx")
_QUATERNIONS = ("wxyz", "xyzw")
_LETTERS: Mapping[tuple[str, ...], str] = MappingProxyType(
    {
        ("a", "b", "c"): "moving_zyx",
        ("w", "p", "r"): "fixed_xyz",
        ("o", "a", "t"): "moving_zyz",
        ("u", "v", "w"): "moving_zyx",
        ("alpha", "beta", "gamma"): "fixed_xyz",
        ("phi", "theta", "psi"): "fixed_xyz",
        ("e1", "e2", "e3"): "moving_zyz",
        ("euler1", "euler2", "euler3"): "fixed_xyz",
    }
)
"""Names without an axis, in the order of the turns, with the meaning that is proposed first."""
_ROLL, _WORDS = "roll", MappingProxyType({"roll": "x", "pitch": "y", "yaw": "z"})
_names_rotation = re.compile(
    "r|rot|rotation|rotvec|rv|euler|eul|e|ori|orient|orientation|o|angle|ang|att|attitude|theta|rpy|aa|axang"
    "|q|quat|quaternion"
).fullmatch
"""Matches a word that, before x, y, z or w, names a part of a rotation."""
_is_rotation = re.compile(
    "abc|angles?|attitude|azimuth|bank|elevation|euler|heading|orientation|quat|quaternion|rot|rotation|rotvec"
    "|rpy|tilt|wpr"
).fullmatch
"""Matches a word that names a rotation by itself."""
_is_other = re.compile(
    "v|vel|velocity|speed|acc|acceleration|force|torque|f|t|j|joint|std|var|cov|err|error"
).fullmatch
"""Matches a word before such a name that makes it a velocity, a force, a joint or an error."""
_is_unit = re.compile("deg|degrees?|rad|radians?").fullmatch
_MATRIX_COUNT = 9
_Found: TypeAlias = dict[tuple[str, ...], dict[str, int]]


@dataclass(frozen=True, slots=True, kw_only=True)
class RotationColumns:
    """The columns of a rotation in order, by index, and its meaning; see `ROTATIONS`."""

    columns: tuple[int, ...]
    rotation: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseColumns:
    """The header of a table of poses: indices of `PLACE`, the rotation if there is one, names not read."""

    count: int
    place: tuple[int, ...]
    turn: RotationColumns | None = None
    unread: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Group:
    """Columns that look like one rotation, by index, and the meanings that they may have; none if incomplete.

    `by_axis` says that the names state the axes: x, y, z, then w.
    """

    columns: tuple[int, ...]
    meanings: tuple[str, ...] = ()
    by_axis: bool = False


def pose_columns(names: Sequence[str], rotation: str, what: str, expected: str) -> PoseColumns:
    """Return where a table with columns of these names has its pose.

    Raises `InputError` if `what`, the table, lacks a column of `expected`, or has one that may be a rotation
    of several meanings and `rotation` does not say which.
    """
    index = {name: at for at, name in enumerate(names)}
    wanted = (*PLACE, *(TURN if {*TURN} & {*names} else ()))
    if lacking := [name for name in wanted if name not in index]:
        raise InputError(f"{what} without {', '.join(lacking)}", expected)
    place, turn = tuple(index[name] for name in PLACE), None
    if len(wanted) > len(PLACE):
        turn = RotationColumns(columns=tuple(index[name] for name in TURN), rotation="xyzw")
    elif rotation != NONE:
        turn = _chosen(names, _groups(names), rotation, what)
    used = {*place, *(turn.columns if turn else ())}
    unread = tuple(name for at, name in enumerate(names) if at not in used)
    return PoseColumns(count=len(names), place=place, turn=turn, unread=unread)


def rotation_names(names: Iterable[str]) -> list[str]:
    """Return the names that look like a rotation.

    >>> rotation_names(["stamp", "force_x", "a", "rpy", "joint_1"])
    ['rpy']
    """
    names = [name.lower() for name in names]
    return [names[at] for group in _groups(names) for at in group.columns]


def _chosen(
    names: Sequence[str], groups: Sequence[_Group], rotation: str, what: str
) -> RotationColumns | None:
    """Return the only rotation of a table, read as `rotation` says; refuse all that is ambiguous."""
    if not groups:
        if rotation:
            given = f"{what} without the angles that rotation={rotation} reads"
            raise InputError(given, "columns such as a,b,c or rx,ry,rz", "set rotation=none for none")
        return None
    group = groups[0]
    quoted = ", ".join(names[at] for each in groups for at in each.columns)
    if len(groups) > 1 or not group.meanings:
        given = f"{what} with {quoted}, which may be a rotation"
        allowed = "three angles such as a,b,c or rx,ry,rz, or the four numbers of a quaternion, once"
        raise InputError(given, allowed, "leave the others out, or set rotation=none to read no rotation")
    if rotation not in group.meanings:
        values = ", ".join(f"{each} ({ROTATIONS[each]})" for each in group.meanings)
        remedy = f"say which with rotation={group.meanings[0]}, and angles=deg for degrees"
        said = f", which rotation={rotation} does not read" if rotation else ", which are ambiguous"
        raise InputError(f"{what} with {quoted}{said}", f"{values}, or none to ignore them", remedy)
    columns = group.columns
    if group.by_axis and rotation == "moving_zyx":  # each angle belongs to the axis in its name
        columns = columns[::-1]
    return RotationColumns(columns=columns, rotation=rotation)


def _groups(names: Sequence[str]) -> list[_Group]:
    """Return the columns that look like a rotation, in groups of the same words."""
    axes: _Found = defaultdict(dict)
    letters: _Found = defaultdict(dict)
    numbers: _Found = defaultdict(dict)
    alone: list[int] = []
    for at, name in enumerate(names):
        *before, last = _words(name) or [""]
        stem = before[-1] if before else ""
        if name in PLACE or any(map(_is_other, before)):
            continue
        if found := _axis(stem, last):
            axes[(*before, found[0])][found[1]] = at
        elif last.isdecimal() and stem:
            numbers[(*before,)][last] = letters[(*before[:-1],)][stem + last] = at
        elif _is_rotation(last):
            alone.append(at)
        else:
            letters[(*before,)][last] = at
    groups = [_of_axes(found, roll=key[-1] == _ROLL) for key, found in axes.items()]
    groups += [group for found in letters.values() for group in _of_letters(found)]
    groups += [group for key, found in numbers.items() for group in _of_numbers(key[-1], found)]
    return [*groups, *([_Group(columns=tuple(alone))] if alone and not groups else [])]


def _axis(stem: str, last: str) -> tuple[str, str] | None:
    """Return the word before the axis in a rotation's name and the axis; None where there is no axis."""
    if last in _WORDS:
        return _ROLL, _WORDS[last]
    if last[-1:] and last[-1] in "xyzw" and _names_rotation(last[:-1] or stem):
        return last[:-1], last[-1]
    return None


def _of_axes(found: Mapping[str, int], *, roll: bool) -> _Group:
    """Return the columns of names with axes; without a meaning where some are missing."""
    ordered = tuple(found[axis] for axis in "xyzw" if axis in found)
    meanings = {"xyz": _BY_AXIS[roll:], "wxyz": ("xyzw",)}.get("".join(sorted(found)), ())
    return _Group(columns=ordered, meanings=meanings, by_axis=True)


def _of_letters(found: Mapping[str, int]) -> Iterator[_Group]:
    """Yield the columns of a rotation whose names have no axes."""
    for order, first in _LETTERS.items():
        if {*order} <= found.keys():
            meanings = tuple(dict.fromkeys((first, *_ANGLES)))
            yield _Group(columns=tuple(found[each] for each in order), meanings=meanings)


def _of_numbers(stem: str, found: Mapping[str, int]) -> Iterator[_Group]:
    """Yield the columns of a quaternion or a matrix with numbers; more than four may be a robot's joints."""
    ordered = tuple(found[number] for number in sorted(found))
    if _names_rotation(stem) and "".join(sorted(found)) in ("0123", "1234"):
        yield _Group(columns=ordered, meanings=_QUATERNIONS)
    elif stem in ("r", "rot", "rotation", "m") and len(found) >= _MATRIX_COUNT:
        yield _Group(columns=ordered)


def _words(name: str) -> list[str]:
    """Return the words and numbers of a name in lower case, without units."""
    words = re.findall(r"[a-z]+|\d+", re.sub(r"[\[(].*?[\])]", " ", name.lower()))
    return [word for word in words if not _is_unit(word)]
