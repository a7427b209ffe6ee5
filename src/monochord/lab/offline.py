"""Simulates a session of a plan and writes it as fast as the machine allows.

The file has the form of a real-time recording: blocks with the converter's time, batches of readings with
arrival times, counts and gaps, clock offsets once a second. Its clock begins at zero, at the time stated in
the plan, so that nothing depends on the time, place or user.
"""

import hashlib
import json
import os
import uuid
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from monochord.core.config import dump_toml, to_tree
from monochord.core.errors import InputError
from monochord.core.files import written
from monochord.core.types import POSE, WRENCH, Block, Feed, Floats, Readings
from monochord.core.units import Samples, Seconds
from monochord.lab.assignment import Assignment
from monochord.lab.render import Rendering, pieces
from monochord.physics.sensors import sensor_tuning
from monochord.sessions import TUNING, Description, SessionClock, SessionWriter, read_session

BATCH: Seconds = 0.01
"""Duration of the readings that a computer reads from its socket at once, in s."""
BLOCK: Seconds = 0.1
"""Duration of an audio block, and the step at which the streams are interleaved, in s."""
ADC_JITTER: Seconds = 2e-5
"""Jitter of a block's converter time, rms, as sound servers show it, in s."""
POSE_JITTER: Seconds = 3e-4
"""Mean jitter of a pose, in addition to its delay, in s."""
NANO = 1_000_000_000
WINDOW: Seconds = 0.1
FORCE_TOLERANCE = 0.1
"""Largest force deviation in a static window, relative to its mean."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowCounts:
    """Number of non-overlapping windows by kind, while both drivers were on.

    `static`: in contact throughout, not sliding, with the force constant to a tenth. `settled`: static with
    settled sound throughout. `slip`: in contact and sliding throughout. `clear`: no contact. `transition`:
    partly in contact. `other`: the rest, such as pressing or turning.
    """

    static: int = 0
    settled: int = 0
    slip: int = 0
    clear: int = 0
    transition: int = 0
    other: int = 0

    def __add__(self, more: "WindowCounts") -> "WindowCounts":
        return WindowCounts(**{f.name: getattr(self, f.name) + getattr(more, f.name) for f in fields(self)})


def count_windows(time: Floats, labels: Mapping[str, Floats], on: Seconds, off: Seconds) -> WindowCounts:
    """Count the windows of `WINDOW` s of a session, edge to edge, from its labels.

    `on` and `off` are when the drivers are switched, in s; windows begin at `on`. `time` (n,) in s is evenly
    spaced; `labels` holds contact, force, slip and settled, (n,) each. Raises `InputError` where their
    spacing exceeds half a window.

    >>> time = np.arange(1000) * 1e-3
    >>> touched = (time > 0.449).astype(float)
    >>> labels = {"contact": touched, "force": touched, "slip": 0.0 * time, "settled": touched}
    >>> count_windows(time, labels, 0.0, 1.0)
    WindowCounts(static=5, settled=5, slip=0, clear=4, transition=1, other=0)
    """
    each = round(WINDOW / (time[1] - time[0])) if len(time) > 1 and time[1] > time[0] else 0
    if each < 2:
        raise InputError(f"labels of {len(time)} times", f"two or more in {WINDOW:g} s")
    inside = (time >= on) & (time < off)
    count = int(inside.sum()) // each
    contact, force, slip, settled = (
        np.nan_to_num(labels[name][inside][: count * each]).reshape(count, each)
        for name in ("contact", "force", "slip", "settled")
    )
    all_contact, no_contact = contact.all(axis=1), ~contact.any(axis=1)
    deviation = np.abs(force - force.mean(axis=1, keepdims=True)).max(axis=1)
    static = all_contact & ~slip.any(axis=1) & (deviation <= FORCE_TOLERANCE * force.mean(axis=1))
    sliding = all_contact & slip.all(axis=1)
    return WindowCounts(
        static=int(static.sum()),
        settled=int((static & settled.all(axis=1)).sum()),
        slip=int(sliding.sum()),
        clear=int(no_contact.sum()),
        transition=int((~all_contact & ~no_contact).sum()),
        other=int((all_contact & ~static & ~sliding).sum()),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class CollectedSession:
    """The result for one session: its file, seconds of audio, windows by kind, bytes, and SHA-256.

    `kept` is true where a complete file already existed and was kept.
    """

    name: str
    path: Path
    seconds: Seconds
    windows: WindowCounts
    size: int
    checksum: str
    kept: bool = False


def make(session: Assignment, folder: Path) -> CollectedSession:
    """Simulate a session into a file in a folder, unless the file already exists.

    It is written under another name first and then renamed, so that an interrupted run leaves no session. A
    file of another plan that appears meanwhile, as from a worker whose collection ended, is not replaced.

    Parameters
    ----------
    session
        The session to simulate.
    folder
        The output folder, which must exist.

    Returns
    -------
    CollectedSession
        The result, with the file NAME.mcap.

    Raises
    ------
    InputError
        If a file of that name contains something else.
    """
    path, description = folder / f"{session.name}.mcap", describe(session)
    if result := existing(path, description):
        return result
    part = folder / f"{path.name}.part-{os.getpid()}-{uuid.uuid4().hex[:8]}"
    try:
        clock = SessionClock(epoch_ns=round(session.epoch) * NANO, origin=0.0)
        with written(path), SessionWriter(part, description, clock) as writer:
            streams = _SimulatedStreams(session, writer)
            for piece in pieces(session):
                streams.write(piece)
        if result := existing(path, description):
            return result
        with suppress(FileNotFoundError):  # another process made the same meanwhile, and removed this one
            part.replace(path)
    finally:
        part.unlink(missing_ok=True)
    for left in folder.glob(f"{path.name}.part-*"):
        with suppress(OSError):
            left.unlink()
    return summarise(path)


def delays(session: Assignment) -> dict[str, Seconds]:
    """Return the delay of each stream of a session in s, drawn within the plan's ranges.

    >>> from monochord.lab import Group, Plan, assignments
    >>> delays(assignments(Plan(name="p", groups=(Group(name="a"),)))[0])
    {'audio': 0.0, 'wrench': 0.0, 'pose': 0.0}
    """
    ranges = session.plan.delays
    random = session.random("delays")
    return {name: float(random.uniform(*getattr(ranges, name))) for name in ("audio", "wrench", "pose")}


def describe(session: Assignment) -> Description:
    """Return the description of a session's file, with the true delays.

    In the plausible world, `more` has the class of the object's `mount`, and the string's `length`: measured
    with a ruler, and true, in m. Where the string is tuned otherwise, it has the `tuning`.
    """
    plan, group, design = session.plan, session.group, session.design()
    units, rate = ("N",) * 3 + ("N m",) * 3, plan.force_rate
    wrench = Feed(stream="wrench", columns=WRENCH, units=units, rate=rate, ticks=rate)
    units = ("m",) * 3 + ("",) * 4
    pose = Feed(stream="pose", columns=POSE, units=units, rate=plan.pose_rate, ticks=float(NANO))
    more = {
        "plan": plan.name,
        "group": group.name,
        "protocol": session.origin.group.protocol,
        "index": str(session.index),
        "delays": json.dumps(delays(session), sort_keys=True),
        "lifted": repr(group.lifted),
        "music": group.music,
        "motors": group.motors,
        "world": session.world,
        "second": repr(group.second),
    }
    built = session.sensor()
    if built.measured_length is not None:
        lengths = {"measured": built.measured_length, "true": built.string.length}
        more["length"] = json.dumps(lengths, sort_keys=True)
    if session.mount:
        more["mount"] = session.mount
    if session.deviation.tuning is not None:
        more["tuning"] = repr(session.deviation.tuning)
    tuning = sensor_tuning(plan.sensor)
    if tuning:
        more[TUNING] = json.dumps(to_tree(tuning), sort_keys=True)
    return Description(
        name=session.name,
        sample_rate=plan.sample_rate,
        simulated=True,
        sensor=to_tree(design),
        string=design.string,
        object=f"{group.material}, radius {1e3 * session.radius:g} mm",
        material=group.material,
        radius=session.radius,
        day=session.day,
        build=session.build,
        seed=session.seed,
        plan=dump_toml(to_tree(plan)),
        feeds=(wrench, pose),
        more=more,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Transport:
    """The connection to an instrument: a reading arrives after `delay` plus jitter of mean `jitter`, in s.

    A share `lost` of the readings never arrives. The jitter is exponential: never negative, and occasionally
    long.
    """

    delay: Seconds = 0.0
    jitter: Seconds = 0.0
    lost: float = 0.0


def arrive(
    taken: Floats, transport: Transport, random: np.random.Generator, latest: Seconds = -np.inf
) -> tuple[NDArray[np.intp], Floats]:
    """Return the indices (m,) of the readings that arrive, and when they do, (m,) in s, never falling.

    `taken` (n,) in s rises. Two numbers are drawn for each reading. `latest` is when the reading before
    arrived: readings keep their order.

    >>> index, arrival = arrive(np.array([0.0, 0.1]), Transport(delay=0.02), np.random.default_rng(0))
    >>> index.tolist(), arrival.round(3).tolist()
    ([0, 1], [0.02, 0.12])
    """
    jitter, chance = random.exponential(size=len(taken)), random.uniform(size=len(taken))
    index = np.flatnonzero(chance >= transport.lost)
    arrival = np.maximum.accumulate(
        np.maximum(latest, (taken + transport.delay + transport.jitter * jitter)[index])
    )
    return index, arrival


class _SimulatedStreams:
    """Writes the streams of a session to its file, each with its delay."""

    def __init__(self, session: Assignment, writer: SessionWriter) -> None:
        plan, delay = session.plan, delays(session)
        sensor = plan.force_sensor
        self._writer, self._delays, self._epoch = writer, delay, session.epoch
        self._random = {name: session.random(f"{name} arrivals") for name in ("audio", "wrench", "pose")}
        self._transports = {
            "wrench": Transport(delay=delay["wrench"], jitter=sensor.jitter, lost=sensor.lost),
            "pose": Transport(delay=delay["pose"], jitter=POSE_JITTER),
        }
        self._latest = {"wrench": -np.inf, "pose": -np.inf}
        self._frame_time: Samples = int(self._random["audio"].integers(2**32))
        self._second = 0

    def write(self, piece: Rendering) -> None:
        """Write a chunk of the session, a tenth of a second at a time."""
        wrench = self._readings(piece, "wrench", piece.wrench_time, piece.wrench)
        pose = self._readings(piece, "pose", piece.pose_time, piece.pose)
        label_time = piece.label_time
        size, count = round(BLOCK * piece.sample_rate), piece.microphones.shape[1]
        for first in range(0, count, size):
            last = first + size
            begin = piece.begin + first / piece.sample_rate
            until = np.inf if last >= count else piece.begin + last / piece.sample_rate
            self._clocks(begin)
            self._audio(piece, first, last)
            self._batches(wrench, begin, until)
            self._batches(pose, begin, until)
            within = (label_time >= begin) & (label_time < until)
            labels = {name: values[within] for name, values in piece.labels.items()}
            self._writer.labels(label_time[within] + self._delays["wrench"], labels)
            for event in piece.events:
                if begin <= event.time < until:
                    self._writer.event(
                        event.time + self._delays["wrench"], event.kind, event.text, **event.data
                    )

    def _clocks(self, time: Seconds) -> None:
        if time >= self._second:
            self._writer.clocks(time, {"realtime": float(self._epoch), "monotonic_raw": 0.0})
            self._second += 1

    def _audio(self, piece: Rendering, first: Samples, last: Samples) -> None:
        start = piece.start + first
        jitter = ADC_JITTER * float(self._random["audio"].normal())
        block = Block(
            samples=piece.microphones[:, first:last],
            start=start,
            adc_time=start / piece.sample_rate + self._delays["audio"] + jitter,
            frame_time=(self._frame_time + start) % 2**32,
        )
        self._writer.audio(block)

    def _readings(
        self, piece: Rendering, stream: str, taken: Floats, values: Floats
    ) -> tuple[Floats, Readings]:
        """Return the times at which a chunk's readings were taken, and the readings that arrive."""
        index, arrival = arrive(taken, self._transports[stream], self._random[stream], self._latest[stream])
        self._latest[stream] = float(arrival[-1]) if len(arrival) else self._latest[stream]
        rate = piece.force_rate if stream == "wrench" else piece.pose_rate
        count = piece.index(rate, len(taken))[index]
        clock = count if stream == "wrench" else np.rint((self._epoch + taken[index]) * NANO).astype(np.int64)
        return taken[index], Readings(
            stream=stream,
            time=arrival,
            values=values[index],
            sequence=count,
            device_time=clock,
            status=np.zeros(len(index), dtype=np.uint32),
        )

    def _batches(self, readings: tuple[Floats, Readings], begin: Seconds, until: Seconds) -> None:
        taken, whole = readings
        first, last = np.searchsorted(taken, (begin, until)).tolist()
        reads = np.floor(taken[first:last] / BATCH + 1e-6)
        begins = [first, *(first + 1 + np.flatnonzero(np.diff(reads))).tolist()] if last > first else []
        for a, b in pairwise([*begins, last]):
            part = slice(a, b)
            self._writer.readings(
                Readings(
                    stream=whole.stream,
                    time=whole.time[part],
                    values=whole.values[part],
                    sequence=whole.sequence[part],
                    device_time=whole.device_time[part],
                    status=whole.status[part],
                )
            )


