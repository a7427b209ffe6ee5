"""When a recording ends, and why."""

import errno
import sys
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager

from monochord.capture.recording.disk import is_full
from monochord.capture.recording.progress import Progress
from monochord.capture.recording.pumps import Pumps
from monochord.capture.recording.settings import Job
from monochord.capture.recording.summary import ASKED
from monochord.capture.recording.watch import Notice
from monochord.core.errors import InputError, MonochordError
from monochord.core.units import Seconds
from monochord.sessions import SessionWriter
from monochord.sessions.file import size_limit

PATIENCE: Seconds = 5.0
"""How long threads that were told to end may take for it."""


class Ending:
    """Watches for the end of a job: `reason` is empty until then, and `failure` where nothing went wrong."""

    def __init__(self, job: Job) -> None:
        self.reason = self.failure = ""
        self._job = job
        self._since: Seconds = 0.0
        self._told: set[str] = set()

    @property
    def overdue(self) -> bool:
        """Whether threads that were told to end take too long."""
        late = bool(self.reason) and time.monotonic() - self._since > PATIENCE
        if late:
            self.failure = self.failure or "a device did not let go; what it still had is not saved"
        return late

    def look(
        self, now: Progress, pumps: Pumps, *, asked: bool, disk_errors: Sequence[OSError], audio: Seconds
    ) -> list[Notice]:
        """Find a reason to end, `audio` being how much there is; return what is to be noted of it."""
        notices = [
            Notice(time=now.time, kind="failed", text=f"{name}: {_line(error)}", data={"stream": name})
            for name, error in list(pumps.failures.items())
            if name not in self._told
        ]
        self._told.update(pumps.failures)
        for error in pumps.failures.values():
            self.failure = self.failure or _line(error)
        if self.reason:
            return notices
        if asked:
            self.reason = ASKED
        elif pumps.source_ended:
            self.reason = "the source failed" if "audio" in pumps.failures else "the source ended"
        elif disk_errors:
            self.full(disk_errors[0])
        elif now.space.free < self._job.disk.stop:
            self.full(None)
        elif max(now.elapsed, audio) >= self._job.seconds or self._job.enough(now.time):
            self.reason = "the time is over"
        if self.reason:
            self._since = time.monotonic()
            notices.append(Notice(time=now.time, kind="stop", text=self.reason))
        return notices

    def full(self, error: OSError | None) -> None:
        """Take it that the disk, or the file, can take no more."""
        if error and error.errno == errno.EFBIG:
            self.reason = self.reason or "the file is as large as files may be"
            limit = size_limit()
            most = "of its file system" if limit == sys.maxsize else f"of {1e-6 * limit:.1f} MB (ulimit -f)"
            given = (
                f"file '{self._job.path}' (at the limit {most} on a file's size; what was recorded is saved)"
            )
            allowed, remedy = "a shorter recording", "raise the limit; FAT32 holds 4 GB a file, others more"
        else:
            self.reason = self.reason or "the disk is full"
            why = error.strerror if error else f"less than {1e-6 * self._job.disk.stop:.0f} MB free"
            given = f"disk of '{self._job.path}' ({why}; what was recorded is saved)"
            allowed, remedy = "one with room", "make room, or record elsewhere"
        self.failure = self.failure or str(InputError(given, allowed, remedy))


@contextmanager
def saved(writer: SessionWriter, ending: Ending) -> Generator[None]:
    """Close the session whatever happens; a disk that is full ends the recording and is not raised."""
    try:
        try:
            yield
        finally:
            writer.close()
    except OSError as error:
        if not is_full(error):
            raise
        ending.full(error)


def _line(error: Exception) -> str:
    return str(error) if isinstance(error, MonochordError) else f"{type(error).__name__}: {error}"
