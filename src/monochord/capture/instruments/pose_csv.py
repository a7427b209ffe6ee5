"""The robot's pose from a CSV file that its controller goes on writing."""

import os
import stat
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import IO

from monochord.capture.instruments._collected import NANOSECONDS, NONE, Collected
from monochord.capture.instruments._pose import UPRIGHT, pose_feed, unit_pose
from monochord.capture.instruments.base import Connection, Instrument
from monochord.core.errors import DeviceError, InputError
from monochord.core.types import Feed, InstrumentHealth, Readings
from monochord.core.units import Hertz

PLACE = ("time", "x", "y", "z")
TURN = ("qx", "qy", "qz", "qw")
MAX_READ = 1 << 20  # bytes a poll
LONGEST_LINE = 4096
"""Bytes of a line; a longer one is faulty, and is not kept in memory."""
LATEST = 9.2e9  # s, what 64 bits of nanoseconds hold


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseCsv(Instrument):
    """Lines that are appended to the file at `path`, from the moment of opening on.

    Its first line names the columns: ``time,x,y,z`` and perhaps ``qx,qy,qz,qw``, others besides. A reading
    bears the time at which a poll found its line, which is as late as polls are rare and the writer
    buffers; its `device_time` is the column ``time``, s of the controller's clock, in ns. A line is read
    once it is complete. A file that is written anew is read from its top. What is no pose counts as faulty,
    and so does a line longer than 4096 bytes or a place more than 1e7 m away. The path may be that of a FIFO,
    whose lines are read as they come; that nobody writes to it is no error.

    Parameters
    ----------
    path
        The file, which must be there.
    from_start
        Whether the lines that are there already count too.
    rate
        Poses a second that are due; 0 where that is not known.
    """

    path: str
    from_start: bool = False
    rate: Hertz = 0.0

    @contextmanager
    def open(self) -> Generator["_PoseCsvConnection"]:
        """Open the file; raises `DeviceError` without one, `InputError` for columns that are no pose."""
        feed = pose_feed(self.rate, {"path": self.path})
        connection = _PoseCsvConnection(Path(self.path), feed)
        try:
            connection.open(from_start=self.from_start)
            yield connection
        finally:
            connection.close()


class _PoseCsvConnection(Connection):
    def __init__(self, path: Path, feed: Feed) -> None:
        self._path = path
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

    def open(self, *, from_start: bool) -> None:
        try:
            self._file = _opened(self._path)
            head, newline, self._rest = (self._file.read(LONGEST_LINE + 1) or b"").partition(b"\n")
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or error
            raise DeviceError(f"pose file {self._path}: {reason}") from error
        if len(head) > LONGEST_LINE:
            given = f"pose file {self._path} whose first line is longer than {LONGEST_LINE} bytes"
            raise InputError(given, "a first line time,x,y,z[,qx,qy,qz,qw]")
        if newline:
            self._columns = _names(head)
            lacking = [name for name in PLACE if name not in self._columns]
            if lacking:
                given = f"pose file {self._path} without {', '.join(lacking)}"
                raise InputError(given, "a first line time,x,y,z[,qx,qy,qz,qw]")
        else:
            self._rest = head
        if not from_start and self._columns and self._file.seekable():
            size = self._file.seek(0, os.SEEK_END)
            self._file.seek(max(size - LONGEST_LINE, 0))
            tail = self._file.read(LONGEST_LINE) or b""
            self._rest = tail.rpartition(b"\n")[2]  # begun, but not yet complete

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
        try:
            fields = dict(zip(self._columns, line.decode("utf-8").split(","), strict=True))
            stamp, *place = (float(fields[name]) for name in PLACE)
            turn = [float(fields[name]) for name in TURN] if set(TURN) <= fields.keys() else UPRIGHT
        except (ValueError, KeyError):
            return self._collected.refuse()
        pose = unit_pose(place, turn)
        if pose is None or not abs(stamp) < LATEST:
            return self._collected.refuse()
        tick = round(stamp * NANOSECONDS)
        return self._collected.add(pose, time=now, tick=tick if tick >= 0 else NONE)

    def _was_written_anew(self) -> bool:
        """Whether the file is another than before, or shorter; it is then at its top."""
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


def _opened(path: Path) -> IO[bytes]:
    """Open a file so that neither this nor reading waits for whoever writes to it, as a FIFO has it."""
    return open(path, "rb", buffering=0, opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK))


def _names(line: bytes) -> list[str]:
    return [name.strip().lower() for name in line.decode("utf-8", "replace").lstrip("\ufeff").split(",")]
