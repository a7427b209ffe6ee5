"""What is needed to read a session again, and the clock that its times are on."""

import json
import math
import re
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from importlib.metadata import PackageNotFoundError, version
from platform import python_version
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from monochord.core.config import Tree, from_tree, to_tree
from monochord.core.errors import InputError
from monochord.core.ranges import Checked
from monochord.core.types import Feed, Floats, StringParams
from monochord.core.units import Metres, Seconds
from monochord.sessions.bounds import MAX_COLUMNS, MAX_DURATION, MAX_SAMPLE_RATE, MAX_STREAMS, json_object

NANO = 1_000_000_000
LATEST_STAMP = 2**31 * NANO
"""Where the seconds of a ROS 2 stamp end, in ns since 1970."""
TUNING = "tuning"
"""Name under `more` of what a sensor's tuning was measured to be, where it was recorded as tuned."""
ESTIMATES = "estimates"
"""Name of the stream of readings that a live run records beside its sound."""
RESERVED_STREAMS = ("audio", "events", "clocks", "description")
"""Names that streams of readings cannot have."""


def versions() -> dict[str, str]:
    """Return the versions of what makes a session: Monochord, its file library, its encoder, Python.

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
    """What a session was recorded with and of.

    Parameters
    ----------
    name
        What the session is called; not empty.
    sample_rate, channels
        Of the audio.
    simulated
        Whether the sound is the twin's.
    sensor, string
        The sensor as a table of plain values, and its string where that is known.
    object, material, radius
        What touches, what it is made of, and its radius in m where it touches.
    preamp_gains
        In dB, one a microphone, where known.
    day, build, seed
        Of a simulated session: which day of which sensor, and the seed of everything random.
    plan
        The plan that was carried out, as TOML text.
    notes
        Whatever the operator wants to say.
    feeds
        The instruments beside the microphones.
    versions
        Of the programs that recorded it.
    more
        Anything else, as text.

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
    preamp_gains: tuple[float, ...] = ()
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
        for feed in self.feeds:
            if not re.fullmatch("[a-z][a-z0-9_]*", feed.stream) or feed.stream in RESERVED_STREAMS:
                allowed = f"small letters, digits and underscores, and not {', '.join(RESERVED_STREAMS)}"
                raise InputError(f"stream '{feed.stream}'", allowed, "set its option stream")
            _refuse_feed(feed)
        streams = [feed.stream for feed in self.feeds]
        if len(set(streams)) < len(streams):
            twice = next(name for name in streams if streams.count(name) > 1)
            raise InputError(f"two streams called '{twice}'", "names of their own", "set its option stream")

    def feed(self, stream: str) -> Feed:
        """Return the feed of a stream; raises `InputError` where there is none."""
        for feed in self.feeds:
            if feed.stream == stream:
                return feed
        there = ", ".join(feed.stream for feed in self.feeds) or "none"
        raise InputError(f"stream '{stream}' of session {self.name}", there)

    def dump(self) -> str:
        """Return it as JSON text, keys sorted, which `load` reads again."""
        return json.dumps(to_tree(self), sort_keys=True, ensure_ascii=False)

    @classmethod
    def load(cls, text: str) -> "Description":
        """Read JSON text; what a newer version added is put under `more`.

        Raises
        ------
        InputError
            If it is no JSON object, or holds what no description does.
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


def _refuse_streams(count: int) -> None:
    if count > MAX_STREAMS:
        raise InputError(f"{count} streams", f"{MAX_STREAMS} at most")


def _refuse_feed(feed: Feed) -> None:
    """Refuse a feed whose columns are ambiguous, or too many for a table."""
    what, count = f"stream '{feed.stream}'", len(feed.columns)
    if not 1 <= count <= MAX_COLUMNS or len(set(feed.columns)) < count:
        raise InputError(f"{what} with {count} columns", f"1 to {MAX_COLUMNS}, each with a name of its own")
    if len(feed.units) != count:
        raise InputError(f"{what} with {len(feed.units)} units", f"{count}, one for each column")
    if not (0.0 <= feed.rate < math.inf and 0.0 <= feed.ticks < math.inf):
        given = f"{what} at {feed.rate:g} readings and {feed.ticks:g} ticks a second"
        raise InputError(given, "finite rates, 0 where unknown")


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionClock(Checked):
    """A session's clock: nanoseconds since 1970 that go with the monotonic clock, whatever the wall does.

    `epoch_ns` is what the wall clock said when the monotonic clock said `origin`, the session's time zero.
    A clock beyond what a stamp holds is refused with `InputError`, and so is a time that is not finite, or
    further from the start than a session may be long.

    >>> clock = SessionClock(epoch_ns=10**18, origin=5.0)
    >>> int(clock.stamp(5.25)), float(clock.seconds(10**18 + 250_000_000))
    (1000000000250000000, 0.25)
    """

    epoch_ns: Annotated[int, Meta(ge=0, lt=LATEST_STAMP)]
    origin: Annotated[Seconds, Meta(gt=-LATEST_STAMP / NANO, lt=LATEST_STAMP / NANO)] = 0.0

    @classmethod
    def now(cls) -> "SessionClock":
        """Return a clock whose zero is now."""
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
        """Return it as text by name."""
        return {"epoch_ns": str(self.epoch_ns), "origin": repr(self.origin)}

    @classmethod
    def load(cls, texts: Mapping[str, str]) -> "SessionClock":
        """Read what `dump` gave; raises `InputError` where it is something else."""
        try:
            return cls(epoch_ns=int(texts["epoch_ns"]), origin=float(texts["origin"]))
        except InputError:
            raise
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            allowed = "epoch_ns, a whole number as text, and origin, a number as text"
            raise InputError(f"clock of a session ({error})", allowed) from error
