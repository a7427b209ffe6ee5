"""The loop that records source and instruments into a session, readable top to bottom."""

import errno
import os
import sys
import time
from collections import Counter
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager, suppress

from monochord.capture.recording.counters import RecordingCounters, RecordingState
from monochord.capture.recording.disk import is_full, refuse_place, written_through
from monochord.capture.recording.pumps import InstrumentReadings, Pumps, pumping
from monochord.capture.recording.settings import RecordingJob
from monochord.capture.recording.streams import with_unique_streams
from monochord.capture.recording.summary import RecordingSummary
from monochord.capture.recording.watch import RecordingWatch
from monochord.core.clock import clock_offsets
from monochord.core.errors import InputError, MonochordError
from monochord.core.interruption import Interruption, interruption
from monochord.core.reasons import Reason
from monochord.core.units import Seconds
from monochord.dsp.microphones import compile_looks
from monochord.sessions import Event, SessionClock, SessionWriter
from monochord.sessions.file import size_limit

WRITE_INTERVAL: Seconds = 0.1
"""Time between writes in s: the most that a kill can lose."""
CLOCK_INTERVAL: Seconds = 1.0
"""Time between stored clock offsets."""
HARMLESS = ("stop", "back", "sound")
"""Event kinds that are not flags."""
STOP_TIMEOUT: Seconds = 5.0
"""Time that the threads may take to end."""
NICE = -11
"""Priority of sound servers."""

Show = Callable[[RecordingState, Sequence[Event]], None]


def record(
    job: RecordingJob, show: Show = lambda _now, _notices: None, stop: Interruption | None = None
) -> RecordingSummary:
    """Record until the source ends, the time is over, the disk is full or the end is requested.

    Separate threads read the source and the instruments; this thread writes every 0.1 s, so that a kill loses
    no more than that. Every problem becomes an event in the session.

    Parameters
    ----------
    job
        Source, instruments and file.
    show
        Called after each write with the recording's state and new notices; must return quickly.
    stop
        Requests the end from another thread; by default the signals below do.

    Returns
    -------
    RecordingSummary
        The saved data. The file is complete and valid, even where `failure` reports a full disk or a lost
        device. A first Control-C, SIGTERM or SIGHUP ends the loop and is not raised, unless devices are still
        being opened: then it is raised at once, and no file is left.

    Raises
    ------
    InputError
        If the file exists, its disk is too full to start, or an option cannot be used; no file is left.
    DeviceError
        If a device is absent at the start; no file is left.
    """
    refuse_place(job.path, job.disk.start)
    compile_looks()
    with ExitStack() as stack:
        stop = stop or stack.enter_context(interruption())
        stack.enter_context(raised_priority())
        clock = SessionClock.now()
        with stop.at_once():
            stream = stack.enter_context(job.source.open())
            connections = {name: stack.enter_context(it.open()) for name, it in job.instruments.items()}
        connections = with_unique_streams(connections)
        counters = RecordingCounters(stream, connections, job.path.parent, reserve=job.disk.stop)
        # Read from here on: creating a file takes longer than a device's buffer may last.
        pumps = stack.enter_context(pumping(stream, connections, job.queue_bytes))
        feeds = tuple(connection.feed for connection in connections.values())
        writer = SessionWriter(job.path, job.about.describe(job.path.stem, stream.signal, feeds), clock)
        watch, flags, ending = RecordingWatch(job.disk.warn), Counter[str](), RecordingEnd(job)
        progress, clocks_due, over = None, 0.0, False
        with saved(writer, ending), written_through(writer.sync) as disk_errors:
            while not over:
                time.sleep(WRITE_INTERVAL)
                over = pumps.ended or ending.overdue  # checked before the queue is emptied for the last time
                for batch in pumps.queue.take():
                    if isinstance(batch, InstrumentReadings):
                        writer.readings(batch.readings)
                    else:
                        writer.audio(batch)
                    counters.add(batch)
                now = counters.look(writer.size, pumps)
                notices = watch.look(now, last=over)
                if now.time >= clocks_due:
                    clocks_due = now.time + CLOCK_INTERVAL
                    offsets = {**now.health.clock_offsets, **clock_offsets()}
                    writer.clocks(now.time, offsets)
                    notices += watch.clocks(now.time, offsets)
                notices += ending.look(
                    now, pumps, requested=stop.requested, disk_errors=disk_errors, audio=counters.audio_end
                )
                for notice in notices:
                    writer.event(notice.time, notice.kind, notice.text, **notice.data)
                    flags[notice.kind] += notice.kind not in HARMLESS
                for entry in job.events(now.time):
                    writer.event(entry.time, entry.kind, entry.text, **entry.data)
                writer.flush()
                progress = now
                show(now, notices)
                if ending.reason:
                    pumps.stop()
        return RecordingSummary.of(
            job.path,
            progress or counters.look(writer.size, pumps),
            flags=+flags,
            size=job.path.stat().st_size,
            stopped=ending.reason,
            failure=ending.failure,
        )


