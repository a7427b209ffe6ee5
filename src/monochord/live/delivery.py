"""Delivers updates to sinks, so that no sink delays the live loop or another sink."""

import logging
import queue
import sys
import threading
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Self

from monochord.core.errors import DeviceError, MonochordError
from monochord.core.printable import printable
from monochord.core.units import Seconds
from monochord.live.health import Note
from monochord.live.sinks.base import Listener, NotDeliveredError, Run, Sink, Update

__all__ = ["Delivered", "Delivery"]

CLOSING: Seconds = 5.0
"""Time for all sinks together to write their backlog at the end of a run, in s."""
SWITCH_INTERVAL: Seconds = 5e-4
"""Longest time a sink's thread keeps the interpreter while the loop has a window to estimate, in s.

Python's default of 5 ms is half a hop.
"""

ALL = ""
"""Stands for a string's name where a sink takes the updates of all strings."""

_log = logging.getLogger("monochord")


@dataclass(frozen=True, slots=True, kw_only=True)
class Delivered:
    """How many windows of a run one sink wrote and missed.

    `written` counts the windows that the sink wrote. `left_out` counts the others: the sink was slow, could
    not deliver them, or had failed. `failure` is why the sink closed early, empty for a normal end.
    """

    sink: str
    written: int
    left_out: int
    failure: str = ""

    def line(self) -> str:
        """Return the counts as text.

        >>> Delivered(sink="udp", written=90, left_out=10).line()
        'udp 90 written, 10 left out'
        """
        counts = f"{self.sink} {self.written} written, {self.left_out} left out"
        return f"{counts}; closed: {self.failure}" if self.failure else counts


class Delivery:
    """The open sinks of a run; leaving the context writes what waits and closes them.

    Where a clock paces the source, each sink has a thread behind a queue of its `backlog`; a full queue drops
    and counts its oldest window. Where the reader sets the pace, as with a file read at full speed, the loop
    calls the sinks and waits for them: nothing is dropped.

    A sink that raises is reported in one line and closed, and the others continue. The run ends with that
    error where no other sink is left, or where the reader of standard output went away. A `Listener` belongs
    to the program that runs the loop: it is always called in the loop, and its exceptions propagate.

    Sinks are opened in order. With several strings, a sink with one instance per string
    (`Sink.is_for_each_string`) takes the updates of its string; other sinks take all.

    Examples
    --------
    >>> from monochord.core.types import Signal
    >>> from monochord.live.sinks import SINKS
    >>> run = Run(signal=Signal(sample_rate=44100, channels=2))
    >>> with Delivery([SINKS.build("udp")], run, paced=True) as delivery:
    ...     pass
    >>> delivery.delivered
    (Delivered(sink='udp', written=0, left_out=0, failure=''),)
    """

    def __init__(self, sinks: Iterable[Sink], run: Run, *, paced: bool) -> None:
        self._sinks, self._run, self._paced = tuple(sinks), run, paced
        self._open_sinks: list[_OpenSink] = []
        self._dispatcher: _Dispatcher | None = None
        self._usual_interval = sys.getswitchinterval()

    def __enter__(self) -> Self:
        try:
            for sink in self._sinks:
                self._open(sink)
        except BaseException:
            self._close()
            raise
        queued = [sink for sink in self._open_sinks if isinstance(sink, _SinkQueue)]
        if queued:
            self._dispatcher = _Dispatcher(queued)
            sys.setswitchinterval(min(SWITCH_INTERVAL, self._usual_interval))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()
        if error is None:
            self._raise_where_none_is_left()

    def hand_over(self, update: Update) -> None:
        """Pass an update to every sink, with a note on each closed sink; raises where no sink is left."""
        closed = [sink for sink in self._open_sinks if sink.error is not None]
        if closed:
            notes = [sink.note(update.prediction.time) for sink in closed]
            update = replace(update, notes=(*update.notes, *notes))
        if self._dispatcher is not None:
            self._dispatcher.updates.put(update)
        for sink in self._open_sinks:
            if sink.string in (ALL, update.string):
                sink.take(update)
            if sink.error is not None:
                self._raise_where_none_is_left()

    @property
    def delivered(self) -> tuple[Delivered, ...]:
        """The counts of each sink, listeners excepted."""
        return tuple(sink.delivered() for sink in self._open_sinks if not isinstance(sink, _CalledListener))

    def _open(self, sink: Sink) -> None:
        kind = _CalledListener if isinstance(sink, Listener) else _SinkQueue if self._paced else _SinkInLoop
        taken = any(each.fills_standard_output for each in self._sinks) and not sink.fills_standard_output
        run = replace(self._run, is_output_taken=taken)
        if sink.is_for_each_string and run.strings:
            runs = [replace(run, signal=each, string=name, strings={}) for name, each in run.strings.items()]
        else:
            runs = [run]
        self._open_sinks += [kind(sink, each) for each in runs]

    def _close(self) -> None:
        deadline = time.monotonic() + CLOSING
        if self._dispatcher is not None:
            self._dispatcher.close()
        for sink in self._open_sinks:
            sink.end()
        for sink in self._open_sinks:
            sink.close(deadline)
        sys.setswitchinterval(self._usual_interval)  # last: a sink may have had a delivery of its own

    def _raise_where_none_is_left(self) -> None:
        sinks = [sink for sink in self._open_sinks if not isinstance(sink, _CalledListener)]
        failed = [sink for sink in sinks if sink.error is not None]
        gone = [each for each in failed if each.ends_the_run]
        if gone or (failed and len(failed) == len(sinks)):
            error = (gone or failed)[0].error
            assert error is not None
            raise error


