"""What a person configures of a recording, and the job that is built from it."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Protocol

from monochord.capture.instruments import INSTRUMENTS
from monochord.capture.instruments.base import Instrument
from monochord.capture.recording.streams import NamedInstrument
from monochord.capture.recording.watch import Notice
from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Source
from monochord.core.config import Tree, from_tree, to_tree
from monochord.core.errors import InputError
from monochord.core.types import Feed, Signal
from monochord.core.units import Metres, Seconds
from monochord.physics.sensors import load_sensor
from monochord.sessions import Description


def kind_of(name: str, table: Mapping[str, Any]) -> str:
    """Return the kind of the instrument whose table has a name: what it says, or else that name.

    >>> kind_of("pose_udp_2", {}), kind_of("left", {"name": "pose-udp"})
    ('pose_udp', 'pose_udp')
    """
    kind = str(table.get("name", re.sub(r"_\d+$", "", name)))
    return kind.replace("-", "_")


class Subject(Protocol):
    """Whatever can describe a recording, once it is known what its source and instruments are."""

    def describe(self, name: str, signal: Signal, feeds: tuple[Feed, ...]) -> Description:
        """Return the description of a session called `name`."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class About:
    """What a recording is of, as its session will tell; the fields are those of `sessions.Description`.

    `sensor` names a preset, or a TOML file laid out as one. `simulated` marks what did not come from
    hardware; a source that knows its own string is a simulation anyway.
    """

    object: str = ""
    material: str = ""
    radius: Metres | None = None
    sensor: str = ""
    preamp_gains: tuple[float, ...] = ()
    simulated: bool = False
    day: int | None = None
    plan: str = ""
    note: str = ""

    def describe(self, name: str, signal: Signal, feeds: tuple[Feed, ...]) -> Description:
        """Return the description of a session called `name`; raises `InputError` for an unknown sensor."""
        sensor = load_sensor(self.sensor) if self.sensor else None
        return Description(
            name=name,
            sample_rate=signal.sample_rate,
            channels=signal.channels,
            simulated=self.simulated or signal.string is not None,
            sensor=to_tree(sensor) if sensor else {},
            string=sensor.string if sensor else signal.string,
            object=self.object,
            material=self.material,
            radius=self.radius,
            preamp_gains=self.preamp_gains,
            day=self.day,
            plan=self.plan,
            notes=self.note,
            feeds=feeds,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class DiskLimits:
    """When the disk is too full, in bytes that are free: to `start`, and to go on (`stop`).

    A person is warned when less than `warn` seconds of recording are left at the pace so far.
    """

    start: float = 100e6
    stop: float = 20e6
    warn: Seconds = 600.0

    def __post_init__(self) -> None:
        if not (0.0 <= self.stop <= self.start < math.inf and self.warn >= 0.0):
            given = f"disk start {self.start:g}, stop {self.stop:g}, warn {self.warn:g}"
            raise InputError(given, "0 <= stop <= start in bytes, and warn in seconds, 0 or more")


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A recording, ready to start: where it goes, built plug-ins, what it is of, and when to end.

    `instruments` are by name. `room` is how many bytes may wait in memory for a slow disk. `diary` is asked
    at each writing, with the monotonic time, what else has happened that the session is to tell; `enough`,
    likewise, whether it may end, beside `seconds`.
    """

    path: Path
    source: Source
    instruments: Mapping[str, Instrument] = field(default_factory=dict[str, Instrument])
    about: Subject = About()
    disk: DiskLimits = DiskLimits()
    seconds: Seconds = math.inf
    room: int = 1 << 25
    diary: Callable[[Seconds], Sequence[Notice]] = lambda _now: ()
    enough: Callable[[Seconds], bool] = lambda _now: False


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """A recording as configured: the source as a table with its name, instruments as tables by name.

    A table of an instrument is called as its kind, and numbered from the second on: ``pose_udp``,
    ``pose_udp_2``. One of any other name says its kind as ``name``, and its own name is its stream's.

    >>> tree = {"source": {"name": "wav", "path": "take.wav"}, "about": {"object": "plastic"}}
    >>> Settings.read(tree).job(Path("take.mcap")).about.object
    'plastic'
    """

    source: dict[str, Any] = field(default_factory=lambda: {"name": "jack"})
    instruments: dict[str, dict[str, Any]] = field(default_factory=dict[str, dict[str, Any]])
    about: About = About()
    disk: DiskLimits = DiskLimits()
    seconds: Seconds = math.inf

    @classmethod
    def read(cls, tree: Tree) -> "Settings":
        """Build from plain values, strictly."""
        return from_tree(cls, tree)

    def __post_init__(self) -> None:
        if not self.seconds > 0.0:
            raise InputError(f"{self.seconds:g} seconds", "more than 0")

    def job(self, path: Path) -> Job:
        """Build every plug-in; raises `InputError` for an unknown name, option or sensor, or no .mcap."""
        if path.suffix != ".mcap":
            raise InputError(f"file '{path}'", "a name that ends in .mcap")
        options = dict(self.source)
        name = options.pop("name", None)
        if not isinstance(name, str):
            raise InputError("source without a name", ", ".join(SOURCES.names()), "write source.name")
        if self.about.sensor:
            load_sensor(self.about.sensor)  # refused before any device is opened
        return Job(
            path=path,
            source=SOURCES.build(name, options),
            instruments=self._instruments(),
            about=self.about,
            disk=self.disk,
            seconds=self.seconds,
        )

    def _instruments(self) -> dict[str, Instrument]:
        """Build the instruments; one of a name of its own has a stream of that name."""
        found: dict[str, Instrument] = {}
        for written, table in self.instruments.items():
            name, options = written.replace("-", "_"), dict(table)
            kind = kind_of(name, options)
            options.pop("name", None)
            if name in found:
                raise InputError(f"two instruments called '{name}'", "names of their own", "rename one")
            if name in INSTRUMENTS.names() and name != kind:
                given = f"instrument {kind} called '{name}'"
                raise InputError(given, "a name that no kind of instrument has", "rename it")
            is_named = re.sub(r"_\d+$", "", name) != kind
            stream = name if is_named else options.get("stream")
            if is_named and options.get("stream", name) != name:
                given = f"stream '{options['stream']}' of the instrument called '{name}'"
                raise InputError(given, f"'{name}', as it is called", "leave out the one or the other")
            if is_named and "stream" in {each.name for each in fields(INSTRUMENTS.load(kind))}:  # pyright: ignore[reportArgumentType]
                options["stream"] = name
            built = INSTRUMENTS.build(kind, options)
            found[name] = NamedInstrument(instrument=built, stream=stream) if stream else built
        return found