class RecordingEnd:
    """Decides when a recording ends: `reason` is empty until then, and `failure` is empty on success."""

    def __init__(self, job: RecordingJob) -> None:
        self.reason, self.failure = Reason.NONE, ""
        self._job = job
        self._since: Seconds = 0.0
        self._reported: set[str] = set()

    @property
    def overdue(self) -> bool:
        """Whether the threads are taking too long to end."""
        late = bool(self.reason) and time.monotonic() - self._since > STOP_TIMEOUT
        if late:
            self.failure = self.failure or "a device did not stop; its last data are not saved"
        return late

    def look(
        self,
        now: RecordingState,
        pumps: Pumps,
        *,
        requested: bool,
        disk_errors: Sequence[OSError],
        audio: Seconds,
    ) -> list[Event]:
        """Check for a reason to end and return notices about it; `audio` is the recorded duration."""
        notices = [
            Event(time=now.time, kind="failed", text=f"{name}: {_line(error)}", data={"stream": name})
            for name, error in list(pumps.failures.items())
            if name not in self._reported
        ]
        self._reported.update(pumps.failures)
        for error in pumps.failures.values():
            self.failure = self.failure or _line(error)
        if self.reason:
            return notices
        if requested:
            self.reason = Reason.REQUESTED
        elif pumps.source_ended:
            self.reason = Reason.SOURCE_FAILED if "audio" in pumps.failures else Reason.SOURCE_ENDED
        elif disk_errors:
            self.full(disk_errors[0])
        elif now.space.free < self._job.disk.stop:
            self.full(None)
        elif max(now.elapsed, audio) >= self._job.seconds or self._job.finished(now.time):
            self.reason = Reason.TIME_OVER
        if self.reason:
            self._since = time.monotonic()
            notices.append(Event(time=now.time, kind="stop", text=self.reason))
        return notices

    def full(self, error: OSError | None) -> None:
        """End the recording because the disk is full or the file has reached its size limit."""
        if error and error.errno == errno.EFBIG:
            self.reason = self.reason or Reason.FILE_FULL
            limit = size_limit()
            size = "of its file system" if limit == sys.maxsize else f"of {1e-6 * limit:.1f} MB (ulimit -f)"
            given = (
                f"file '{self._job.path}' (at the limit {size} on file size; the recording so far is saved)"
            )
            allowed, remedy = (
                "a shorter recording",
                "raise the limit; FAT32 allows 4 GB per file, other file systems more",
            )
        else:
            self.reason = self.reason or Reason.DISK_FULL
            why = error.strerror if error else f"less than {1e-6 * self._job.disk.stop:.0f} MB free"
            given = f"disk of '{self._job.path}' ({why}; the recording so far is saved)"
            allowed, remedy = "a disk with free space", "free some space, or record elsewhere"
        self.failure = self.failure or str(InputError(given, allowed, remedy))


@contextmanager
def saved(writer: SessionWriter, ending: RecordingEnd) -> Generator[None]:
    """Close the session in any case; a full disk ends the recording without raising."""
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


@contextmanager
def raised_priority() -> Generator[None]:
    """Raise the priority of this thread and the threads it starts; does nothing without permission."""
    before = os.getpriority(os.PRIO_PROCESS, 0)  # Linux has one for each thread
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, min(NICE, before))
    try:
        yield
    finally:
        os.setpriority(os.PRIO_PROCESS, 0, before)
