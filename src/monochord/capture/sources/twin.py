"""The twin as an audio source: a driven string, pressed and slid over, with true labels."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
import soxr
from msgspec import Meta

from monochord.capture.sources._added_noise import AddedNoise
from monochord.capture.sources._audio_file import open_audio
from monochord.capture.sources._hand import HandledObject, TouchRequests
from monochord.capture.sources._labels import LabelMemory
from monochord.capture.sources._paced_stream import PacedStream
from monochord.capture.sources._script import ScriptedTouch, draw_touches, twin_changes
from monochord.capture.sources.base import Controls, Source
from monochord.core.errors import InputError
from monochord.core.identity import SensorIdentity
from monochord.core.ranges import Count, NonNegative, Pair, Share, Whole, refuse_unordered
from monochord.core.types import Audio, Floats, Signal, Truth
from monochord.core.units import FINITE, Newtons, Samples, Seconds
from monochord.physics.materials import load_material, material_names
from monochord.physics.sensors import load_sensor, with_sensor
from monochord.physics.theory import TensionLaw
from monochord.physics.twin import Labels, Outside, Pluck, Scene, Sensor, Touch, Twin, advance, begin, retouch
from monochord.physics.twin.ends import NEAREST
from monochord.physics.twin.outside import outside_at
from monochord.physics.twin.world import World, plausible_touch, sensor_of

LABELS = ("contact", "position", "force", "slip", "slip_across", "slip_along", "settled")
CHUNK: Samples = 2048
"""Frames simulated at once, unless a block is longer."""
PLUCK_HEIGHT = 5e-4
"""Height of the first pluck, as a share of the length."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TwinSource(Source):
    """The virtual sensor in real time: `monochord.physics.twin`, simulated in every sample.

    Its `truth` of a window follows the labelling rules of datasets (`monochord.core.labels`): ``contact`` and
    ``slip``, 0 or 1, left out where uncertain; ``transition``; during contact, the means of ``position`` in
    m, ``force`` in N (with ``force_std``), sliding speed ``slip_velocity`` in m/s and its signed parts
    ``slip_across`` and ``slip_along``; and ``settled``, the share of the window in which the sound is steady.

    Parameters
    ----------
    sensor
        A preset's name or a TOML file.
    build
        Seed of a sensor built to the same design within its tolerances; by default the nominal design. The
        signal's string is the nominal design either way, since an estimator knows nothing else.
    day
        Seed of the same sensor's drift on another day; by default the day it was tuned.
    world
        "ideal", or "plausible": what a real build brings besides, such as ends and objects that give way,
        other contact laws, a wrong tuning, distortion and hum, drawn by `build` (0 if there is none), `day`
        and `seed`.
    script
        Touches in order of start time, such as ``[{start = 1.0, position = 0.08, force = 0.5, seconds = 2.0,
        across = 0.01}]``; without ``seconds`` the touch stays. Empty: touches drawn at random.
    seed
        Random seed of touches, surfaces and converter noise; equal seeds give equal sounds.
    hold
        Mean duration of a random touch, in seconds.
    forces
        Range of a random touch's normal force, in N.
    places
        Range of random touch positions, as shares of the sensing range.
    slips
        Share of the random touches that move while they press.
    materials
        Materials of random touches (names or files); the first is a script's default.
    tension_law
        How force raises tension: "geometric", the stretch of the deflected string, or "linear".
    noise
        A sound file with ambient noise, repeated without end; none if empty.
    snr
        Ratio of the untouched string's sound to that noise, in dB.
    speed
        Playback speed: 1 is real time, 0 as fast as the reader accepts it.
    duration
        Length in seconds; 0 without end.
    block
        Frames per block, by default the usual hop, so that each block completes a window; the last may be
        shorter.
    sample_rate
        In Hz.
    """

    sensor: str = "prototype"
    build: Whole | None = None
    day: Whole | None = None
    world: World = "ideal"
    script: tuple[ScriptedTouch, ...] = ()
    seed: Whole = 0
    hold: Annotated[Seconds, Meta(ge=0.5, le=FINITE)] = 1.8
    forces: Pair[Annotated[Newtons, Meta(ge=0.0, le=10.0)]] = (0.1, 2.0)
    places: Pair[Share] = (0.0, 1.0)
    slips: Share = 0.4
    materials: tuple[str, ...] = ("plastic", "wood", "metal_tube", "allen_key")
    tension_law: TensionLaw = "geometric"
    noise: str = ""
    snr: float = 20.0
    speed: NonNegative[float] = 1.0
    duration: NonNegative[Seconds] = 0.0
    block: Count = 441
    sample_rate: int = 44100

    def open(self) -> "_TwinStream":
        """Open with the untouched, plucked string; raises `InputError` for an invalid option."""
        design = load_sensor(self.sensor)
        self._refuse_impossible(design)
        sensor = sensor_of(design, self.world, build=self.build, day=self.day)
        return _TwinStream(self, design, sensor)

    def touches(self, design: Sensor) -> Iterable[ScriptedTouch]:
        """Return the touches of a sensor of this design: scripted or random."""
        low, high = design.range
        return self.script or draw_touches(
            seed=self.seed,
            hold=self.hold,
            positions=(low + self.places[0] * (high - low), low + self.places[1] * (high - low)),
            forces=self.forces,
            slips=self.slips,
            materials=self.materials,
        )

    def ambient_noise(self, sensor: Sensor) -> Outside | None:
        """Return the ambient noise, scaled to its ratio to the sensor's sound."""
        if not self.noise:
            return None
        with open_audio(Path(self.noise), allow_truncated=False) as file:
            samples = file.read(dtype="float32", always_2d=True).mean(axis=1)
            samples = soxr.resample(samples, file.samplerate, self.sample_rate)
        return outside_at(samples.astype(np.float32), self.snr, sensor, sample_rate=self.sample_rate)

    def _refuse_impossible(self, design: Sensor) -> None:
        refuse_unordered("touches", forces=self.forces, places=self.places)
        if not self.materials:
            raise InputError("no materials", "at least one")
        for material in self.materials:
            load_material(material)
        for touch in self.script:
            touch.refuse_impossible(design.string.length)
        for before, after in zip(self.script, self.script[1:], strict=False):
            if not before.end <= after.begin:
                given = f"a touch from {after.begin:.3g} s, before the previous one ends ({before.end:.3g} s)"
                raise InputError(given, "touches one after another", "set seconds")


