"""The configuration of a live run, as the user writes it and as the loop takes it."""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, TypeAlias, TypeVar, cast

from msgspec import Meta

from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import MAX_CHANNELS, Source
from monochord.core.config import Tree, from_tree, table, to_tree
from monochord.core.errors import InputError
from monochord.core.ranges import Checked
from monochord.core.registry import Registry
from monochord.core.units import Hertz, Metres, Samples, Seconds
from monochord.live.filter import FilterSettings
from monochord.live.health import HealthSettings
from monochord.live.sinks import SINKS
from monochord.live.sinks.base import Sink
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.estimators.base import Estimator

T = TypeVar("T")
MODEL = "model"
"""The estimator that runs a trained model."""
SOUND = "wav"
"""The source that reads a sound file of any format."""
RECORDINGS: Mapping[str, str] = {
    ".wav": SOUND,
    ".flac": SOUND,
    ".mp3": SOUND,
    ".ogg": SOUND,
    ".mcap": "session",
}
"""The source that reads a recording, by file suffix; a file of any other is taken for sound."""
MIN_WINDOW: Seconds = 0.01  # holds a period of 100 Hz
MIN_HOP: Seconds = 0.001  # 16 frames at the lowest rate of a source
MAX_WINDOW: Seconds = 60.0
WindowLength: TypeAlias = Annotated[Seconds, Meta(ge=MIN_WINDOW, le=MAX_WINDOW)]
Hop: TypeAlias = Annotated[Seconds, Meta(ge=MIN_HOP, le=MAX_WINDOW)]
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
"""Pattern of a string's name, which appears in ROS 2 topics and file names."""


def recording_source(path: str | Path) -> str | None:
    """Return the name of the source that reads a recording, None for an unknown suffix.

    >>> recording_source("take.WAV"), recording_source("take.mcap"), recording_source("system:capture_1")
    ('wav', 'session', None)
    """
    usual = SOUND if Path(path).exists() else None
    return RECORDINGS.get(Path(path).suffix.lower(), usual)


def recording(path: str | Path) -> Tree:
    """Return the table of the source that reads a recording, for `LiveRun.read`.

    >>> recording("take.mcap")
    {'name': 'session', 'path': 'take.mcap'}
    """
    return {"name": recording_source(path) or SOUND, "path": str(path)}


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowSettings(Checked):
    """Window length and hop.

    >>> WindowSettings(length=0.1, hop=0.01).frames(44100)
    (4410, 441)
    """

    length: WindowLength = 0.1
    hop: Hop = 0.01

    def frames(self, sample_rate: int) -> tuple[Samples, Samples]:
        """Return window length and hop in frames, rounded."""
        return round(self.length * sample_rate), round(self.hop * sample_rate)


@dataclass(frozen=True, slots=True, kw_only=True)
class StringSettings:
    """One of several strings on one source: its channels, counted from 1, and its sensor.

    Without `channels`, it has the two channels after the previous string's. `sensor` and `string` are as in
    `LiveRun`; the run's values apply where both are empty.
    """

    channels: tuple[int, ...] = ()
    sensor: str = ""
    string: str = ""


ONE_STRING: Mapping[str, StringSettings] = MappingProxyType({})