def existing(path: Path, description: Description) -> CollectedSession | None:
    """Return the existing session at a path if it has this description, None where there is no file.

    Raises `InputError` where the file has another description; the feeds are not compared.
    """
    if not path.exists():
        return None
    session = read_session(path)
    if not session.complete or replace(session.description, feeds=()) != replace(description, feeds=()):
        raise InputError(
            f"file {path} (another session, plan or version)",
            "a folder with sessions of this plan only",
            "collect into another folder, or delete the file",
        )
    return summarise(path, kept=True)


def summarise(path: Path, *, kept: bool = False) -> CollectedSession:
    """Return the result of a complete session of a plan; raises `InputError` where its end is missing."""
    session = read_session(path)
    switched = {event.text: event.time for event in session.events if event.kind == "drivers"}
    if set(switched) != {"on", "off"}:
        raise InputError(
            f"session {path} (incomplete)", "a complete session", "delete it, and collect it again"
        )
    counts = count_windows(session.labels.time, session.labels.columns, switched["on"], switched["off"])
    with path.open("rb") as file:
        checksum = hashlib.file_digest(file, "sha256").hexdigest()
    return CollectedSession(
        name=session.description.name,
        path=path,
        seconds=int(session.ending["frames"]) / session.description.sample_rate,
        windows=counts,
        size=path.stat().st_size,
        checksum=checksum,
        kept=kept,
    )
