"""The virtual bench in real time: every part a process of its own, met through its real port or protocol.

The twin's sound comes out of a JACK client, wrenches come over UDP from a simulated Net F/T, poses over DDS
from a simulated robot; the recorder records them as it would record hardware. Only the labels, which no
instrument knows, are handed to it.
"""

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from monochord.capture.instruments import INSTRUMENTS
from monochord.capture.instruments.base import Connection, Instrument
from monochord.capture.recording import Job, Notice, Progress, Summary, record
from monochord.capture.sources import SOURCES
from monochord.core.errors import DeviceError
from monochord.core.ownership import scratch_folder
from monochord.core.types import Feed, Floats, InstrumentHealth, Readings, Signal
from monochord.core.units import Seconds
from monochord.lab._script import write_script
from monochord.lab.bench import Outcome, delays, describe, made_before, outcome
from monochord.lab.net_ft_device import NetFtSettings
from monochord.lab.plan import Assignment
from monochord.lab.player import PlayerSettings
from monochord.lab.pose_publisher import PublisherSettings
from monochord.lab.render import render
from monochord.lab.rendering import Rendering
from monochord.sessions import Description

LEAD: Seconds = 1.0
"""From the word to begin to the begin: the player sets its first frame 0.2 s before."""
TAIL: Seconds = 1.0
"""How long is recorded after the last reading was due."""
START: Seconds = 30.0
"""How long a process may take to say that it is there."""
PATIENCE: Seconds = 2.0
"""A machine that is busy may hold up the simulated force sensor for so long before it is asked again."""
UNITS = {"position": "m", "force": "N", "slip_across": "m/s", "slip_along": "m/s"}


Show = Callable[[Progress, Sequence[Notice]], None]


def _nothing(_now: Progress, _notices: Sequence[Notice]) -> None:
    """Show nothing."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Stage:
    """Where the parts meet: the JACK server's name, empty for the usual one, and the DDS domain."""

    server: str = ""
    domain: int | None = None


def perform(
    session: Assignment,
    path: Path,
    stage: Stage | None = None,
    show: Show = _nothing,
) -> Summary:
    """Play a session in real time and record it.

    Parameters
    ----------
    session
        What to play; its streams come as late as `monochord.lab.bench.delays` says.
    path
        The session's file.
    stage
        Where the parts meet.
    show
        As `monochord.capture.recording.record` takes it.

    Returns
    -------
    Summary
        What the recorder saved.

    Raises
    ------
    InputError
        If the file exists or the plan cannot be carried out.
    DeviceError
        If there is no JACK server, or a part does not start.
    """
    stage, sound, late = stage or Stage(), render(session), delays(session)
    labels = _LabelsFeed(sound, late["wrench"])
    with scratch_folder() as folder, ExitStack() as stack:
        parts = {
            name: stack.enter_context(_process(name, folder / f"{name}.npz", arrays, settings))
            for name, (arrays, settings) in _scripts(session, sound, late, stage).items()
        }
        said, ports = parts["net_ft_device"].said, parts["player"].said["ports"]
        pose: dict[str, Any] = {"topic": _topic(), "rate": session.plan.pose_rate}
        if stage.domain is not None:
            pose["domain"] = stage.domain
        job = Job(
            path=path,
            source=SOURCES.build("jack", {"ports": ",".join(ports), "server": stage.server}),
            instruments={
                "net_ft": INSTRUMENTS.build("net_ft", {**said, "silence_seconds": PATIENCE}),
                "pose_dds": INSTRUMENTS.build("pose_dds", pose),
                "labels": labels,
            },
            about=_About(session),
            diary=labels.diary,
            # From when it really began: a busy machine may take its time until then.
            enough=lambda now: labels.over(now - max(late.values()) - TAIL),
        )

        def shown(now: Progress, notices: Sequence[Notice]) -> None:
            if labels.begin is None:
                begin = time.monotonic() + LEAD
                for part in parts.values():
                    part.begin_at(begin + (late["audio"] if part.name == "player" else 0.0))
                labels.begin = begin
            show(now, notices)

        return record(job, shown)


def play(session: Assignment, folder: Path, stage: Stage | None = None, show: Show = _nothing) -> Outcome:
    """Play and record the session's file in a folder, unless it is there already, as `bench.make` makes it.

    Raises
    ------
    InputError
        If there is a file of that name that holds something else, or the disk filled up.
    DeviceError
        If there is no JACK server, a part does not start, or one went away.
    KeyboardInterrupt
        If somebody asked for the end; what was recorded so far stays beside, as NAME.mcap.part.
    """
    path = folder / f"{session.name}.mcap"
    if there := made_before(path, _told(session)):
        return there
    part = path.with_name(f"{path.name}.part")
    part.unlink(missing_ok=True)
    summary = perform(session, part, stage, show)
    if summary.failure:
        raise DeviceError(summary.failure)
    if summary.interrupted:
        raise KeyboardInterrupt
    found = replace(outcome(part), path=path)
    part.replace(path)
    return found