class _TwinStream(PacedStream):
    def __init__(self, options: TwinSource, design: Sensor, sensor: Sensor) -> None:
        rate = options.sample_rate
        identity = SensorIdentity(build=options.build)
        signal = with_sensor(Signal(sample_rate=rate, channels=2, sensor=identity), design)
        end = round(options.duration * rate) if options.duration else math.inf
        super().__init__(signal, block=options.block, speed=options.speed, end=end)
        length = sensor.string.length
        scene = Scene(
            outside=options.ambient_noise(sensor),
            pluck=Pluck(position=0.2 * length, height=PLUCK_HEIGHT * length),
            tension_law=options.tension_law,
        )
        self._twin: Twin = begin(sensor, scene, sample_rate=rate, seed=options.seed)
        advance(self._twin, 1)  # compiles here, where nobody waits for a block
        self._labels = LabelMemory(LABELS, rate)
        self._changes = twin_changes(options.touches(design), sensor.string, options.materials[0], rate)
        self._changes = _with_effects(self._changes, options.seed, options.world)
        self._change = next(self._changes, None)
        self._ahead: Audio = np.zeros((2, 0), dtype=np.float32)
        edge = NEAREST * length
        others = [name for name in material_names() if name not in options.materials]
        self._requests = TouchRequests((edge, length - edge), (*options.materials, *others))
        self._object = HandledObject(self._requests, sensor, options.seed, options.world)
        self._by_hand = False
        self._built, self._retuned = sensor, 0.0
        self._noise = AddedNoise(rate, options.seed)

    def truth(self, start: Samples, stop: Samples) -> Truth:
        """Return the labels of the frames [start, stop); see `TwinSource`."""
        return self._labels.over(start, stop)

    @property
    def controls(self) -> Controls | None:
        """Controls of the string, at a finite speed."""
        return self._requests if self.paced else None

    def _read(self, frames: Samples) -> Audio:
        """Return the next frames, simulated ahead in chunks to save calls.

        With a hand on the string, each block is simulated separately.
        """
        while self._ahead.shape[1] < frames:
            chunk = frames if self._requests.manual else max(frames, CHUNK)
            self._ahead = np.concatenate([self._ahead, self._simulate(chunk)], axis=1)
        samples, self._ahead = self._ahead[:, :frames], self._ahead[:, frames:]
        return np.ascontiguousarray(samples)

    def _simulate(self, frames: Samples) -> Audio:
        """Simulate `frames`, or up to an object's arrival or departure, and store the labels."""
        if self._requests.retuning != self._retuned:
            self._retune()
        if self._requests.manual != self._by_hand:
            self._hand_over()
        if self._by_hand:
            touches = self._object.touches(self._twin.start / self._signal.sample_rate)
            if touches is not None:
                self._twin = retouch(self._twin, touches)
            return self._advance(frames)
        while self._change is not None and self._change[0] <= self._twin.start:
            self._twin = retouch(self._twin, self._change[1])
            self._change = next(self._changes, None)
        if self._change is not None:
            frames = min(frames, self._change[0] - self._twin.start)
        return self._advance(frames)

    def _advance(self, frames: Samples) -> Audio:
        start = self._twin.start
        take, self._twin = advance(self._twin, frames)
        self._labels.add(label_columns(take.labels), frames)
        noise = self._requests.noise
        return take.microphones if noise is None else self._noise.added(take.microphones, start, *noise)

    def _hand_over(self) -> None:
        """Begin or end touches by hand; due automatic touches continue otherwise."""
        self._by_hand = self._requests.manual
        if self._by_hand:
            self._object.take_over(self._twin.scene.touches)
            return
        self._twin = retouch(self._twin, ())
        while self._change is not None and (self._change[0] <= self._twin.start or not self._change[1]):
            self._change = next(self._changes, None)

    def _retune(self) -> None:
        """Retune the string and pluck it again, since its modes have changed."""
        self._retuned = self._requests.retuning
        string, before = self._built.string, self._twin
        retuned = replace(string, tension=string.tension * (1.0 + self._retuned) ** 2)
        scene = replace(before.scene, touches=())
        twin = begin(
            replace(self._built, string=retuned), scene, sample_rate=before.sample_rate, seed=before.seed
        )
        self._twin = replace(twin, start=before.start)
        self._object.take_over(())


def _with_effects(
    changes: Iterator[tuple[Samples, tuple[Touch, ...]]], seed: int, world: World
) -> Iterator[tuple[Samples, tuple[Touch, ...]]]:
    """Yield the same touches with the mounts and surfaces of a world."""
    for start, touches in changes:
        yield start, tuple(plausible_touch(touch, seed, world=world) for touch in touches)


def label_columns(labels: Labels) -> dict[str, Floats]:
    """Return each label for every frame, by name; touch labels only during contact."""
    columns: dict[str, Floats] = {"settled": labels.settled}
    if labels.contact.shape[0]:
        columns |= {
            "contact": labels.contact[0],
            "position": labels.position[0],
            "force": labels.force[0],
            "slip": labels.slip[0],
            "slip_across": labels.across[0],
            "slip_along": labels.along[0],
        }
    return columns
