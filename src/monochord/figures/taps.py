"""Taps in a session's streams, before and after alignment."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.ranges import Whole
from monochord.core.types import POSE, WRENCH, Audio, Block, Feed, Floats, Readings
from monochord.core.units import Metres, MetresPerSecond, Newtons, Samples, Seconds
from monochord.figures import _style
from monochord.figures.base import Measured
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.twin import Key, Scene, Touch, advance, begin
from monochord.sessions import Description, SessionClock, SessionReader, SessionWriter, read_session
from monochord.sessions.alignment import AUDIO, Alignment, align, reading_times

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

RATE = 44100
TURN: Seconds = 0.003
"""Time from the touch to the turning point of a tap, in s."""
AIR: Metres = 3e-3
SPEED: MetresPerSecond = 0.2
NONE: Mapping[str, tuple[Seconds, Seconds]] = MappingProxyType({})
SHOWN = {"audio": ("microphone 1", 1.0), "fz": ("force (N)", 1.0), "z": ("height (mm)", 1e3)}
"""Axis label of each row, and the factor from SI to its unit."""
LATE = {"audio": (0.021, 0.0215), "pose": (0.048, 0.046)}
"""Delays of the simulated session's streams, at the start and at the end, in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Taps(Measured):
    """Draw sound, force and height around the taps of `session`, as stamped and as corrected.

    `session` is a file; without one, a small simulated session is used, whose streams have known delays.
    `end` shows the taps at the end instead of those at the start. `tap` is the tap's index, and `before` and
    `after` are the seconds shown around it.
    """

    session: str = ""
    end: bool = False
    tap: Whole = 0
    before: Annotated[Seconds, Meta(gt=0.0, le=10.0)] = 0.05
    after: Annotated[Seconds, Meta(gt=0.0, le=10.0)] = 0.1

    def draw(self) -> Canvas:
        """Align the session and draw its streams."""
        session, alignment = self._aligned()
        rows = _rows(session)
        centre = self._centre(alignment)
        page = _style.canvas(30.0 + 28.0 * len(rows))
        panels = page.subplots(len(rows), 2, sharex=True, sharey="row", squeeze=False)
        for line, (stream, column) in zip(panels, rows, strict=True):
            late = alignment.lateness.get(stream)
            for corrected, axes in enumerate(line):
                _draw_row(axes, self._cut(session, alignment, stream, column, centre, bool(corrected)))
                name, _ = SHOWN[column]
                _style.dress(axes, "", "", "", "" if corrected else name)
            if late is not None:
                offset = late.offsets[-1 if self.end else 0]
                label = f"{1e3 * offset.value:+.2f} ± {1e3 * offset.std:.2f} ms"
                line[0].text(1.0, 1.01, label, transform=line[0].transAxes, ha="right", va="bottom",
                             fontsize=_style.TICK, color=_style.INK)  # fmt: skip
        kind = "simulated, " if session.description.simulated else ""
        for axes, title in zip(panels[0], ("as stamped", "after alignment"), strict=True):
            axes.set_title(f"{kind}{title}", fontsize=_style.LABEL, color=_style.INK, pad=4)
        for axes in panels[-1]:
            axes.set_xlabel("time from the tap (ms)", fontsize=_style.LABEL, color=_style.INK)
            axes.set_xlim(-1e3 * self.before, 1e3 * self.after)
        page.align_ylabels(list(panels[:, 0]))
        return page

    def numbers(self) -> dict[str, Any]:
        """Return each stream's offset, uncertainty and taps at both ends, its drift, and the flags."""
        _, alignment = self._aligned()
        numbers: dict[str, Any] = {"reference": alignment.reference, "flags": list(alignment.flags)}
        for stream, late in alignment.lateness.items():
            numbers[stream] = {
                "offsets": [_finite(offset.value) for offset in late.offsets],
                "stds": [_finite(offset.std) for offset in late.offsets],
                "taps": [offset.taps for offset in late.offsets],
                "drift": _finite(late.drift),
                "ppm": _finite(late.ppm),
            }
        return numbers

    def _aligned(self) -> tuple[SessionReader, Alignment]:
        if self.session:
            session = read_session(Path(self.session))
            return session, align(session)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "taps.mcap")
            replace(tapped(), late=LATE).write(path)
            session = read_session(path)
            return session, align(session)

    def _centre(self, alignment: Alignment) -> Seconds:
        """Return the time of the chosen tap, on the reference's clock."""
        if not alignment.taps:
            raise InputError(f"session {self.session} ({'; '.join(alignment.flags)})", "a session with taps")
        group = alignment.taps[-1 if self.end else 0]
        if self.tap >= group.size:
            raise InputError(f"tap {self.tap}", f"0 to {group.size - 1}")
        return float(group[self.tap])

    def _cut(
        self,
        session: SessionReader,
        alignment: Alignment,
        stream: str,
        column: str,
        centre: Seconds,
        corrected: bool,  # noqa: FBT001
    ) -> tuple[Floats, Floats]:
        """Return times in ms from the tap and the stream's values."""
        if column == AUDIO:
            track = session.audio
            time: Floats = track.time(np.arange(track.samples.shape[1]))
            values = track.samples[0].astype(np.float64)
        else:
            readings = session.readings(stream)
            time, values = reading_times(readings).time, readings.column(column)
        time = (alignment.correct(stream, time) if corrected else time) - centre
        shown = np.flatnonzero((time > -self.before) & (time < self.after))
        return 1e3 * time[shown], SHOWN[column][1] * values[shown]


def _rows(session: SessionReader) -> list[tuple[str, str]]:
    """Return the streams and columns to show."""
    feeds = session.description.feeds
    rows = [(feed.stream, column) for column in ("fz", "z") for feed in feeds if column in feed.columns]
    return [(AUDIO, AUDIO), *rows]


