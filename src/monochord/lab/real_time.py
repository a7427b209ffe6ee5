"""Plays a session of a plan in real time: each device is a process behind its real port or protocol.

A JACK client plays the twin's sound, a simulated Net F/T sends wrenches over UDP, and a simulated robot sends
poses over DDS; the recorder records them like hardware. Only the labels, which no instrument measures, are
passed to it directly.
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
from monochord.capture.recording import RecordingJob, RecordingState, RecordingSummary, record
from monochord.capture.sources import SOURCES
from monochord.core.errors import DeviceError
from monochord.core.ownership import scratch_folder
from monochord.core.types import Feed, Floats, InstrumentHealth, Readings, Signal
from monochord.core.units import Seconds
from monochord.lab._script import write_script
from monochord.lab.assignment import Assignment
from monochord.lab.net_ft_device import NetFtSettings
from monochord.lab.offline import CollectedSession, delays, describe, existing, summarise
from monochord.lab.player import PlayerSettings
from monochord.lab.pose_publisher import PublisherSettings
from monochord.lab.render import Rendering, render
from monochord.sessions import Description, Event

LEAD: Seconds = 1.0
"""Time from the start command to the start, in s: the player schedules its first frame 0.2 s before it."""
TAIL: Seconds = 1.0
"""Time recorded after the last reading was due, in s."""
START_TIMEOUT: Seconds = 60.0
"""Time for a process to report that it is ready, in s."""
SENSOR_SILENCE: Seconds = 2.0
"""Silence after which the force sensor is restarted, in s: a busy machine delays the simulated one."""
UNITS = {"position": "m", "force": "N", "slip_across": "m/s", "slip_along": "m/s"}


Show = Callable[[RecordingState, Sequence[Event]], None]


def _ignore(_now: RecordingState, _notices: Sequence[Event]) -> None:
    """Show nothing."""


def perform(
    session: Assignment, path: Path, *, server: str = "", domain: int | None = None, show: Show = _ignore
) -> RecordingSummary:
    """Play a session in real time and record it into a new file.

    Its streams have the delays of `monochord.lab.offline.delays`. `server` names the JACK server, empty for
    the default one; `domain` is the DDS domain, None for ``$ROS_DOMAIN_ID``, or else 0. Raises `InputError`
    where the file exists or the plan cannot be carried out, and `DeviceError` without a JACK server, or where
    a device does not start.
    """
    rendering, delay = render(session), delays(session)
    labels = _LabelsFeed(rendering, delay["wrench"])
    with scratch_folder() as folder, ExitStack() as stack:
        devices = {
            name: stack.enter_context(
                _process(f"monochord.lab.{name}", folder / f"{name}.npz", arrays, settings)
            )
            for name, (arrays, settings) in _scripts(session, rendering, delay, server, domain).items()
        }
        address, ports = devices["net_ft_device"].address, devices["player"].address["ports"]
        pose: dict[str, Any] = {"topic": _topic(), "rate": session.plan.pose_rate}
        if domain is not None:
            pose["domain"] = domain
        job = RecordingJob(
            path=path,
            source=SOURCES.build("jack", {"ports": ",".join(ports), "server": server}),
            instruments={
                "net_ft": INSTRUMENTS.build("net_ft", {**address, "silence_seconds": SENSOR_SILENCE}),
                "pose_dds": INSTRUMENTS.build("pose_dds", pose),
                "labels": labels,
            },
            about=_Describer(session),
            events=labels.events,
            # Counted from the real begin: a busy machine may need a while until then.
            finished=lambda now: labels.over(now - max(delay.values()) - TAIL),
        )

        def shown(now: RecordingState, notices: Sequence[Event]) -> None:
            if labels.begin is None:
                begin = time.monotonic() + LEAD
                for device in devices.values():
                    device.begin_at(begin + (delay["audio"] if device.name == "player" else 0.0))
                labels.begin = begin
            show(now, notices)

        return record(job, shown)


def play(session: Assignment, folder: Path, *, server: str = "", show: Show = _ignore) -> CollectedSession:
    """Play and record the session's file in a folder, unless it exists already, as `offline.make` does.

    Raises `KeyboardInterrupt` where an end was requested; the partial recording remains as NAME.mcap.part.
    """
    path = folder / f"{session.name}.mcap"
    if result := existing(path, _description(session)):
        return result
    part = path.with_name(f"{path.name}.part")
    part.unlink(missing_ok=True)
    summary = perform(session, part, server=server, show=show)
    if summary.failure:
        raise DeviceError(summary.failure)
    if summary.interrupted:
        raise KeyboardInterrupt
    result = replace(summarise(part), path=path)
    part.replace(path)
    return result


def _scripts(
    session: Assignment, rendering: Rendering, delay: dict[str, Seconds], server: str, domain: int | None
) -> dict[str, tuple[dict[str, Floats], Any]]:
    """Return the arrays and settings of each process."""
    plan, sensor = session.plan, session.plan.force_sensor
    seed = int(session.random("stage").integers(2**31))
    return {
        "player": (
            {"samples": rendering.microphones.astype(np.float64)},
            PlayerSettings(
                sample_rate=plan.sample_rate, client_name=f"monochord-{os.getpid()}", server=server
            ),
        ),
        "net_ft_device": (
            {"wrenches": rendering.wrench},
            NetFtSettings(
                rate=plan.force_rate, delay=delay["wrench"], jitter=sensor.jitter, loss=sensor.lost, seed=seed
            ),
        ),
        "pose_publisher": (
            {"poses": rendering.pose},
            PublisherSettings(rate=plan.pose_rate, delay=delay["pose"], topic=_topic(), domain=domain),
        ),
    }


def _topic() -> str:
    return f"/monochord_{os.getpid()}/pose"


@dataclass(frozen=True, slots=True)
class _Device:
    """A running process of a simulated device, and the address that it printed."""

    name: str
    process: "subprocess.Popen[str]"
    address: dict[str, Any]

    def begin_at(self, begin: Seconds) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{begin!r}\n")
        self.process.stdin.flush()


@contextmanager
def _process(module: str, script: Path, arrays: dict[str, Floats], settings: Any) -> Generator[_Device]:
    """Start a device's module as a process that ends with the context."""
    name = module.rpartition(".")[2]
    write_script(script, arrays, settings)
    command = [sys.executable, "-m", module, str(script)]
    with subprocess.Popen(  # noqa: S603  (our own module)  # nosec B603
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            yield _Device(name, process, _first_words(name, process))
        finally:
            if process.stdin is not None:
                with suppress(OSError):
                    process.stdin.close()
            try:
                process.wait(5.0)
            except subprocess.TimeoutExpired:
                process.kill()


def _first_words(name: str, process: "subprocess.Popen[str]") -> dict[str, Any]:
    """Return the address that a device prints when ready; raises `DeviceError` on failure."""
    assert process.stdout is not None
    assert process.stderr is not None
    ready, _, _ = select.select([process.stdout], [], [], START_TIMEOUT)
    if not ready:
        raise DeviceError(f"{name}: did not start within {START_TIMEOUT:g} s; is the machine too busy?")
    line = process.stdout.readline()
    if line:
        return json.loads(line)
    words = process.stderr.read().strip().splitlines() or ["ended without a message"]
    raise DeviceError(f"{name}: {words[-1].partition('Error: ')[2] or words[-1]}")


def _description(session: Assignment) -> Description:
    """Return the description of a session played in real time, without its feeds."""
    description = describe(session)
    return replace(description, feeds=(), more={**description.more, "played": "in real time"})


@dataclass(frozen=True, slots=True)
class _Describer:
    """Describes a session according to its plan, with the instruments that recorded it."""

    session: Assignment

    def describe(self, name: str, signal: Signal, feeds: tuple[Feed, ...]) -> Description:
        description = _description(self.session)
        assert signal.sample_rate == description.sample_rate, f"it must equal the rate of {name}"
        return replace(description, feeds=feeds)


class _LabelsFeed(Instrument, Connection):
    """The labels of the rendering, delivered during playback.

    As in `monochord.lab.offline`, their times are the force sensor's, `delay` after the true ones.
    """

    def __init__(self, rendering: Rendering, delay: Seconds) -> None:
        self.begin: Seconds | None = None
        self._seconds = rendering.seconds
        self._names = tuple(rendering.labels)
        self._time = rendering.label_time + delay
        self._values = np.stack([rendering.labels[name] for name in self._names], axis=1)
        self._due_events = [(event.time + delay, event) for event in rendering.events]
        self._delivered = self._events_delivered = 0

    @contextmanager
    def open(self) -> Generator["_LabelsFeed"]:
        yield self

    @property
    def feed(self) -> Feed:
        units = tuple(UNITS.get(name, "") for name in self._names)
        return Feed(stream="labels", columns=self._names, units=units)

    @property
    def health(self) -> InstrumentHealth:
        return InstrumentHealth(readings=self._delivered)

    def poll(self) -> list[Readings]:
        if self.begin is None:
            return []
        until = int(np.searchsorted(self._time, time.monotonic() - self.begin))
        part, none = slice(self._delivered, until), np.full(until - self._delivered, -1)
        if not none.size:
            return []
        self._delivered = until
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
        """Return whether the session had ended by a time."""
        return self.begin is not None and time >= self.begin + self._seconds

    def events(self, now: Seconds) -> list[Event]:
        """Return the events since the last call."""
        notices: list[Event] = []
        while self.begin is not None and self._events_delivered < len(self._due_events):
            due, event = self._due_events[self._events_delivered]
            if self.begin + due > now:
                break
            self._events_delivered += 1
            notices.append(replace(event, time=self.begin + due))
        return notices
