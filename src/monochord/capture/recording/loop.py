"""The loop from source and instruments to a session, readable top to bottom."""

import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import ExitStack

from monochord.capture.recording._ending import Ending, saved
from monochord.capture.recording._priority import precedence
from monochord.capture.recording.disk import refuse_place, written_through
from monochord.capture.recording.progress import Progress
from monochord.capture.recording.pumps import Polled, pumping
from monochord.capture.recording.settings import Job
from monochord.capture.recording.streams import told_apart
from monochord.capture.recording.summary import Summary
from monochord.capture.recording.tally import Tally
from monochord.capture.recording.watch import Notice, Watch
from monochord.core.clock import clock_offsets
from monochord.core.interruption import interruption
from monochord.core.units import Seconds
from monochord.sessions import SessionClock, SessionWriter

EVERY: Seconds = 0.1
"""From one writing to the next: what a kill may cost."""
CLOCKS_EVERY: Seconds = 1.0
FINE = ("stop", "back")
"""Events that say nothing against a recording."""

Show = Callable[[Progress, Sequence[Notice]], None]


def record(job: Job, show: Show = lambda _now, _notices: None) -> Summary:
    """Record until the source ends, the time is over, the disk is full or somebody asks for the end.

    Source and instruments are read by threads of their own; this one writes, every 0.1 s, so that a kill
    costs no more than that. What goes wrong beside it becomes an event of the session.

    Parameters
    ----------
    job
        What to record, and where to.
    show
        Called after each writing with how the recording stands and what was just noticed; must return
        quickly.

    Returns
    -------
    Summary
        What was saved. The file is whole and valid, also where `Summary.failure` tells of a disk that filled
        up or a device that went away for good. A first Control-C, SIGTERM or SIGHUP ends the loop and is
        not raised, unless devices are being opened: then it is, at once, and no file is left.

    Raises
    ------
    InputError
        If the file exists, its disk is too full to start, or an option cannot be used; no file is left.
    DeviceError
        If a device is absent at the start; no file is left.
    """
    refuse_place(job.path, job.disk.start)
    with ExitStack() as stack:
        wish = stack.enter_context(interruption())
        stack.enter_context(precedence())
        clock = SessionClock.now()
        with wish.at_once():
            stream = stack.enter_context(job.source.open())
            connections = {name: stack.enter_context(it.open()) for name, it in job.instruments.items()}
        connections = told_apart(connections)
        tally = Tally(stream, connections, job.path.parent, reserve=job.disk.stop)
        # Read from here on, for making a file takes longer than a device's buffer may hold.
        pumps = stack.enter_context(pumping(stream, connections, job.room))
        feeds = tuple(connection.feed for connection in connections.values())
        writer = SessionWriter(job.path, job.about.describe(job.path.stem, stream.signal, feeds), clock)
        watch, flags, ending = Watch(job.disk.warn), Counter[str](), Ending(job)
        kept, clocks_due, over = None, 0.0, False
        with saved(writer, ending), written_through(writer.sync) as disk_errors:
            while not over:
                time.sleep(EVERY)
                over = pumps.ended or ending.overdue  # asked before the inbox is emptied for the last time
                for batch in pumps.inbox.take():
                    if isinstance(batch, Polled):
                        writer.readings(batch.readings)
                    else:
                        writer.audio(batch)
                    tally.add(batch)
                now = tally.look(writer.size, pumps)
                notices = watch.look(now, last=over)
                if now.time >= clocks_due:
                    clocks_due = now.time + CLOCKS_EVERY
                    offsets = {**now.health.clock_offsets, **clock_offsets()}
                    writer.clocks(now.time, offsets)
                    notices += watch.clocks(now.time, offsets)
                notices += ending.look(
                    now, pumps, asked=wish.requested, disk_errors=disk_errors, audio=tally.audio_end
                )
                for notice in notices:
                    writer.event(notice.time, notice.kind, notice.text, **notice.data)
                    flags[notice.kind] += notice.kind not in FINE
                for entry in job.diary(now.time):
                    writer.event(entry.time, entry.kind, entry.text, **entry.data)
                writer.flush()
                kept = now
                show(now, notices)
                if ending.reason:
                    pumps.stop()
        return Summary.of(
            job.path,
            kept or tally.look(writer.size, pumps),
            flags=+flags,
            size=job.path.stat().st_size,
            stopped=ending.reason,
            failure=ending.failure,
        )
