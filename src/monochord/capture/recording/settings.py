"""Recording settings, and the job built from them."""

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Annotated, Any, Protocol

from msgspec import Meta

from monochord.capture.instruments import INSTRUMENTS
from monochord.capture.instruments.base import Instrument
from monochord.capture.recording.streams import NamedInstrument
from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Source
from monochord.core.config import Tree, from_tree, to_tree
from monochord.core.errors import InputError
from monochord.core.ranges import Checked, Finite, NonNegative
from monochord.core.types import Feed, Signal
from monochord.core.units import Metres, Seconds
from monochord.physics.sensors import load_sensor, sensor_tuning
from monochord.sessions import TUNING, Description, Event


def kind_of(name: str, table: Mapping[str, Any]) -> str:
    """Return the instrument kind of a named table: its ``name``, or else the table's name.

    >>> kind_of("pose_udp_2", {}), kind_of("left", {"name": "pose-udp"})
    ('pose_udp', 'pose_udp')
    """
    kind = str(table.get("name", re.sub(r"_\d+$", "", name)))
    return kind.replace("-", "_")


class Describer(Protocol):
    """Describes a recording, once its source and instruments are open."""

    def describe(self, name: str, signal: Signal, feeds: tuple[Feed, ...]) -> Description:
        """Return the description of a session called `name`."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingSubject:
    """The subject of a recording, as stored in its session; the fields are those of `sessions.Description`.

    `sensor` names a preset or a TOML file in the same format, such as a tuned sensor's. `simulated` marks
    data that did not come from hardware; a source that provides its string always counts as simulated.
    """

    object: str = ""
    material: str = ""
    radius: Metres | None = None
    sensor: str = ""
    preamp_gains: tuple[Finite[float], ...] = ()
    simulated: bool = False
    day: int | None = None
    plan: str = ""
    note: str = ""

    def describe(self, name: str, signal: Signal, feeds: tuple[Feed, ...]) -> Description:
        """Return the description of a session called `name`; raises `InputError` for an unknown sensor."""
        known: dict[str, Any] = of_sensor(self.sensor) if self.sensor else {"string": signal.string}
        return Description(
            name=name,
            sample_rate=signal.sample_rate,
            channels=signal.channels,
            simulated=self.simulated or signal.string is not None,
            object=self.object,
            material=self.material,
            radius=self.radius,
            preamp_gains=self.preamp_gains,
            day=self.day,
            plan=self.plan,
            notes=self.note,
            feeds=feeds,
            **known,
        )


def of_sensor(name: str) -> dict[str, Any]:
    """Return the `Description` options for a sensor: a preset, or the file of a tuned sensor."""
    sensor, tuning = load_sensor(name), sensor_tuning(name)
    more = {TUNING: json.dumps(to_tree(tuning), sort_keys=True)} if tuning else {}
    return {"sensor": to_tree(sensor), "string": sensor.string, "more": more}


@dataclass(frozen=True, slots=True, kw_only=True)
class DiskLimits(Checked):
    """Limits on free disk space in bytes: to `start`, and to continue (`stop`).

    A warning is shown when the disk will be full in less than `warn` seconds at the present rate.
    """

    start: NonNegative[float] = 100e6
    stop: NonNegative[float] = 20e6
    warn: Annotated[Seconds, Meta(ge=0.0)] = 600.0

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.stop > self.start:
            raise InputError(
                f"disk start {self.start:g}, stop {self.stop:g}", "stop no larger than start, in bytes"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingJob:
    """A recording, ready to start: its file, plug-ins, description, and end.

    `instruments` are by name. `queue_bytes` is the memory queue's capacity for a slow disk. `events` is
    called at each write, with the monotonic time, for further session events; `finished` is called in the
    same way and decides whether to end before `seconds`.
    """

    path: Path
    source: Source
    instruments: Mapping[str, Instrument] = field(default_factory=dict[str, Instrument])
    about: Describer = RecordingSubject()
    disk: DiskLimits = DiskLimits()
    seconds: Seconds = math.inf
    queue_bytes: int = 1 << 25
    events: Callable[[Seconds], Sequence[Event]] = lambda _now: ()
    finished: Callable[[Seconds], bool] = lambda _now: False


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingSettings(Checked):
    """Settings of a recording: the source as a table with its name, instruments as tables by name.

    An instrument's table is named after its kind, with a number from the second one on: ``pose_udp``,
    ``pose_udp_2``. A table of any other name gives the kind as ``name``; its own name becomes the stream's
    name.

    >>> tree = {"source": {"name": "wav", "path": "take.wav"}, "about": {"object": "plastic"}}
    >>> RecordingSettings.read(tree).job(Path("take.mcap")).about.object
    'plastic'
    """

    source: dict[str, Any] = field(default_factory=lambda: {"name": "jack"})
    instruments: dict[str, dict[str, Any]] = field(default_factory=dict[str, dict[str, Any]])
    about: RecordingSubject = RecordingSubject()
    disk: DiskLimits = DiskLimits()
    seconds: Annotated[Seconds, Meta(gt=0.0)] = math.inf

    @classmethod
    def read(cls, tree: Tree) -> "RecordingSettings":
        """Build from plain values; unknown keys raise."""
        return from_tree(cls, tree)

    def job(self, path: Path) -> RecordingJob:
        """Build every plug-in; raises `InputError` for an unknown name, option or sensor, or suffix."""
        if path.suffix != ".mcap":
            raise InputError(f"file '{path}'", "a name that ends in .mcap")
        options = dict(self.source)
        name = options.pop("name", None)
        if not isinstance(name, str):
            raise InputError("source without a name", ", ".join(SOURCES.names()), "set source.name")
        if self.about.sensor:
            load_sensor(self.about.sensor)  # refused before any device is opened
        return RecordingJob(
            path=path,
            source=SOURCES.build(name, options),
            instruments=self._instruments(),
            about=self.about,
            disk=self.disk,
            seconds=self.seconds,
        )

    def _instruments(self) -> dict[str, Instrument]:
        """Build the instruments; one with a custom name has a stream of that name."""
        instruments: dict[str, Instrument] = {}
        for key, table in self.instruments.items():
            name, options = key.replace("-", "_"), dict(table)
            kind = kind_of(name, options)
            options.pop("name", None)
            if name in instruments:
                raise InputError(f"two instruments called '{name}'", "different names", "rename one")
            if name in INSTRUMENTS.names() and name != kind:
                given = f"instrument {kind} called '{name}'"
                raise InputError(given, "a name other than an instrument kind's", "rename it")
            is_named = re.sub(r"_\d+$", "", name) != kind
            stream = name if is_named else options.get("stream")
            if is_named and options.get("stream", name) != name:
                given = f"stream '{options['stream']}' of the instrument called '{name}'"
                raise InputError(given, f"'{name}', the instrument's name", "omit one of them")
            if is_named and "stream" in {each.name for each in fields(INSTRUMENTS.load(kind))}:  # pyright: ignore[reportArgumentType]
                options["stream"] = name
            built = INSTRUMENTS.build(kind, options)
            instruments[name] = NamedInstrument(instrument=built, stream=stream) if stream else built
        return instruments
