"""The robot's pose from a CSV file that its controller keeps appending to."""

import math
import os
import stat
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from types import MappingProxyType
from typing import IO, Annotated, Literal, NamedTuple

from msgspec import Meta

from monochord.capture.instruments._collected import NANOSECONDS, NONE, Collected
from monochord.capture.instruments._pose import UPRIGHT, pose_feed, quaternion_of, unit_pose
from monochord.capture.instruments.base import Connection, Instrument
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Feed, InstrumentHealth, Readings
from monochord.core.units import Hertz, Metres, Seconds

PLACE = ("time", "x", "y", "z")
TURN = ("qx", "qy", "qz", "qw")
ANGLES = (("rx", "ry", "rz"), ("roll", "pitch", "yaw"))
FIRST_LINE = "a first line time,x,y,z[,qx,qy,qz,qw], or with rx,ry,rz or roll,pitch,yaw"
MAX_READ = 1 << 20  # bytes a poll
LONGEST_LINE = 4096
"""Longest line in bytes; a longer line is faulty and is not kept in memory."""
LATEST = 9.2e9  # s, what 64 bits of nanoseconds hold
METRES = MappingProxyType({"m": 1.0, "mm": 1e-3})
RADIANS = MappingProxyType({"rad": 1.0, "deg": math.pi / 180.0})
WHOLE_TURN = 2.0 * math.pi + 1e-3
"""Largest angle in rad: robots report at most one turn, so a larger angle is probably in degrees."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseCsv(Instrument):
    """Poses from lines appended to the CSV file at `path` after opening.

    The first line names the columns: ``time,x,y,z``, optionally ``qx,qy,qz,qw``, and any others. Three angles
    ``rx,ry,rz`` or ``roll,pitch,yaw`` can replace the quaternion if `rotation` states their meaning;
    otherwise the file is refused. A reading's time is that of the poll that read its line, delayed by the
    poll interval and the writer's buffering; its `device_time` is the column ``time``, in s of the
    controller's clock, converted to ns. Incomplete lines wait until they are complete. A replaced file is
    read from its beginning. An invalid pose counts as faulty, and so do a line longer than 4096 bytes, a
    position beyond `reach` and an angle beyond one turn. A file whose last line is in different units is
    refused. The path may be a FIFO, whose lines are read as they arrive; a FIFO without a writer is not an
    error.

    Parameters
    ----------
    path
        The file, which must exist.
    from_start
        Whether to read existing lines too.
    rate
        Expected poses per second; 0 if unknown.
    unit
        Unit of x, y and z in the file: ``m`` or ``mm``.
    rotation
        Meaning of three angles: ``vector``, rotation axis times angle; ``fixed_xyz``, rotations about the
        fixed axes x, then y, then z (roll, pitch, yaw); ``moving_xyz``, about x, then the rotated y, then the
        rotated z; ``none`` ignores them.
    angles
        Unit of the angles in the file: ``rad`` or ``deg``.
    reach
        Largest coordinate along each axis, in m.
    """

    path: str
    from_start: bool = False
    rate: Hertz = 0.0
    unit: Literal["m", "mm"] = "m"
    rotation: Literal["", "vector", "fixed_xyz", "moving_xyz", "none"] = ""
    angles: Literal["rad", "deg"] = "rad"
    reach: Annotated[Metres, Meta(gt=0.0, le=1e7)] = 10.0

    @contextmanager
    def open(self) -> Generator["_PoseCsvConnection"]:
        """Open the file; raises `DeviceError` where it is missing, `InputError` for invalid columns."""
        details = {"path": self.path, "unit": self.unit}
        if self.rotation:
            details |= {"rotation": self.rotation, "angles": self.angles}
        connection = _PoseCsvConnection(self, pose_feed(self.rate, details))
        try:
            connection.open()
            yield connection
        finally:
            connection.close()


class _PoseCsvConnection(Connection):
    def __init__(self, options: PoseCsv, feed: Feed) -> None:
        self._options, self._path = options, Path(options.path)
        self._collected = Collected(feed)
        self._file: IO[bytes] | None = None
        self._rest = b""
        self._too_long = False
        self._columns: list[str] = []

    @property
    def feed(self) -> Feed:
        return self._collected.feed

    @property
    def health(self) -> InstrumentHealth:
        return self._collected.health

    def open(self) -> None:
        try:
            self._file = _opened(self._path)
            head, newline, self._rest = (self._file.read(LONGEST_LINE + 1) or b"").partition(b"\n")
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise DeviceError(f"pose file {self._path}: {reason}") from error
        if len(head) > LONGEST_LINE:
            given = f"pose file {self._path} with a first line longer than {LONGEST_LINE} bytes"
            raise InputError(given, FIRST_LINE)
        if newline:
            self._columns = _names(head)
            self._refuse_columns()
        else:
            self._rest = head
        lines = self._rest
        if self._columns and self._file.seekable():
            place = self._file.tell()
            size = self._file.seek(0, os.SEEK_END)
            self._file.seek(max(size - LONGEST_LINE, len(head) + 1))
            lines = self._file.read(LONGEST_LINE) or b""
            if self._options.from_start:
                self._file.seek(place)
            else:
                self._rest = lines.rpartition(b"\n")[2]  # begun, but not yet complete
        if self._columns:
            self._refuse_units(lines.rpartition(b"\n")[0].rpartition(b"\n")[2])

    def _refuse_columns(self) -> None:
        """Refuse columns that are not a pose, and angles without a stated meaning."""
        columns = {*self._columns}
        groups = [group for group in (TURN, *ANGLES) if columns & {*group}]
        lacking = [name for group in (PLACE, *groups) for name in group if name not in columns]
        if lacking:
            raise InputError(f"pose file {self._path} without {', '.join(lacking)}", FIRST_LINE)
        if groups and TURN not in groups and not self._options.rotation:
            names = ", ".join(groups[0])
            given = f"pose file {self._path} with {names}, which are ambiguous"
            allowed = "vector (axis times angle), fixed_xyz (roll, pitch, yaw), moving_xyz, or none"
            raise InputError(given, allowed, "say which with rotation=, and angles=deg for degrees")

    def _refuse_units(self, line: bytes) -> None:
        """Refuse a file whose last line has a pose in other units than the options state."""
        pose, options = self._parsed(line), self._options
        if pose is None:
            return
        farthest, widest = max(map(abs, pose.place)), max(map(abs, pose.angles))
        if options.reach < farthest < math.inf:
            given = f"pose file {self._path} with a place {farthest:g} m away"
            remedy = "for millimetres set unit=mm, for a longer reach set reach="
            raise InputError(given, f"up to {options.reach:g} m", remedy)
        if WHOLE_TURN < widest < math.inf:
            given = f"pose file {self._path} with an angle of {widest:g} rad"
            raise InputError(given, "up to a turn, 6.28 rad", "for degrees set angles=deg")

    def close(self) -> None:
        if self._file:
            self._file.close()
            self._file = None

    def poll(self) -> list[Readings]:
        if self._was_written_anew():
            self._collected.returned()
        if not self._file:
            return []
        now = monotonic()
        *lines, self._rest = (self._rest + (self._file.read(MAX_READ) or b"")).split(b"\n")
        for line in lines:
            if self._too_long:
                self._too_long = False  # and this is its end
            elif len(line) > LONGEST_LINE:
                self._collected.refuse()
            elif not self._columns:
                self._columns = _names(line)
            elif line.strip():
                self._read(line, now)
        if len(self._rest) > LONGEST_LINE:
            self._collected.refuse(not self._too_long)
            self._too_long = True
        if self._too_long:
            self._rest = b""
        return self._collected.take()

    def _read(self, line: bytes, now: float) -> None:
        parsed = self._parsed(line)
        pose = parsed.unit_pose(self._options) if parsed else None
        if parsed is None or pose is None:
            return self._collected.refuse()
        tick = round(parsed.stamp * NANOSECONDS)
        return self._collected.add(pose, time=now, tick=tick if tick >= 0 else NONE)

    def _parsed(self, line: bytes) -> "_Line | None":
        """Return the numbers of a line in SI units; None for an invalid pose."""
        options = self._options
        try:
            fields = dict(zip(self._columns, line.decode("utf-8").split(","), strict=True))
            stamp, *place = (float(fields[name]) for name in PLACE)
            turn = [float(fields[name]) for name in TURN] if {*TURN} <= fields.keys() else ()
            named = [] if turn else [group for group in ANGLES if {*group} <= fields.keys()]
            angles = [float(fields[name]) for name in named[0]] if named else [0.0]
        except (ValueError, KeyError):
            return None
        if named and not options.rotation:
            return None
        if not named or options.rotation == "none":
            return _Line(stamp, [METRES[options.unit] * part for part in place], turn or UPRIGHT, [0.0])
        angles = [RADIANS[options.angles] * angle for angle in angles]
        return _Line(stamp, [METRES[options.unit] * part for part in place], (), angles)

    def _was_written_anew(self) -> bool:
        """Whether the file was replaced or truncated; it is then read from its beginning."""
        try:
            named = self._path.stat()
            if self._file:
                opened = os.fstat(self._file.fileno())
                same = (named.st_ino, named.st_dev) == (opened.st_ino, opened.st_dev)
                if same and (not stat.S_ISREG(named.st_mode) or named.st_size >= self._file.tell()):
                    return False
            fresh = _opened(self._path)
        except OSError:
            return False
        self.close()
        self._file, self._rest, self._too_long, self._columns = fresh, b"", False, []
        return True


class _Line(NamedTuple):
    """A line: time stamp in s, x, y, z in m, and a quaternion or, if that is empty, three angles in rad."""

    stamp: Seconds
    place: Sequence[Metres]
    turn: Sequence[float]
    angles: Sequence[float]

    def unit_pose(self, options: PoseCsv) -> tuple[float, ...] | None:
        """Return x, y, z and a unit quaternion, or None for a pose out of range."""
        near = all(abs(part) <= options.reach for part in self.place)
        if not (near and all(abs(angle) <= WHOLE_TURN for angle in self.angles) and abs(self.stamp) < LATEST):
            return None  # NaN too is not within any bound
        rotation = options.rotation
        if self.turn or rotation == "" or rotation == "none":  # noqa: PLR1714  (a type checker follows it)
            return unit_pose(self.place, self.turn)
        return unit_pose(self.place, quaternion_of(rotation, self.angles))


def _opened(path: Path) -> IO[bytes]:
    """Open a file so that neither opening nor reading waits for a writer, even for a FIFO."""
    return open(path, "rb", buffering=0, opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK))


def _names(line: bytes) -> list[str]:
    return [name.strip().lower() for name in line.decode("utf-8", "replace").lstrip("\ufeff").split(",")]
