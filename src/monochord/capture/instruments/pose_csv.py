"""The robot's pose from a CSV file that its controller keeps appending to."""

import logging
import math
import os
import stat
from collections.abc import Generator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from types import MappingProxyType
from typing import IO, Annotated, Literal, NamedTuple

from msgspec import Meta

from monochord.capture.instruments._collected import NANOSECONDS, NONE, CollectedConnection
from monochord.capture.instruments._columns import PoseColumns, pose_columns
from monochord.capture.instruments._pose import UPRIGHT, pose_feed, quaternion_of, unit_pose
from monochord.capture.instruments.base import Instrument
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Feed, Readings
from monochord.core.units import Hertz, Metres, Seconds

FIRST_LINE = "a first line time,x,y,z[,qx,qy,qz,qw], or with three angles such as a,b,c or rx,ry,rz"
MAX_READ = 1 << 20  # bytes a poll
LONGEST_LINE = 4096
"""Longest line in bytes; a longer line is faulty and is not kept in memory."""
LATEST = 9.2e9  # s, what 64 bits of nanoseconds hold
METRES = MappingProxyType({"m": 1.0, "mm": 1e-3})
RADIANS = MappingProxyType({"rad": 1.0, "deg": math.pi / 180.0})
ANGLES = 3
WHOLE_TURN = 2.0 * math.pi + 1e-3
"""Largest angle in rad: robots report at most one turn, so a larger angle is probably in degrees."""
_log = logging.getLogger("monochord")


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseCsv(Instrument):
    """Poses from lines appended to the CSV file at `path` after opening.

    The first line names the columns: ``time,x,y,z``, optionally ``qx,qy,qz,qw``, and any others, which a line
    in the log names as unread. Columns that look like another rotation (``a,b,c``, ``rx,ry,rz``,
    ``roll,pitch,yaw``, ``w,p,r``, ``euler_x``..., ``q1`` to ``q4``) are read if `rotation` states their
    meaning; otherwise the file is refused.

    A reading's time is that of the poll that read its line, delayed by the poll interval and the writer's
    buffering; its `device_time` is the column ``time``, in s of the controller's clock, converted to ns.
    Incomplete lines wait until they are complete. A replaced file is read from its beginning. An invalid pose
    counts as faulty, and so do a line longer than 4096 bytes, a position beyond `reach` and an angle beyond
    one turn. A file whose last line is in different units is refused. The path may be a FIFO, whose lines are
    read as they arrive; a FIFO without a writer is not an error.

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
        rotated z; ``moving_zyx``, about z, then the rotated y, then the rotated x (A, B, C of KUKA);
        ``moving_zyz``, about z, then the rotated y, then the rotated z. Order of a quaternion's numbers:
        ``wxyz``, ``xyzw``. ``none`` ignores them.
    angles
        Unit of the angles in the file: ``rad`` or ``deg``.
    reach
        Largest coordinate along each axis, in m.
    """

    path: str
    from_start: bool = False
    rate: Hertz = 0.0
    unit: Literal["m", "mm"] = "m"
    rotation: Literal[
        "", "vector", "fixed_xyz", "moving_xyz", "moving_zyx", "moving_zyz", "wxyz", "xyzw", "none"
    ] = ""
    angles: Literal["rad", "deg"] = "rad"
    reach: Annotated[Metres, Meta(gt=0.0, le=1e7)] = 10.0

    @contextmanager
    def open(self) -> Generator["_PoseCsvConnection"]:
        """Open the file; raises `DeviceError` where it is missing, `InputError` for invalid columns."""
        details = {"path": self.path, "unit": self.unit}
        if self.rotation:
            details |= {"rotation": self.rotation, "angles": self.angles}
        with closing(_PoseCsvConnection(self, pose_feed(self.rate, details))) as connection:
            connection.open()
            yield connection


