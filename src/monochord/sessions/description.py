"""A session's description and its clock."""

import json
import math
import re
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields
from importlib.metadata import PackageNotFoundError, version
from platform import python_version
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from monochord.core.config import Tree, from_tree, to_tree
from monochord.core.errors import InputError
from monochord.core.identity import SensorIdentity
from monochord.core.notebook import lines
from monochord.core.ranges import Checked, Finite, checked
from monochord.core.types import Feed, Floats, StringParams
from monochord.core.units import Metres, Seconds
from monochord.sessions.bounds import MAX_COLUMNS, MAX_DURATION, MAX_SAMPLE_RATE, MAX_STREAMS, json_object

NANO = 1_000_000_000
LATEST_STAMP = 2**31 * NANO
"""The largest ROS 2 stamp, in ns since 1970."""
TUNING = "tuning"
"""Key in `more` of the sensor's measured tuning, where it was recorded tuned."""
ESTIMATES = "estimates"
"""Stream name of the estimates that a live run records beside its sound."""
SIMULATED_COMMENT = "Simulated by Monochord"
"""Comment in the sound file of an exported session whose sound is simulated."""
RESERVED_STREAMS = ("audio", "events", "clocks", "description")
"""Reserved names that a stream of readings cannot have."""


def versions() -> dict[str, str]:
    """Return the versions of the programs that write a session: Monochord, mcap, encoder, Python.

    >>> sorted(versions())
    ['mcap', 'monochord', 'numpy', 'python', 'rosbags']
    """
    installed = {"python": python_version()}
    for name in ("monochord", "mcap", "rosbags", "numpy"):
        try:
            installed[name] = version(name)
        except PackageNotFoundError:
            installed[name] = "unknown"
    return installed


@dataclass(frozen=True, slots=True, kw_only=True)
class Description(Checked):
    """Metadata of a session: its subject, and how it was recorded.

    Parameters
    ----------
    name
        Name of the session; not empty.
    sample_rate, channels
        Of the audio, in Hz and as a count.
    simulated
        Whether the twin rendered the sound.
    sensor, string
        The sensor as a table of plain values, and its string where known.
    object, material, radius
        The touching object, its material, and its radius at the contact in m.
    preamp_gains
        Gains in dB, one for each microphone, where known.
    day, build, seed
        For a simulated session: the day, the sensor build, and the random seed.
    plan
        The recording plan, as TOML text.
    notes
        The operator's notes.
    feeds
        The instruments beside the microphones.
    versions
        Versions of the programs that recorded the session.
    more
        Further values, as text.

    Examples
    --------
    >>> about = Description(name="take", sample_rate=44100, object="finger", notes="third string")
    >>> Description.load(about.dump()) == about
    True
    """

    name: str
    sample_rate: Annotated[int, Meta(ge=1, le=MAX_SAMPLE_RATE)]
    channels: Annotated[int, Meta(ge=1, le=64)] = 2
    simulated: bool = False
    sensor: Tree = field(default_factory=dict[str, Any])
    string: StringParams | None = None
    object: str = ""
    material: str = ""
    radius: Metres | None = None
    preamp_gains: tuple[Finite[float], ...] = ()
    day: int | None = None
    build: int | None = None
    seed: int | None = None
    plan: str = ""
    notes: str = ""
    feeds: tuple[Feed, ...] = ()
    versions: dict[str, str] = field(default_factory=versions)
    more: dict[str, str] = field(default_factory=dict[str, str])

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if not self.name:
            raise InputError("session without a name", "a name")
        _refuse_streams(len(self.feeds))
        feeds = [from_tree(Feed, to_tree(feed), "feed") for feed in self.feeds]  # as a file holds them
        for feed in feeds:
            if not re.fullmatch("[a-z][a-z0-9_]*", feed.stream) or feed.stream in RESERVED_STREAMS:
                allowed = f"lower-case letters, digits and underscores, and not {', '.join(RESERVED_STREAMS)}"
                raise InputError(f"stream '{feed.stream}'", allowed, "set its option stream")
            _refuse_feed(feed)
        streams = [feed.stream for feed in feeds]
        if len(set(streams)) < len(streams):
            twice = next(name for name in streams if streams.count(name) > 1)
            raise InputError(f"two streams called '{twice}'", "unique names", "set its option stream")

    def __repr__(self) -> str:
        return lines(
            f"Description: {self.name}{', simulated' if self.simulated else ''}",
            [
                ("audio", f"{self.channels} channels at {self.sample_rate:g} Hz"),
                ("sensor", str(self.sensor.get("name", ""))),
                ("touched by", self.material or self.object),
                ("streams", ", ".join(feed.stream for feed in self.feeds)),
            ],
        )

    @checked
    def feed(self, stream: str) -> Feed:
        """Return the feed of a stream; raises `InputError` for an unknown stream."""
        for feed in self.feeds:
            if feed.stream == stream:
                return feed
        there = ", ".join(feed.stream for feed in self.feeds) or "none"
        raise InputError(f"stream '{stream}' of session {self.name}", there)

    @property
    def identity(self) -> SensorIdentity:
        """The recorded sensor; fields that the session does not state are empty."""
        name, length = self.sensor.get("name"), None
        with suppress(InputError):
            length = json_object(self.more.get(TUNING, "{}")).get("length")
        known = isinstance(length, float) and 0.0 < length < math.inf
        return SensorIdentity(
            name=name if isinstance(name, str) else "",
            build=self.build if self.build is not None and self.build >= 0 else None,
            length=length if known else None,
        )

    def dump(self) -> str:
        """Return the description as JSON text with sorted keys, for `load`.

        Raises
        ------
        InputError
            If a value cannot be written as JSON.
        """
        try:
            return json.dumps(to_tree(self), sort_keys=True, ensure_ascii=False, default=_plain_scalar)
        except (TypeError, ValueError, RecursionError) as error:
            given = f"description of a session ({error})"
            raise InputError(given, "text, numbers, and lists and tables of them") from error

    @classmethod
    @checked
    def load(cls, text: str) -> "Description":
        """Read JSON text; fields added by a newer version go into `more`.

        Raises
        ------
        InputError
            If the text is not a JSON object, or holds an invalid field.
        """
        tree = json_object(text)
        feeds = tree.get("feeds")
        _refuse_streams(len(feeds) if isinstance(feeds, list) else 0)  # before each is looked at
        known = {field.name for field in fields(cls)}
        strange = {key: json.dumps(tree.pop(key)) for key in set(tree) - known}
        more = tree.get("more", {})
        if strange and isinstance(more, dict):
            tree["more"] = {**more, **strange}
        return from_tree(cls, tree, "session")