def _scripts(
    session: Assignment, sound: Rendering, late: dict[str, Seconds], stage: Stage
) -> dict[str, tuple[dict[str, Floats], Any]]:
    """Return what each process plays, and how."""
    plan, sensor = session.plan, session.plan.force_sensor
    seed = int(session.random("stage").integers(2**31))
    return {
        "player": (
            {"samples": sound.microphones.astype(np.float64)},
            PlayerSettings(
                sample_rate=plan.sample_rate, client_name=f"monochord-{os.getpid()}", server=stage.server
            ),
        ),
        "net_ft_device": (
            {"wrenches": sound.wrench},
            NetFtSettings(
                rate=plan.force_rate, delay=late["wrench"], jitter=sensor.jitter, loss=sensor.lost, seed=seed
            ),
        ),
        "pose_publisher": (
            {"poses": sound.pose},
            PublisherSettings(
                rate=plan.pose_rate, delay=late["pose"], topic=_topic(), wrench_topic="", domain=stage.domain
            ),
        ),
    }


def _topic() -> str:
    return f"/monochord_{os.getpid()}/pose"


@dataclass(frozen=True, slots=True)
class _Part:
    """A running process of the stage, and what it said of itself."""

    name: str
    process: "subprocess.Popen[str]"
    said: dict[str, Any]

    def begin_at(self, begin: Seconds) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{begin!r}\n")
        self.process.stdin.flush()


@contextmanager
def _process(name: str, script: Path, arrays: dict[str, Floats], settings: Any) -> Generator[_Part]:
    """Start a part as a process; it ends with the context."""
    write_script(script, arrays, settings)
    command = [sys.executable, "-m", f"monochord.lab.{name}", str(script)]
    with subprocess.Popen(  # noqa: S603  (our own module)
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield _Part(name, process, _first_words(name, process))
        finally:
            if process.stdin is not None:
                with suppress(OSError):
                    process.stdin.close()
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:
                process.kill()


def _first_words(name: str, process: "subprocess.Popen[str]") -> dict[str, Any]:
    """Return what a part says when it is ready; raises `DeviceError` with its last words where it is not."""
    assert process.stdout is not None
    assert process.stderr is not None
    ready, _, _ = select.select([process.stdout], [], [], START)
    if not ready:
        raise DeviceError(f"{name} of the bench: did not start within {START:g} s; is the machine that busy?")
    line = process.stdout.readline()
    if line:
        return json.loads(line)
    words = process.stderr.read().strip().splitlines() or ["ended without a word"]
    raise DeviceError(f"{name} of the bench: {words[-1].partition('Error: ')[2] or words[-1]}")


def _told(session: Assignment) -> Description:
    """Return what a session that is played says of itself, but for its feeds."""
    told = describe(session)
    return replace(told, feeds=(), more={**told.more, "played": "in real time"})


@dataclass(frozen=True, slots=True)
class _About:
    """Describes a session that is played as its plan does, with the instruments that were really there."""

    session: Assignment

    def describe(self, name: str, signal: Signal, feeds: tuple[Feed, ...]) -> Description:
        told = _told(self.session)
        assert signal.sample_rate == told.sample_rate, f"the player refuses any other rate for {name}"
        return replace(told, feeds=feeds)


class _LabelsFeed(Instrument, Connection):
    """What is true while the session plays, as the rendering knows it, given out as it becomes true.

    Like the offline bench's, its times are those of the force sensor, `late` after the truth.
    """

    def __init__(self, sound: Rendering, late: Seconds) -> None:
        self.begin: Seconds | None = None
        self._seconds = sound.seconds
        self._names = tuple(sound.labels)
        self._time = sound.label_time + late
        self._values = np.stack([sound.labels[name] for name in self._names], axis=1)
        self._events = [(event.time + late, event) for event in sound.events]
        self._given = self._told = 0

    @contextmanager
    def open(self) -> Generator["_LabelsFeed"]:
        yield self

    @property
    def feed(self) -> Feed:
        units = tuple(UNITS.get(name, "") for name in self._names)
        return Feed(stream="labels", columns=self._names, units=units)

    @property
    def health(self) -> InstrumentHealth:
        return InstrumentHealth(readings=self._given)

    def poll(self) -> list[Readings]:
        if self.begin is None:
            return []
        until = int(np.searchsorted(self._time, time.monotonic() - self.begin))
        part, none = slice(self._given, until), np.full(until - self._given, -1)
        if not none.size:
            return []
        self._given = until
        return [
            Readings(
                stream="labels",
                time=self.begin + self._time[part],
                values=self._values[part],
                sequence=none,
                device_time=none,
                status=np.zeros(none.size, np.uint32),
            )
        ]

    def over(self, time: Seconds) -> bool:
        """Return whether all is played, and was so at a time."""
        return self.begin is not None and time >= self.begin + self._seconds

    def diary(self, now: Seconds) -> list[Notice]:
        """Return the events that have happened since the last call."""
        found: list[Notice] = []
        while self.begin is not None and self._told < len(self._events):
            due, event = self._events[self._told]
            if self.begin + due > now:
                break
            self._told += 1
            found.append(
                Notice(time=self.begin + due, kind=event.kind, text=event.text, data=dict(event.data))
            )
        return found
