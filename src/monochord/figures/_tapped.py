"""A small simulated session with taps at both ends, whose streams are late by known times."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np

from monochord.core.types import POSE, WRENCH, Audio, Block, Feed, Floats, Readings
from monochord.core.units import Metres, MetresPerSecond, Newtons, Samples, Seconds
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.twin import Key, Scene, Touch, advance, begin
from monochord.sessions import Description, SessionClock, SessionWriter

RATE = 44100
TURN: Seconds = 0.003
"""From the touch to the turn of a tap."""
AIR: Metres = 3e-3
SPEED: MetresPerSecond = 0.2
NONE: Mapping[str, tuple[Seconds, Seconds]] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class Tapped:
    """The truth of a tapped string: sound (2, n), force of the touch (n,) in N, and when contacts began.

    `late` tells how late each of the streams audio, wrench and pose is at the begin and at the end, in s;
    `rates` are those of wrench and pose in readings a second.
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
        """How long it lasts."""
        return self.force.size / RATE

    def stamps(self, stream: str, time: Floats) -> Floats:
        """Return what a stream's clock says at true times."""
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
                kept = np.flatnonzero(rng.random(time.size) > 0.002)
                time = time[kept]
                arrival = self.stamps(stream, time) + rng.exponential(self.jitter, time.size)
                writer.readings(
                    Readings(
                        stream=stream,
                        time=clock.origin + np.maximum.accumulate(arrival),
                        values=values(time, rng),
                        sequence=kept,
                        device_time=kept if stream == "wrench" else np.full(time.size, -1),
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
    """Return a string that is tapped `taps` times from each of the times in `groups` on, unevenly."""
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
