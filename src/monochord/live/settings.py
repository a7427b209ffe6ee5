"""What a person configures of a live run, and the session that is built from it."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Source
from monochord.core.config import Tree, from_tree, to_tree
from monochord.core.errors import InputError
from monochord.core.registry import Registry
from monochord.core.units import Samples, Seconds
from monochord.live.sinks import SINKS
from monochord.live.sinks.base import Sink
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.estimators.base import Estimator

T = TypeVar("T")
SHORTEST: Seconds = 0.01  # holds a period of 100 Hz
CLOSEST: Seconds = 0.001  # at the least rate of a source 16 frames
LONGEST: Seconds = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class WindowSettings:
    """Length of a window and distance of window starts.

    >>> WindowSettings(length=0.1, hop=0.01).frames(44100)
    (4410, 441)
    """

    length: Seconds = 0.1
    hop: Seconds = 0.01

    def __post_init__(self) -> None:
        for name, span, least in (("length", self.length, SHORTEST), ("hop", self.hop, CLOSEST)):
            if not least <= span <= LONGEST:
                raise InputError(f"window {name} {span:g} s", f"{least:g} to {LONGEST:g} s")

    def frames(self, sample_rate: int) -> tuple[Samples, Samples]:
        """Return window length and hop in frames, to the nearest frame."""
        return round(self.length * sample_rate), round(self.hop * sample_rate)


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """A live run, ready to start: built plug-ins, the window, and when to end.

    `string` names the preset that a source without knowledge of its string is taken to have, and is refused
    by another; `seconds` of the stream are looked at.
    """

    source: Source
    estimator: Estimator
    sinks: tuple[Sink, ...] = ()
    window: WindowSettings = WindowSettings()
    string: str = ""
    seconds: Seconds = math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """A live run as configured: each plug-in as a table with its name and its options.

    `source` and `estimator` hold ``name`` and options; `sinks` holds options by sink name.
    """

    source: dict[str, Any] = field(default_factory=lambda: {"name": "jack"})
    estimator: dict[str, Any] = field(default_factory=lambda: {"name": "closed_form"})
    window: WindowSettings = WindowSettings()
    sinks: dict[str, dict[str, Any]] = field(default_factory=lambda: {"terminal": {}})
    string: str = ""
    seconds: Seconds = math.inf

    @classmethod
    def read(cls, tree: Mapping[str, Any]) -> "Settings":
        """Build from plain values, strictly."""
        return from_tree(cls, tree)

    def __post_init__(self) -> None:
        if not self.seconds > 0.0:
            raise InputError(f"{self.seconds:g} seconds", "more than 0")

    def session(self) -> Session:
        """Build every plug-in; raises `InputError` for an unknown name or option."""
        estimator = _build(ESTIMATORS, self.estimator)
        return Session(
            source=_build(SOURCES, self.source),
            estimator=estimator,
            sinks=tuple(self._sink(name, options, estimator) for name, options in self.sinks.items()),
            window=self.window,
            string=self.string,
            seconds=self.seconds,
        )

    def resolved(self) -> Tree:
        """Return every option with its value, defaults too: what is saved beside a result."""
        session = self.session()
        sinks = zip(self.sinks, session.sinks, strict=True)
        return {
            "source": _named(self.source, session.source),
            "estimator": _named(self.estimator, session.estimator),
            "window": to_tree(self.window),
            "sinks": {name.replace("-", "_"): to_tree(sink) for name, sink in sinks},
            "string": self.string,
            "seconds": self.seconds,
        }

    @staticmethod
    def _sink(name: str, options: Mapping[str, Any], estimator: Estimator) -> Sink:
        """Build a sink; one that draws to scale takes the estimator's string length unless it has its own."""
        known = {f.name for f in dataclasses.fields(SINKS.load(name))}  # pyright: ignore[reportArgumentType]
        length = getattr(estimator, "length", None)
        if "length" in known and length and "length" not in options:
            options = {**options, "length": length}
        return SINKS.build(name, options)


def _build(registry: Registry[T], table: Mapping[str, Any]) -> T:
    options = dict(table)
    name = options.pop("name", None)
    if not isinstance(name, str):
        given = f"{registry.kind} without a name"
        raise InputError(given, ", ".join(registry.names()), f"write {registry.kind}.name")
    return registry.build(name, options)


def _named(table: Mapping[str, Any], built: object) -> Tree:
    return {"name": str(table["name"]).replace("-", "_"), **to_tree(built)}