class _OpenSink:
    """An open sink, for one string by name or for all strings."""

    def __init__(self, sink: Sink, run: Run) -> None:
        kind = type(sink).__module__.rpartition(".")[2]
        self.name, self.string = f"{kind} {run.string}" if run.string else kind, run.string or ALL
        self.error: Exception | None = None
        self._ends_with_standard_output = sink.ends_with_standard_output(run)
        self._given = self._written = 0
        self._closed_at: Seconds | None = None
        self._context = sink.open(run)
        self._writer = self._context.__enter__()

    @property
    def ends_the_run(self) -> bool:
        """Whether the reader of standard output went away, as `head` does."""
        return self._ends_with_standard_output and isinstance(self.error, BrokenPipeError)

    def take(self, update: Update) -> None:
        """Accept an update in the loop."""

    def end(self) -> None:
        """Accept no more updates."""

    def close(self, deadline: Seconds) -> None:  # noqa: ARG002
        """Write the backlog and close the sink before a monotonic deadline."""
        if self.error is None:
            self._leave()

    def note(self, now: Seconds) -> Note:
        """Return the note on a closed sink, dated from the first window after it closed."""
        self._closed_at = now if self._closed_at is None else self._closed_at
        return Note(
            key=f"{self.name}_closed".replace(" ", "_"),
            level="error",
            sentence=f"Output {self.name} is closed: {self.failure}.",
            remedy="The other outputs continue. Remove the cause, then start again.",
            since=self._closed_at,
        )

    @property
    def failure(self) -> str:
        """Why the sink closed early; empty where it did not."""
        return "" if self.error is None else reason(self.error)

    def delivered(self) -> Delivered:
        """Return the sink's counts."""
        left_out = self._given - self._written
        return Delivered(sink=self.name, written=self._written, left_out=left_out, failure=self.failure)

    def _write(self, update: Update) -> None:
        """Write an update; a sink that raises is closed."""
        try:
            self._writer.write(update)
        except NotDeliveredError:
            pass
        except Exception as error:  # noqa: BLE001  (whatever a sink of others may raise)
            self._fail(error)
            self._leave()
        else:
            self._written += 1

    def _leave(self) -> None:
        try:
            self._context.__exit__(None, None, None)
        except Exception as error:  # noqa: BLE001
            if self.error is None:  # else it says the same again, as of a full disk
                self._fail(error)

    def _fail(self, error: Exception) -> None:
        self.error = error
        if not self.ends_the_run:
            _log.warning("sink %s is closed: %s", self.name, reason(error))


class _CalledListener(_OpenSink):
    """A listener: called in the loop; its exceptions propagate."""

    def take(self, update: Update) -> None:
        self._writer.write(update)

    def close(self, deadline: Seconds) -> None:  # noqa: ARG002
        self._context.__exit__(None, None, None)


class _SinkInLoop(_OpenSink):
    """A sink called in the loop, which waits for it."""

    def take(self, update: Update) -> None:
        self._given += 1
        if self.error is None:
            self._write(update)


class _SinkQueue(_OpenSink):
    """A sink with a thread behind a queue."""

    def __init__(self, sink: Sink, run: Run) -> None:
        super().__init__(sink, run)
        self._backlog = sink.backlog * max(len(run.strings), 1)
        self._waiting: queue.SimpleQueue[Update | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._run, name=f"sink-{self.name}", daemon=True)
        self._thread.start()

    def put(self, update: Update) -> None:
        """Accept an update from the dispatcher; a full queue drops its oldest."""
        self._given += 1
        if self.error is not None:
            return
        waiting = self._waiting
        if waiting.qsize() >= self._backlog:
            with suppress(queue.Empty):  # the sink may take it at this moment
                waiting.get_nowait()
        waiting.put(update)

    def end(self) -> None:
        self._waiting.put(None)

    def close(self, deadline: Seconds) -> None:
        self._thread.join(max(deadline - time.monotonic(), 0.0))
        if self._thread.is_alive() and self.error is None:
            self._fail(DeviceError(f"output that is not taken within {CLOSING:g} s"))

    def _run(self) -> None:
        while (update := self._waiting.get()) is not None:
            self._write(update)
            if self.error is not None:
                return  # and is closed
        self._leave()


class _Dispatcher:
    """Passes updates from the loop to the sinks' queues, in a separate thread.

    Waking a thread costs some 10 us, which the loop spends once, whatever the number of sinks.
    """

    def __init__(self, open_sinks: list[_SinkQueue]) -> None:
        self.updates: queue.SimpleQueue[Update | None] = queue.SimpleQueue()
        self._open_sinks = open_sinks
        self._thread = threading.Thread(target=self._run, name="delivery", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Wait until every update is in the queues, which is quick."""
        self.updates.put(None)
        self._thread.join()

    def _run(self) -> None:
        while (update := self.updates.get()) is not None:
            for sink in self._open_sinks:
                if sink.string in (ALL, update.string):
                    sink.put(update)


def reason(error: Exception) -> str:
    """Return an error as one plain line.

    >>> reason(OSError(28, "No space left on device")), reason(ZeroDivisionError("by zero"))
    ('No space left on device', 'ZeroDivisionError: by zero')
    """
    if isinstance(error, OSError) and error.strerror:
        text = f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    elif isinstance(error, (MonochordError, OSError)):
        text = str(error)
    else:
        text = f"{type(error).__name__}: {error}"
    return printable(" ".join(text.split()))