def _draw_row(axes: Axes, cut: tuple[Floats, Floats]) -> None:
    time, values = cut
    axes.axvline(0.0, color=_style.PALE, lw=0.8)
    few = time.size < 100
    axes.plot(time, values, color=_style.SEGMENTS[0], lw=0.8, marker="." if few else "", ms=3.0)


def _finite(value: float) -> float | None:
    """Return a finite number for JSON, else None."""
    return value if np.isfinite(value) else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Tapped:
    """A tapped string with truth: sound (2, n), contact force (n,) in N, and the contacts' onsets.

    `late` is the delay of the streams audio, wrench and pose at the start and at the end, in s; `rates` are
    those of wrench and pose in readings per second.
    """

    microphones: Audio
    force: Floats
    touches: Floats
    late: Mapping[str, tuple[Seconds, Seconds]] = field(default_factory=lambda: NONE)
    rates: tuple[float, float] = (7000.0, 250.0)
    jitter: Seconds = 3e-4
    noise: Newtons = 0.01
    seed: int = 0

    @property
    def seconds(self) -> Seconds:
        """Duration in s."""
        return self.force.size / RATE

    def stamps(self, stream: str, time: Floats) -> Floats:
        """Return a stream's time stamps at true times."""
        first, last = self.late.get(stream, (0.0, 0.0))
        return time + first + (last - first) * time / self.seconds

    def height(self, time: Floats) -> Floats:
        """Return the tool's height above the string at rest, in m."""
        turn = np.abs(time[:, None] - (self.touches + TURN)).min(axis=1, initial=np.inf)
        return np.minimum(SPEED * np.maximum(turn - TURN, 0.0), AIR) - 4e-4 * np.maximum(
            1.0 - turn / TURN, 0.0
        )

    def write(self, path: Path) -> None:
        """Write the session."""
        description = Description(
            name="taps",
            sample_rate=RATE,
            simulated=True,
            string=load_sensor("prototype").string,
            seed=self.seed,
            feeds=(
                Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3,
                     rate=self.rates[0], ticks=self.rates[0]),
                Feed(stream="pose", columns=POSE, units=("m",) * 3 + ("",) * 4,
                     rate=self.rates[1]),
            ),
        )  # fmt: skip
        clock = SessionClock(epoch_ns=1_800_000_000_000_000_000, origin=100.0)
        rng = np.random.default_rng(self.seed)
        with SessionWriter(path, description, clock) as writer:
            for start in range(0, self.force.size, 4410):
                at = float(self.stamps("audio", np.array([start / RATE]))[0])
                samples = self.microphones[:, start : start + 4410]
                writer.audio(Block(samples=samples, start=start, adc_time=clock.origin + at))
            sources = (("wrench", self.rates[0], self._wrench), ("pose", self.rates[1], self._pose))
            for stream, rate, values in sources:
                time = np.arange(rng.random() / rate, self.seconds, 1.0 / rate)
                received = np.flatnonzero(rng.random(time.size) > 0.002)
                time = time[received]
                arrival = self.stamps(stream, time) + rng.exponential(self.jitter, time.size)
                writer.readings(
                    Readings(
                        stream=stream,
                        time=clock.origin + np.maximum.accumulate(arrival),
                        values=values(time, rng),
                        sequence=received,
                        device_time=received if stream == "wrench" else np.full(time.size, -1),
                        status=np.zeros(time.size, np.uint32),
                    )
                )

    def _wrench(self, time: Floats, rng: np.random.Generator) -> Floats:
        values = self.noise * rng.standard_normal((time.size, 6))
        values[:, 2] += np.interp(time, np.arange(self.force.size) / RATE, self.force)
        return values

    def _pose(self, time: Floats, rng: np.random.Generator) -> Floats:
        values = np.zeros((time.size, 7))
        values[:, 2] = self.height(time) + 2e-5 * rng.standard_normal(time.size)
        values[:, 6] = 1.0
        return values


def tapped(
    *,
    groups: tuple[Seconds, ...] = (1.5, 8.0),
    taps: int = 5,
    seconds: Seconds = 12.0,
    force: Newtons = 1.0,
    position: Metres = 0.08,
    drivers: tuple[bool, bool] = (False, False),
    seed: int = 0,
) -> Tapped:
    """Return a string tapped `taps` times, unevenly, from each time in `groups`."""
    rng = np.random.default_rng(seed)
    steps = [np.concatenate([[rng.random() * 0.01], rng.uniform(0.25, 0.55, taps - 1)]) for _ in groups]
    each = [first + np.cumsum(step) for first, step in zip(groups, steps, strict=True)]
    touches = np.concatenate([np.zeros(0), *each])
    fall = AIR / SPEED
    keys = [Key(time=0.0, position=position, clearance=AIR)]
    for at in touches.tolist():
        keys += [
            Key(time=at - fall, position=position, clearance=AIR),
            Key(time=at, position=position),
            Key(time=at + TURN, position=position, force=force),
            Key(time=at + 2.0 * TURN, position=position),
            Key(time=at + 2.0 * TURN + fall, position=position, clearance=AIR),
        ]
    touch = Touch(material=load_material("plastic"), motion=tuple(keys))
    twin = begin(load_sensor("prototype"), Scene(touches=(touch,), drivers=drivers), seed=seed)
    frames: Samples = round(seconds * RATE)
    take, _ = advance(twin, frames)
    force_at = take.labels.reaction[0].astype(np.float64)
    return Tapped(microphones=take.microphones, force=force_at, touches=touches, seed=seed)
