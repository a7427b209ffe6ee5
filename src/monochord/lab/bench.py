"""The virtual bench offline: a session of a plan rendered and written, as fast as the machine allows.

The file has the form that a recording in real time has: blocks with the converter's time, batches of readings
with their arrival, counts and gaps, clock offsets once a second. Its clock begins at zero, at the moment that
the plan gives, so that nothing in it depends on when, where or by whom it was made.
"""

import hashlib
import json
import os
import uuid
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from monochord.core.config import dump_toml, to_tree
from monochord.core.errors import InputError
from monochord.core.types import POSE, WRENCH, Block, Feed, Floats, Readings
from monochord.core.units import Samples, Seconds
from monochord.lab.arrivals import Line, arrive
from monochord.lab.plan import Assignment
from monochord.lab.render import pieces
from monochord.lab.rendering import Rendering
from monochord.lab.tally import Tally, tally
from monochord.sessions import Description, SessionClock, SessionWriter, read_session

BATCH: Seconds = 0.01
"""Readings that a machine takes from its socket at once."""
BLOCK: Seconds = 0.1
"""Audio that is handed over at once, and the step in which the streams are interleaved."""
ADC_JITTER: Seconds = 2e-5
"""Of the converter's time of a block, rms: what a sound server shows."""
POSE_JITTER: Seconds = 3e-4
"""Mean of what a pose is late over its delay."""
NANO = 1_000_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of one session: its file, `seconds` of audio, windows by kind, bytes, and SHA-256.

    `kept` says that the whole file was there already and was left as it is.
    """

    name: str
    path: Path
    seconds: Seconds
    tally: Tally
    size: int
    checksum: str
    kept: bool = False


def make(session: Assignment, folder: Path) -> Outcome:
    """Make the session's file in a folder, unless it is there already.

    It is written under another name first and then renamed: what was cut off leaves nothing that counts. A
    file of another plan that has come meanwhile, as from a worker whose collection ended, is not replaced.

    Parameters
    ----------
    session
        What to make.
    folder
        Where; it must exist.

    Returns
    -------
    Outcome
        With the file NAME.mcap.

    Raises
    ------
    InputError
        If there is a file of that name that holds something else.
    """
    path, told = folder / f"{session.name}.mcap", describe(session)
    if there := made_before(path, told):
        return there
    part = folder / f"{path.name}.part-{os.getpid()}-{uuid.uuid4().hex[:8]}"
    try:
        clock = SessionClock(epoch_ns=round(session.epoch) * NANO, origin=0.0)
        with SessionWriter(part, told, clock) as writer:
            desk = _Desk(session, writer)
            for piece in pieces(session):
                desk.write(piece)
        if there := made_before(path, told):
            return there
        with suppress(FileNotFoundError):  # another made the same meanwhile, and tidied this away
            part.replace(path)
    finally:
        part.unlink(missing_ok=True)
    for left in folder.glob(f"{path.name}.part-*"):
        with suppress(OSError):
            left.unlink()
    return outcome(path)


def delays(session: Assignment) -> dict[str, Seconds]:
    """Return by how much each stream of a session comes late, in s: drawn within the plan's ranges.

    Examples
    --------
    >>> from monochord.lab.plan import Group, Plan, assignments
    >>> delays(assignments(Plan(name="p", groups=(Group(name="a"),)))[0])
    {'audio': 0.0, 'wrench': 0.0, 'pose': 0.0}
    """
    ranges = session.plan.delays
    random = session.random("delays")
    return {name: float(random.uniform(*getattr(ranges, name))) for name in ("audio", "wrench", "pose")}


def describe(session: Assignment) -> Description:
    """Return what a session's file says of itself, the delays that it was given included."""
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
    }
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
        build=plan.build,
        seed=session.seed,
        plan=dump_toml(to_tree(plan)),
        feeds=(wrench, pose),
        more=more,
    )


