"""A session: sound, estimates, events and notes in one MCAP file."""

import math
import time
from collections.abc import Generator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from monochord.core.dated import dated_path
from monochord.core.types import Audio, Block, Feed, Flags, Readings, Signal
from monochord.core.units import Samples, Seconds
from monochord.live.sinks._record import TRACKED, TRUE, record
from monochord.live.sinks.base import Run, Sink, Update, Writer
from monochord.sessions import ESTIMATES, Description, SessionClock, SessionWriter

WRITE_INTERVAL: Seconds = 0.25
"""Time between writes in s: the most that a kill can lose."""
MIN_LOST: Samples = 32
"""Frames of exact silence at every microphone that count as a gap, in a window that has one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Mcap(Sink):
    """Record a live session with its estimates, readable by ``monochord sessions`` and `mc.read_session`.

    The stream ``estimates`` has a reading for each window, at the time of its last sample: each estimate with
    its ``_std``, NaN where it abstains; the values over time; the truth of a simulated source as
    ``true_NAME``; and ``latency`` in s. Events are the beginnings and ends of contact and slip, health notes
    as they appear and clear, and each change of an abstention's reason. The sound is that of the windows,
    each frame once; frames missing from all windows, because the device lost them or the sink fell behind,
    are a gap. A kill loses a quarter of a second; on a full disk, the file is completed with its current
    content.

    Parameters
    ----------
    path
        A new file, ``NAME.mcap``; empty for ``live_DATE_TIME.mcap`` in the current folder. With several
        strings, each has a file, ``NAME_STRING.mcap``.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sink = Mcap(path=folder + "/take.mcap")
    ...     with sink.open(Run(signal=Signal(sample_rate=44100, channels=2))):
    ...         pass
    """

    path: str = ""

    @property
    def is_for_each_string(self) -> bool:
        """True: each string is recorded into a separate file."""
        return True

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:
        """Create the file; raises `InputError` where it exists or cannot be created."""
        path = Path(self.path) if self.path else dated_path("live", ".mcap")
        path = path.with_stem(f"{path.stem}_{run.string}") if run.string else path
        with closing(_Session(path, run.signal)) as session:
            yield session


class _Session(Writer):
    def __init__(self, path: Path, signal: Signal) -> None:
        self._path, self._signal = path, signal
        self._columns: tuple[str, ...] = ()
        self._known: set[str] = set()  # the columns, and what was reported not to be one
        self._rows: list[tuple[Seconds, int, list[float]]] = []
        self._end: Samples = 0  # of the frames that are written
        self._count = 0
        self._reasons: dict[str, str] = {}
        self._notes: dict[str, str] = {}
        self._due: Seconds = 0.0
        # Refused here where it cannot be made; begun again with the first window, which tells the columns.
        self._writer = SessionWriter(path, self._description((), simulated=False))

    def write(self, update: Update) -> None:
        values = _values(update)
        if not self._columns:
            self._begin(update, values)
        end = self._time(update)
        self._audio(update)
        for name in values.keys() - self._known:
            self._known.add(name)
            self._writer.event(end, "left_out", "a quantity that the first window did not have", column=name)
        self._rows.append(
            (end, self._count + update.skipped, [values.get(name, math.nan) for name in self._columns])
        )
        self._count += 1
        self._events(update, end)
        if time.monotonic() >= self._due:
            self._flush()

    def close(self) -> None:
        """Complete the file."""
        self._put_rows()
        self._writer.close()

    def _description(self, columns: tuple[str, ...], *, simulated: bool) -> Description:
        feed = Feed(stream=ESTIMATES, columns=columns, units=tuple(map(_unit, columns)))
        signal = self._signal
        return Description(
            name=self._path.stem,
            sample_rate=signal.sample_rate,
            channels=signal.channels,
            string=signal.string,
            simulated=simulated,
            feeds=(feed,) if columns else (),
        )

    def _begin(self, update: Update, values: dict[str, float]) -> None:
        """Start the file again, once the columns and the time of the stream's first frame are known."""
        truth = TRUE if update.truth else ()
        self._columns = tuple(dict.fromkeys((*values, *TRACKED, *truth)))
        self._known = set(self._columns)
        duration, start = update.window.duration, update.window.start / self._signal.sample_rate
        at_hand = time.monotonic() if update.at_hand is None else update.at_hand
        first = at_hand - duration if update.adc_time is None else update.adc_time
        clock = SessionClock(
            epoch_ns=time.time_ns() - round((time.monotonic() - first + start) * 1e9), origin=first - start
        )
        self._writer.close()
        self._path.unlink()
        self._writer = SessionWriter(
            self._path, self._description(self._columns, simulated=bool(update.truth)), clock
        )

    def _time(self, update: Update) -> Seconds:
        """Return when the window's last sample was at the converter, on the monotonic clock."""
        window = update.window
        if update.adc_time is not None:
            return update.adc_time + window.duration
        return self._writer.clock.origin + window.start / window.sample_rate + window.duration

    def _audio(self, update: Update) -> None:
        """Write the frames that no earlier window had."""
        window = update.window
        begin = max(self._end, window.start)
        fresh = window.samples[:, begin - window.start :]
        for first, last in _kept(fresh) if window.has_gap else ((0, fresh.shape[1]),):
            start = begin + first
            adc_time = update.adc_time
            if adc_time is not None:
                adc_time += (start - window.start) / window.sample_rate
            samples = np.ascontiguousarray(fresh[:, first:last])
            block = Block(samples=samples, start=start, dropped=start - self._end, adc_time=adc_time)
            self._writer.audio(block)
            self._end = begin + last

    def _events(self, update: Update, end: Seconds) -> None:
        ahead = end - update.prediction.time - update.window.duration
        for event in update.events:
            more = {"delay": event.delay, "confidence": event.confidence}
            self._writer.event(ahead + event.time, event.kind, "", **_finite(more))
        for name, estimate in update.prediction.estimates.items():
            if self._reasons.get(name, "") != estimate.reason:
                self._reasons[name] = estimate.reason
                self._writer.event(end, "abstention", estimate.reason, estimate=name)
        notes = {note.key: note for note in update.notes}
        for key in self._notes.keys() - notes.keys():
            self._writer.event(end, "note_ends", self._notes.pop(key), key=key)
        for key in notes.keys() - self._notes.keys():
            note = notes[key]
            self._notes[key] = note.sentence
            self._writer.event(end, "note", note.sentence, key=key, level=note.level, remedy=note.remedy)

    def _flush(self) -> None:
        self._due = time.monotonic() + WRITE_INTERVAL
        self._put_rows()
        self._writer.flush()

    def _put_rows(self) -> None:
        if not self._rows:
            return
        rows, self._rows = self._rows, []
        time_, sequence, values = zip(*rows, strict=True)
        self._writer.readings(
            Readings(
                stream=ESTIMATES,
                time=np.array(time_, np.float64),
                values=np.array(values, np.float64),
                sequence=np.array(sequence, np.int64),
                device_time=np.full(len(rows), -1, np.int64),
                status=np.zeros(len(rows), np.uint32),
            )
        )


