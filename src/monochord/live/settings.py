"""What a person configures of a live run, and the plug-ins that are built from it."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import MAX_CHANNELS, Source
from monochord.core.config import Tree, from_tree, to_tree
from monochord.core.errors import InputError
from monochord.core.registry import Registry
from monochord.core.units import Samples, Seconds
from monochord.live.filter import FilterSettings
from monochord.live.health import HealthSettings
from monochord.live.sinks import SINKS
from monochord.live.sinks.base import Sink
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.estimators.base import Estimator

T = TypeVar("T")
MODEL = "model"
"""The estimator that a trained model is given to."""
RECORDINGS: Mapping[str, str] = {".wav": "wav", ".flac": "wav", ".mcap": "session"}
"""The source that reads a recording, by the suffix of its file."""
MIN_WINDOW: Seconds = 0.01  # holds a period of 100 Hz
MIN_HOP: Seconds = 0.001  # 16 frames at the lowest rate of a source
MAX_WINDOW: Seconds = 60.0
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""Name of a string: it stands in topics of ROS 2 and in names of files."""


def recording_source(path: str | Path) -> str | None:
    """Return the name of the source that reads a recording, None for what no file is called.

    >>> recording_source("take.WAV"), recording_source("take.mcap"), recording_source("system:capture_1")
    ('wav', 'session', None)
    """
    usual = "wav" if Path(path).exists() else None
    return RECORDINGS.get(Path(path).suffix.lower(), usual)


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowSettings:
    """Length of a window and distance of window starts.

    >>> WindowSettings(length=0.1, hop=0.01).frames(44100)
    (4410, 441)
    """

    length: Seconds = 0.1
    hop: Seconds = 0.01

    def __post_init__(self) -> None:
        for name, span, shortest in (("length", self.length, MIN_WINDOW), ("hop", self.hop, MIN_HOP)):
            if not shortest <= span <= MAX_WINDOW:
                raise InputError(f"window {name} {span:g} s", f"{shortest:g} to {MAX_WINDOW:g} s")

    def frames(self, sample_rate: int) -> tuple[Samples, Samples]:
        """Return window length and hop in frames, to the nearest frame."""
        return round(self.length * sample_rate), round(self.hop * sample_rate)


@dataclass(frozen=True, slots=True, kw_only=True)
class StringSettings:
    """One of several strings that share a source: its channels there, counted from 1, and what it is.

    Without `channels` it has the next two after those of the string before it. `sensor` and `string` are as
    in `LiveRun`, those of the run where both are empty.
    """

    channels: tuple[int, ...] = ()
    sensor: str = ""
    string: str = ""


ONE_STRING: Mapping[str, StringSettings] = MappingProxyType({})