def channels_of(strings: Mapping[str, StringSettings]) -> dict[str, tuple[int, ...]]:
    """Return the channels of each string, counted from 1.

    Raises `InputError` for an invalid name, a string of more than two channels, or a channel of two strings.

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
        numbers = each.channels or (end + 1, end + 2)
        is_allowed = len(numbers) <= 2 and 1 <= min(numbers) <= max(numbers) <= MAX_CHANNELS
        if len(set(numbers)) != len(numbers) or not is_allowed:
            given = f"channels {', '.join(map(str, numbers))} of the string {name}"
            raise InputError(given, f"one or two different channels from 1 to {MAX_CHANNELS}")
        for channel in numbers:
            if channel in used:
                raise InputError(
                    f"channel {channel} of the strings {used[channel]} and {name}",
                    "each channel in one string only",
                )
            used[channel] = name
        channels[name], end = numbers, max(numbers)
    return channels


DEFAULTS: Mapping[str, Any] = MappingProxyType(
    {"source": {"name": "jack"}, "estimator": {"name": "closed_form"}, "sinks": {"terminal": {}}}
)
"""Plug-in tables that a configuration may omit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveRun:
    """A live run: plug-in objects, the window, and when to end.

    `string` names the string preset for a source that provides no string; otherwise it is refused. `sensor`
    names a sensor, or the file of a tuned one: its string takes precedence over the source's. `strings` holds
    several strings by name, whose channels one source provides; without it, the source's one or two channels
    belong to one string. The run lasts `seconds` of the stream. `real_time` gives its threads real-time
    priority, as JACK's threads have. `filter` sets how estimates are tracked over time, `health` when a
    finding becomes a note; neither changes the estimates of single windows.
    """

    source: Source
    estimator: Estimator
    window: WindowSettings = WindowSettings()
    filter: FilterSettings = field(default_factory=FilterSettings)
    health: HealthSettings = field(default_factory=HealthSettings)
    sinks: tuple[Sink, ...] = ()
    string: str = ""
    sensor: str = ""
    strings: Mapping[str, StringSettings] = field(default_factory=lambda: ONE_STRING)
    seconds: Seconds = math.inf
    real_time: bool = False

    def __post_init__(self) -> None:
        if not self.seconds > 0.0:
            raise InputError(f"{self.seconds:g} seconds", "more than 0")

    @classmethod
    def read(cls, tree: Mapping[str, Any]) -> "LiveRun":
        """Build from plain values; unknown keys raise.

        `source` and `estimator` are tables with a plug-in's ``name`` and options; `sinks` holds options by
        sink name; `DEFAULTS` replace omitted tables. A source with a channels option gets as many channels as
        the strings need.

        Raises
        ------
        InputError
            For an unknown name or option, or an invalid value.
        """
        given = {**DEFAULTS, **tree}
        source, sinks = table(given, "source"), table(given, "sinks")
        built = {
            "source": _build(SOURCES, source),
            "estimator": _build(ESTIMATORS, table(given, "estimator")),
            "sinks": [SINKS.build(name, table(sinks, name), where=f"sinks.{name}") for name in sinks],
        }
        return from_tree(cls, {**given, **built}).with_channels()

    def with_channels(self) -> "LiveRun":
        """Return the run with as many channels of its source as the strings need, if it has that option."""
        needed = max((max(each) for each in channels_of(self.strings).values()), default=0)
        if needed <= getattr(self.source, "channels", needed):
            return self
        return replace(self, source=replace(cast("Any", self.source), channels=needed))

    def resolved(self) -> Tree:
        """Return every option with its value, defaults included, in the format of `read`.

        Raises
        ------
        InputError
            For a plug-in without a registered name.
        """
        source = {"name": SOURCES.name_of(self.source), **to_tree(self.source)}
        estimator = {"name": ESTIMATORS.name_of(self.estimator), **to_tree(self.estimator)}
        sinks = {SINKS.name_of(sink): to_tree(sink) for sink in self.sinks}
        plain = {each.name: getattr(self, each.name) for each in fields(self) if each.name not in DEFAULTS}
        return {**to_tree(plain), "source": source, "estimator": estimator, "sinks": sinks}


def refuse_string_twice(
    string: str | None, sensor: str | None, length: Metres | None, open_frequency: Any
) -> None:
    """Refuse a string preset together with a sensor, or with both numbers that replace it."""
    if string and sensor:
        given = f"--string {string} with --sensor {sensor}"
        raise InputError(given, "only one of them", "omit --string; a sensor has its own string")
    if string and length is not None and open_frequency is not None:
        given = f"--string {string} with --length and --open"
        raise InputError(given, "a preset, or both numbers", "leave one or the other out")


def put_estimator(
    tree: Tree,
    model: str | Path | None,
    *,
    estimator: str | None = None,
    length: Metres | None = None,
    open_frequency: Hertz | None = None,
    string: str | None = None,
    sensor: str | None = None,
    window: Seconds | None = None,
    hop: Seconds | None = None,
) -> None:
    """Put estimator, string and window into the tree of a run, for `LiveRun.read`; what is None is left out.

    `model` is a trained model's folder or name, in place of an estimator, and has its own length of window.
    The string's `length` in m and `open_frequency` in Hz are for an estimator that takes them. Raises
    `InputError` for a model that is named beside an estimator, or cannot be loaded.
    """
    if model is not None and estimator:
        raise InputError(f"model {model} with --estimator {estimator}", "only one of them")
    if model is not None:
        from monochord.perception.model import load  # noqa: PLC0415  (loads its kernels)

        definition = load(model).definition
        tree["estimator"] = {"name": MODEL, "path": str(model)}
        if "length" not in table(tree, "window"):
            put(tree, "window", length=definition.window / definition.sample_rate)
    put(tree, "estimator", length=length, open_frequency=open_frequency)
    put(
        tree,
        "estimator",
        name=estimator or table(tree, "estimator").get("name", DEFAULTS["estimator"]["name"]),
    )
    put(tree, "window", length=window, hop=hop)
    tree |= {name: preset for name, preset in (("string", string), ("sensor", sensor)) if preset is not None}


def put(tree: Tree, name: str, /, **values: Any) -> None:
    """Put values (those that are not None) into the table `name` of a tree."""
    given = {key: value for key, value in values.items() if value is not None}
    if given:
        tree[name] = {**table(tree, name), **given}


def _build(registry: Registry[T], given: Mapping[str, Any]) -> T:
    options = dict(given)
    name = options.pop("name", None)
    if not isinstance(name, str):
        remedy = f"write {registry.kind}.name"
        raise InputError(f"{registry.kind} without a name", ", ".join(registry.names()), remedy)
    return registry.build(name, options, where=registry.kind)