def _values(update: Update) -> dict[str, float]:
    """Return all numbers of an update by name, NaN where unknown."""
    skipped = ("string", "time", "valid", "why_not", "dropped", "gaps", "xruns", "skipped", "events", "notes")
    return {
        name: math.nan if value is None else float(value)
        for name, value in record(update, everything=True).items()
        if name not in skipped
    }


def _unit(column: str) -> str:
    name = column.removesuffix("_std").rpartition("_")[2]
    return {"position": "m", "force": "N", "frequency": "Hz", "tension": "N", "latency": "s"}.get(name, "1")


def _finite(values: dict[str, float]) -> dict[str, float]:
    return {name: float(value) for name, value in values.items() if math.isfinite(value)}


def _kept(samples: Audio) -> list[tuple[int, int]]:
    """Return the runs of frames, first and one after the last, between the lost ones.

    In a window with a gap, lost frames are zeros at every microphone, in long runs or at the window's edge.

    >>> _kept(np.array([[0, 0, 3, 0, 5, 0]], np.float32))
    [(2, 5)]
    """
    silent: Flags = (samples == 0.0).all(axis=0)
    edges = [0, *(np.flatnonzero(np.diff(silent)) + 1).tolist(), silent.size]
    lost = [
        (first, last)
        for first, last in pairwise(edges)
        if last > first and silent[first] and (last - first >= MIN_LOST or first == 0 or last == silent.size)
    ]
    bounds = [0, *(bound for span in lost for bound in span), silent.size]
    return [(first, last) for first, last in zip(bounds[::2], bounds[1::2], strict=True) if last > first]
