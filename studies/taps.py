"""A string tapped at both ends of a session whose streams have known delays, and the figure of its taps.

Makes `docs/figures/taps.png` in some seconds: ``python -m studies.taps --out docs/figures/taps.png``. Tests
of the alignment have their sessions from here, too. `monochord figure taps` draws a recorded session.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from studies._command import draw

from monochord.core.types import POSE, WRENCH, Audio, Block, Feed, Floats, Readings
from monochord.core.units import Metres, MetresPerSecond, Newtons, Samples, Seconds
from monochord.figures import FIGURES
from monochord.figures.base import Figure
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.twin import Key, Scene, Touch, advance, begin
from monochord.sessions import Description, SessionClock, SessionWriter

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

RATE = 44100
TURN: Seconds = 0.003
"""Time from the touch to the turning point of a tap, in s."""
AIR: Metres = 3e-3
SPEED: MetresPerSecond = 0.2
NONE: Mapping[str, tuple[Seconds, Seconds]] = MappingProxyType({})
LATE = {"audio": (0.021, 0.0215), "pose": (0.048, 0.046)}
"""Delays of the figure's streams, at the start and at the end, in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DelayedTaps(Figure):
    """Sound, force and height around a tap of a simulated session, as stamped and as corrected.

    Parameters
    ----------
    seed
        Random seed of the taps and of the readings' noise.
    """

    seed: int = 0

    def draw(self) -> Canvas:
        """Simulate the session, align it, and draw its streams."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "taps.mcap")
            replace(tapped(seed=self.seed), late=LATE).write(path)
            return FIGURES.build("taps", {"session": str(path)}).draw()


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


if __name__ == "__main__":
    draw(DelayedTaps)