class _Desk:
    """Where the streams of a session meet its file, each as late as it comes."""

    def __init__(self, session: Assignment, writer: SessionWriter) -> None:
        plan, late = session.plan, delays(session)
        sensor = plan.force_sensor
        self._writer, self._late, self._epoch = writer, late, session.epoch
        self._random = {name: session.random(f"{name} arrivals") for name in ("audio", "wrench", "pose")}
        self._lines = {
            "wrench": Line(delay=late["wrench"], jitter=sensor.jitter, lost=sensor.lost),
            "pose": Line(delay=late["pose"], jitter=POSE_JITTER),
        }
        self._latest = {"wrench": -np.inf, "pose": -np.inf}
        self._frame_time: Samples = int(self._random["audio"].integers(2**32))
        self._second = 0

    def write(self, piece: Rendering) -> None:
        """Write a stretch of the session, a tenth of a second at a time."""
        wrench = self._readings(piece, "wrench", piece.wrench_time, piece.wrench)
        pose = self._readings(piece, "pose", piece.pose_time, piece.pose)
        told = piece.label_time
        size, count = round(BLOCK * piece.sample_rate), piece.microphones.shape[1]
        for first in range(0, count, size):
            last = first + size
            begin = piece.begin + first / piece.sample_rate
            until = np.inf if last >= count else piece.begin + last / piece.sample_rate
            self._clocks(begin)
            self._audio(piece, first, last)
            self._batches(wrench, begin, until)
            self._batches(pose, begin, until)
            own = (told >= begin) & (told < until)
            labels = {name: values[own] for name, values in piece.labels.items()}
            self._writer.labels(told[own] + self._late["wrench"], labels)
            for event in piece.events:
                if begin <= event.time < until:
                    self._writer.event(
                        event.time + self._late["wrench"], event.kind, event.text, **event.data
                    )

    def _clocks(self, time: Seconds) -> None:
        if time >= self._second:
            self._writer.clocks(time, {"realtime": float(self._epoch), "monotonic_raw": 0.0})
            self._second += 1

    def _audio(self, piece: Rendering, first: Samples, last: Samples) -> None:
        start = piece.start + first
        wobble = ADC_JITTER * float(self._random["audio"].normal())
        block = Block(
            samples=piece.microphones[:, first:last],
            start=start,
            adc_time=start / piece.sample_rate + self._late["audio"] + wobble,
            frame_time=(self._frame_time + start) % 2**32,
        )
        self._writer.audio(block)

    def _readings(
        self, piece: Rendering, stream: str, taken: Floats, values: Floats
    ) -> tuple[Floats, Readings]:
        """Return when readings of a stretch were taken, and what comes of them."""
        index, arrival = arrive(taken, self._lines[stream], self._random[stream], self._latest[stream])
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
        first, last = np.searchsorted(taken, (begin, until))
        for start in np.unique(np.floor(taken[first:last] / BATCH + 1e-6)):
            a, b = np.clip(np.searchsorted(taken / BATCH + 1e-6, (start, start + 1)), first, last)
            part = slice(int(a), int(b))
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


def made_before(path: Path, told: Description) -> Outcome | None:
    """Return what there is of a session that says `told` of itself, None where there is nothing.

    Raises `InputError` where the file holds something else; which feeds it had does not count.
    """
    if not path.exists():
        return None
    there = read_session(path)
    if not there.complete or replace(there.description, feeds=()) != replace(told, feeds=()):
        raise InputError(
            f"file {path} (not this session of this plan, or of other versions)",
            "a folder of this plan alone",
            "collect into another folder, or delete the file",
        )
    return outcome(path, kept=True)


def outcome(path: Path, *, kept: bool = False) -> Outcome:
    """Return what a whole session of a plan holds; raises `InputError` where its end is missing."""
    there = read_session(path)
    switched = {event.text: event.time for event in there.events if event.kind == "drivers"}
    if set(switched) != {"on", "off"}:
        raise InputError(f"session {path} (ends too early)", "a whole one", "delete it, and collect it again")
    found = tally(there.labels.time, there.labels.columns, switched["on"], switched["off"])
    with path.open("rb") as file:
        checksum = hashlib.file_digest(file, "sha256").hexdigest()
    return Outcome(
        name=there.description.name,
        path=path,
        seconds=int(there.ending["frames"]) / there.description.sample_rate,
        tally=found,
        size=path.stat().st_size,
        checksum=checksum,
        kept=kept,
    )