def channels_of(strings: Mapping[str, StringSettings]) -> dict[str, tuple[int, ...]]:
    """Return the channels of each string, counted from 1.

    Raises
    ------
    InputError
        If a name is no name, a string has more than two channels, or two strings share one.

    Examples
    --------
    >>> two = StringSettings()
    >>> channels_of({"left": two, "right": two, "low": StringSettings(channels=(7,))})
    {'left': (1, 2), 'right': (3, 4), 'low': (7,)}
    """
    channels: dict[str, tuple[int, ...]] = {}
    used: dict[int, str] = {}
    end = 0
    for name, each in strings.items():
        if not NAME.fullmatch(name):
            raise InputError(f"string called '{name}'", "a letter, then letters, digits and underscores")
        own = each.channels or (end + 1, end + 2)
        if len(set(own)) != len(own) or len(own) > 2 or not 1 <= min(own) <= max(own) <= MAX_CHANNELS:
            given = f"channels {', '.join(map(str, own))} of the string {name}"
            raise InputError(given, f"one or two different ones from 1 to {MAX_CHANNELS}")
        for channel in own:
            if channel in used:
                raise InputError(f"channel {channel} of the strings {used[channel]} and {name}", "one string")
            used[channel] = name
        channels[name], end = own, max(own)
    return channels


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveRun:
    """A live run, ready to start: built plug-ins, the window, and when to end.

    `string` names the preset of the string for a source that does not know its own, and is refused by one
    that does. `sensor` names a sensor, or the file of one as tuned: its string counts, whatever the source
    knows of its own. `strings` are several strings by their names, whose channels one source has; without
    any its one or two channels are those of one. `seconds` of the stream are processed, with `real_time`
    before other programs: by threads of real-time priority, as those of JACK have. `filter` says how
    estimates are followed over time, `health` when something is worth a note; those of single windows do not
    depend on either.
    """

    source: Source
    estimator: Estimator
    sinks: tuple[Sink, ...] = ()
    window: WindowSettings = WindowSettings()
    filter: FilterSettings = field(default_factory=FilterSettings)
    health: HealthSettings = field(default_factory=HealthSettings)
    string: str = ""
    sensor: str = ""
    strings: Mapping[str, StringSettings] = field(default_factory=lambda: ONE_STRING)
    seconds: Seconds = math.inf
    real_time: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSettings:
    """A live run as configured: each plug-in as a table with its name and its options.

    `source` and `estimator` hold ``name`` and options; `sinks` holds options by sink name, `strings` what is
    known of each of several strings by its name. A source with an option for its channels has as many as
    they need.
    """

    source: dict[str, Any] = field(default_factory=lambda: {"name": "jack"})
    estimator: dict[str, Any] = field(default_factory=lambda: {"name": "closed_form"})
    window: WindowSettings = WindowSettings()
    filter: FilterSettings = field(default_factory=FilterSettings)
    health: HealthSettings = field(default_factory=HealthSettings)
    sinks: dict[str, dict[str, Any]] = field(default_factory=lambda: {"terminal": {}})
    string: str = ""
    sensor: str = ""
    strings: dict[str, StringSettings] = field(default_factory=dict[str, StringSettings])
    seconds: Seconds = math.inf
    real_time: bool = False

    @classmethod
    def read(cls, tree: Mapping[str, Any]) -> "LiveSettings":
        """Build from plain values, strictly."""
        return from_tree(cls, tree)

    def __post_init__(self) -> None:
        if not self.seconds > 0.0:
            raise InputError(f"{self.seconds:g} seconds", "more than 0")

    def build(self) -> LiveRun:
        """Build every plug-in; raises `InputError` for an unknown name or option."""
        estimator = _build(ESTIMATORS, self.estimator)
        sinks = [SINKS.build(name, options, where=f"sinks.{name}") for name, options in self.sinks.items()]
        return LiveRun(
            source=self._source(),
            estimator=estimator,
            sinks=tuple(sinks),
            window=self.window,
            filter=self.filter,
            health=self.health,
            string=self.string,
            sensor=self.sensor,
            strings=self.strings,
            seconds=self.seconds,
            real_time=self.real_time,
        )

    def _source(self) -> Source:
        """Return the source, with the channels that the strings need where it has an option for that."""
        source = _build(SOURCES, self.source)
        needed = max((max(each) for each in channels_of(self.strings).values()), default=0)
        if needed > getattr(source, "channels", needed):
            return _build(SOURCES, {**self.source, "channels": needed})
        return source

    def resolved(self) -> Tree:
        """Return every option with its value, defaults too: what is saved beside a result."""
        setup = self.build()
        sinks = zip(self.sinks, setup.sinks, strict=True)
        return {
            "source": _named(self.source, setup.source),
            "estimator": _named(self.estimator, setup.estimator),
            "window": to_tree(self.window),
            "filter": to_tree(self.filter),
            "health": to_tree(self.health),
            "sinks": {name.replace("-", "_"): to_tree(sink) for name, sink in sinks},
            "string": self.string,
            "sensor": self.sensor,
            "strings": {name: to_tree(each) for name, each in self.strings.items()},
            "seconds": self.seconds,
            "real_time": self.real_time,
        }


def _build(registry: Registry[T], table: Mapping[str, Any]) -> T:
    options = dict(table)
    name = options.pop("name", None)
    if not isinstance(name, str):
        given = f"{registry.kind} without a name"
        raise InputError(given, ", ".join(registry.names()), f"write {registry.kind}.name")
    return registry.build(name, options, where=registry.kind)


def _named(table: Mapping[str, Any], built: object) -> Tree:
    return {"name": str(table["name"]).replace("-", "_"), **to_tree(built)}