class _PoseCsvConnection(CollectedConnection):
    def __init__(self, options: PoseCsv, feed: Feed) -> None:
        super().__init__(feed)
        self._options, self._path = options, Path(options.path)
        self._file: IO[bytes] | None = None
        self._rest = b""
        self._too_long = False
        self._columns: PoseColumns | None = None
        self._headed = False

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
            self._headed, self._columns = True, self._columns_of(head)
        else:
            self._rest = head
        lines = self._rest
        if self._headed and self._file.seekable():
            place = self._file.tell()
            size = self._file.seek(0, os.SEEK_END)
            self._file.seek(max(size - LONGEST_LINE, len(head) + 1))
            lines = self._file.read(LONGEST_LINE) or b""
            if self._options.from_start:
                self._file.seek(place)
            else:
                self._rest = lines.rpartition(b"\n")[2]  # begun, but not yet complete
        if self._headed:
            self._refuse_units(lines.rpartition(b"\n")[0].rpartition(b"\n")[2])

    def _columns_of(self, line: bytes) -> PoseColumns:
        """Return what the columns of a first line are, and log the names that are not read."""
        columns = pose_columns(_names(line), self._options.rotation, f"pose file {self._path}", FIRST_LINE)
        if columns.unread:
            _log.warning("monochord: pose file %s: not read: %s", self._path, ", ".join(columns.unread))
        return columns

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
            elif not self._headed:
                self._read_head(line)
            elif line.strip():
                self._read(line, now)
        if len(self._rest) > LONGEST_LINE:
            self._collected.refuse(not self._too_long)
            self._too_long = True
        if self._too_long:
            self._rest = b""
        return self._collected.take()

    def _read_head(self, line: bytes) -> None:
        """Read the first line of a file that came later; where it is refused, no line after it is a pose."""
        self._headed = True
        try:
            self._columns = self._columns_of(line)
        except InputError as error:
            _log.warning("monochord: %s", error)

    def _read(self, line: bytes, now: float) -> None:
        parsed = self._parsed(line)
        pose = parsed.unit_pose(self._options) if parsed else None
        if parsed is None or pose is None:
            return self._collected.refuse()
        tick = round(parsed.stamp * NANOSECONDS)
        return self._collected.add(pose, time=now, tick=tick if tick >= 0 else NONE)

    def _parsed(self, line: bytes) -> "_Line | None":
        """Return the numbers of a line in SI units; None for an invalid pose."""
        options, columns = self._options, self._columns
        if columns is None:
            return None
        turn = columns.turn
        try:
            fields = line.decode("utf-8").split(",")
            stamp, *place = (float(fields[at]) for at in columns.place)
            numbers = [float(fields[at]) for at in turn.columns] if turn else UPRIGHT
        except (ValueError, IndexError):
            return None
        if len(fields) != columns.count:
            return None
        angles = [0.0]
        if turn and len(numbers) == ANGLES:
            angles = numbers = [RADIANS[options.angles] * angle for angle in numbers]
        orientation = quaternion_of(turn.rotation, numbers) if turn else numbers
        return _Line(stamp, [METRES[options.unit] * part for part in place], orientation, angles)

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
        self._file, self._rest, self._too_long = fresh, b"", False
        self._headed, self._columns = False, None
        return True


class _Line(NamedTuple):
    """A line: time stamp in s, x, y, z in m, a quaternion, and the angles in rad behind it, [0] for none."""

    stamp: Seconds
    place: Sequence[Metres]
    turn: Sequence[float]
    angles: Sequence[float]

    def unit_pose(self, options: PoseCsv) -> tuple[float, ...] | None:
        """Return x, y, z and a unit quaternion, or None for a pose out of range."""
        near = all(abs(part) <= options.reach for part in self.place)
        if not (near and all(abs(angle) <= WHOLE_TURN for angle in self.angles) and abs(self.stamp) < LATEST):
            return None  # NaN too is not within any bound
        return unit_pose(self.place, self.turn)


def _opened(path: Path) -> IO[bytes]:
    """Open a file so that neither opening nor reading waits for a writer, even for a FIFO."""
    return open(path, "rb", buffering=0, opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK))


def _names(line: bytes) -> list[str]:
    return [name.strip().lower() for name in line.decode("utf-8", "replace").lstrip("\ufeff").split(",")]