def _plain_scalar(value: Any) -> Any:
    """Return a NumPy scalar as a plain number."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a value of type {type(value).__name__}")


def _refuse_streams(count: int) -> None:
    if count > MAX_STREAMS:
        raise InputError(f"{count} streams", f"{MAX_STREAMS} at most")


def _refuse_feed(feed: Feed) -> None:
    """Raise `InputError` for a feed with ambiguous or too many columns."""
    what, count = f"stream '{feed.stream}'", len(feed.columns)
    if not 1 <= count <= MAX_COLUMNS or len(set(feed.columns)) < count:
        raise InputError(f"{what} with {count} columns", f"1 to {MAX_COLUMNS}, with unique names")
    if len(feed.units) != count:
        raise InputError(f"{what} with {len(feed.units)} units", f"{count}, one for each column")
    if not (0.0 <= feed.rate < math.inf and 0.0 <= feed.ticks < math.inf):
        given = f"{what} at {feed.rate:g} readings and {feed.ticks:g} ticks a second"
        raise InputError(given, "finite rates, 0 where unknown")


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionClock(Checked):
    """A session's clock: monotonic time, expressed in nanoseconds since 1970.

    `epoch_ns` is the wall clock at monotonic time `origin`, the session's time zero. Later steps of the wall
    clock have no effect. `InputError` refuses a clock beyond the range of a stamp, a time that is not finite,
    and a time further from the start than a session may last.

    >>> clock = SessionClock(epoch_ns=10**18, origin=5.0)
    >>> int(clock.stamp(5.25)), float(clock.seconds(10**18 + 250_000_000))
    (1000000000250000000, 0.25)
    """

    epoch_ns: Annotated[int, Meta(ge=0, lt=LATEST_STAMP)]
    origin: Annotated[Seconds, Meta(gt=-LATEST_STAMP / NANO, lt=LATEST_STAMP / NANO)] = 0.0

    @classmethod
    def now(cls) -> "SessionClock":
        """Return a clock that starts now."""
        return cls(epoch_ns=time.time_ns(), origin=time.monotonic())

    def stamp(self, monotonic: Seconds) -> int:
        """Return a monotonic time as a stamp in nanoseconds."""
        return int(self.stamps(np.array([monotonic]))[0])

    def stamps(self, monotonic: Floats) -> np.ndarray[Any, np.dtype[np.int64]]:
        """Return monotonic times (n,) as stamps (n,) in nanoseconds."""
        since = np.asarray(monotonic, np.float64) - self.origin
        wrong = np.flatnonzero(~(np.abs(since) <= MAX_DURATION))
        if len(wrong):
            given = f"time {since[wrong[0]]:g} s from the session's beginning"
            raise InputError(given, f"a number, at most {MAX_DURATION:g} s either way")
        stamps = self.epoch_ns + np.rint(since * NANO).astype(np.int64)
        if len(stamps) and not (stamps.min() >= 0 and stamps.max() < LATEST_STAMP):
            raise InputError(
                "time before 1970 or after 2038", "a time that a stamp can hold", "set the clock"
            )
        return stamps

    def seconds(self, stamp: Any) -> Any:
        """Return stamps in nanoseconds as seconds since the session's beginning."""
        return (np.asarray(stamp, dtype=np.int64) - self.epoch_ns) / NANO

    def dump(self) -> dict[str, str]:
        """Return the clock as text values by name."""
        return {"epoch_ns": str(int(self.epoch_ns)), "origin": repr(float(self.origin))}

    @classmethod
    def load(cls, texts: Mapping[str, str]) -> "SessionClock":
        """Read the values of `dump`; raises `InputError` for anything else."""
        try:
            return cls(epoch_ns=int(texts["epoch_ns"]), origin=float(texts["origin"]))
        except InputError:
            raise
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            allowed = "epoch_ns, a whole number as text, and origin, a number as text"
            raise InputError(f"clock of a session ({error})", allowed) from error
