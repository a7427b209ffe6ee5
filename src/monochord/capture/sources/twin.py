"""The twin in place of the sensor: a driven string, pressed and slid over, with the truth at hand."""

import math
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import soxr

from monochord.capture.sources._audio_file import open_audio
from monochord.capture.sources._labels import LabelMemory
from monochord.capture.sources._paced_stream import PacedStream
from monochord.capture.sources._visits import Visit, changes, wander
from monochord.capture.sources.base import Source
from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal, Truth
from monochord.core.units import Newtons, Samples, Seconds
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import TensionLaw
from monochord.physics.twin import Outside, Pluck, Scene, Sensor, Twin, advance, begin, retouch
from monochord.physics.twin.outside import outside_at
from monochord.physics.twin.variation import build, day

REMEMBERED: Seconds = 61.0
"""For how long labels are kept: a second more than the longest window."""
AHEAD: Samples = 2048
"""Frames that are made at once, if a block is not longer."""
STRIKE = 5e-4
"""Height of the first pluck, as a share of the length."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinSource(Source):
    """The virtual sensor in real time: `monochord.physics.twin`, simulated in every sample.

    Of the frames [a, b), `truth` tells whether they are for the most part touched (``contact``) and, where
    they are, the means of ``position`` in m, ``force`` in N and sliding speed ``slip_velocity`` in m/s, and
    its parts with their signs, ``slip_across`` and ``slip_along``; whether the touch slides for the most part
    (``slip``); and whether the sound had come to rest throughout (``settled``).

    Parameters
    ----------
    sensor
        A preset's name or a TOML file of your own.
    build
        Seed of another sensor of the same design, within its tolerances; left out, the design itself. The
        signal's string is the design's either way, which is all that a listener can know.
    day
        Seed of the same sensor on another day; left out, the day it was tuned.
    script
        Visits in the order of their starts, such as ``[{start = 1.0, position = 0.08, force = 0.5,
        seconds = 2.0, across = 0.01}]``; without ``seconds`` the touch stays. Empty: visits drawn at random.
    seed
        Of the random visits, of surfaces and of the converters' noise; equal seeds give equal sounds.
    hold
        Mean time in seconds that a random visit lasts.
    forces
        Least and greatest normal force of a random visit in N.
    places
        Where random visits fall, as shares of the sensing range.
    slips
        Share of the random visits that move while they press.
    materials
        What random visits are made of, and the first what a script's are; names or files.
    tension_law
        How force raises tension: "geometric", the stretch of the deflected string, or "linear".
    noise
        A wav or flac file that sounds in the room, round and round; none if empty.
    snr
        How far it stays below the untouched string's sound, in dB.
    speed
        Pace against real time: 1 gives each block when its last frame would have been heard, 0 as fast as the
        reader takes it.
    duration
        Length in seconds; 0 without end.
    block
        Frames a block, by default the usual hop, so that each completes a window; the last may be shorter.
    sample_rate
        In Hz.
    """

    sensor: str = "prototype"
    build: int | None = None
    day: int | None = None
    script: tuple[Visit, ...] = ()
    seed: int = 0
    hold: Seconds = 1.8
    forces: tuple[Newtons, Newtons] = (0.1, 2.0)
    places: tuple[float, float] = (0.0, 1.0)
    slips: float = 0.4
    materials: tuple[str, ...] = ("plastic", "wood", "metal_tube", "allen_key")
    tension_law: TensionLaw = "geometric"
    noise: str = ""
    snr: float = 20.0
    speed: float = 1.0
    duration: Seconds = 0.0
    block: Samples = 441
    sample_rate: int = 44100

    @contextmanager
    def open(self) -> Generator["_TwinStream"]:
        """Begin with the untouched, plucked string; raises `InputError` for an option that cannot be used."""
        design = load_sensor(self.sensor)
        self._refuse_impossible(design)
        sensor = design if self.build is None else build(design, self.build)
        sensor = sensor if self.day is None else day(sensor, self.day)
        stream = _TwinStream(self, design, sensor)
        try:
            yield stream
        finally:
            stream.release()

    def visits(self, design: Sensor) -> Iterable[Visit]:
        """Return the visits of a sensor of this design: the script, or those drawn."""
        low, high = design.range
        return self.script or wander(
            seed=self.seed,
            hold=self.hold,
            positions=(low + self.places[0] * (high - low), low + self.places[1] * (high - low)),
            forces=self.forces,
            slips=self.slips,
            materials=self.materials,
        )

    def room(self, sensor: Sensor) -> Outside | None:
        """Return what sounds in the room, at its ratio to this sensor's own sound."""
        if not self.noise:
            return None
        with open_audio(Path(self.noise), allow_truncated=False) as file:
            samples = file.read(dtype="float32", always_2d=True).mean(axis=1)
            samples = soxr.resample(samples, file.samplerate, self.sample_rate)
        return outside_at(samples.astype(np.float32), self.snr, sensor, sample_rate=self.sample_rate)

    def _refuse_impossible(self, design: Sensor) -> None:
        for name in ("speed", "duration"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise InputError(f"{name} {getattr(self, name):g}", "0 or more")
        if self.block < 1 or min(self.seed, self.build or 0, self.day or 0) < 0:
            raise InputError(
                f"block {self.block}, seed {self.seed}", "1 frame or more, and seeds of 0 or more"
            )
        if not 0.5 <= self.hold < math.inf:
            raise InputError(f"hold {self.hold:g} s", "0.5 s or more")
        self._refuse_impossible_draws()
        for visit in self.script:
            visit.refuse_impossible(design.string.length)
        for before, after in zip(self.script, self.script[1:], strict=False):
            if not before.end <= after.begin:
                given = f"a visit from {after.begin:.3g} s, before the last one is gone ({before.end:.3g} s)"
                raise InputError(given, "visits one after another", "give seconds")

    def _refuse_impossible_draws(self) -> None:
        low, high = self.forces
        if not 0.0 <= low <= high <= 10.0:
            raise InputError(f"forces {low:g} to {high:g} N", "0 to 10 N, the least first")
        low, high = self.places
        if not 0.0 <= low <= high <= 1.0:
            raise InputError(f"places {low:g} to {high:g}", "shares between 0 and 1, the least first")
        if not 0.0 <= self.slips <= 1.0:
            raise InputError(f"slips {self.slips:g}", "a share between 0 and 1")
        if not self.materials:
            raise InputError("no materials", "at least one")
        for material in self.materials:
            load_material(material)


class _TwinStream(PacedStream):
    def __init__(self, options: TwinSource, design: Sensor, sensor: Sensor) -> None:
        rate = options.sample_rate
        signal = Signal(sample_rate=rate, channels=2, string=design.string)
        end = round(options.duration * rate) if options.duration else math.inf
        super().__init__(signal, block=options.block, speed=options.speed, end=end)
        length = sensor.string.length
        scene = Scene(
            outside=options.room(sensor),
            pluck=Pluck(position=0.2 * length, height=STRIKE * length),
            tension_law=options.tension_law,
        )
        self._twin: Twin = begin(sensor, scene, sample_rate=rate, seed=options.seed)
        advance(self._twin, 1)  # compiles here, where nobody waits for a block
        self._labels = LabelMemory(round(REMEMBERED * rate))
        self._changes = changes(options.visits(design), options.materials[0], rate)
        self._change = next(self._changes, None)
        self._made: Audio = np.zeros((2, 0), dtype=np.float32)

    def truth(self, start: Samples, stop: Samples) -> Truth:
        """Return what is true over the frames [start, stop); see `TwinSource`."""
        return self._labels.over(start, stop)

    def _read(self, frames: Samples) -> Audio:
        """Return the next frames out of what was made ahead, which wakes the simulation less often."""
        while self._made.shape[1] < frames:
            self._made = np.concatenate([self._made, self._more(max(frames, AHEAD))], axis=1)
        given, self._made = self._made[:, :frames], self._made[:, frames:]
        return np.ascontiguousarray(given)

    def _more(self, frames: Samples) -> Audio:
        """Simulate on to the next coming or going of an object, or for some frames, and keep the labels."""
        while self._change is not None and self._change[0] <= self._twin.start:
            self._twin = retouch(self._twin, self._change[1])
            self._change = next(self._changes, None)
        if self._change is not None:
            frames = min(frames, self._change[0] - self._twin.start)
        take, self._twin = advance(self._twin, frames)
        self._labels.add(take.labels)
        return take.microphones
