"""A session of a plan made audible and tangible: microphones, wrench, pose, labels and events, all simulated.

A rendering has no delays, jitter or losses: its times are true. Whoever plays or writes it adds those.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, Samples, Seconds
from monochord.lab.course import Course, course
from monochord.lab.gauge import Noise, Touched, mount, wrench_of
from monochord.lab.music import loop
from monochord.lab.plan import Assignment
from monochord.lab.rendering import Happening, Rendering, first_reading, joined
from monochord.physics.materials import load_material
from monochord.physics.twin import Outside, Scene, Sensor, Touch, Twin, advance, begin, switch
from monochord.physics.twin.outside import outside_at

PIECE: Seconds = 2.0
"""What is rendered at once."""
AVERAGE: Seconds = 0.005
"""Over which the label of force is averaged: half the width of a raised cosine around its time."""
FADE: Seconds = 0.05
"""In which music begins and ends."""
DOWNWARD = (1.0, 0.0, 0.0, 0.0)
"""Orientation of the tool, as a quaternion: half a turn about x, so that it looks down on the string."""
TOLD = ("contact", "position", "reaction", "slip", "across", "along")


def render(session: Assignment) -> Rendering:
    """Return a whole session; its memory grows by some 0.5 MB a second.

    Examples
    --------
    >>> from monochord.lab.plan import assignments
    >>> from monochord.lab.plans import load_plan
    >>> sound = render(assignments(load_plan("small"))[0])
    >>> sound.microphones.shape[0], sound.wrench.shape[1], sound.pose.shape[1], len(sound.labels)
    (2, 6, 7, 7)
    """
    return joined(pieces(session))


def pieces(session: Assignment) -> Iterator[Rendering]:
    """Yield a session in stretches of `PIECE`, each as it would be in the whole, in little memory."""
    return _Renderer(session).run()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Take:
    """A stretch as the twin gave it; `told` holds labels (n,) of every frame."""

    start: Samples
    microphones: Audio
    told: dict[str, Floats]

    @property
    def stop(self) -> Samples:
        return self.start + self.microphones.shape[1]


class _Renderer:
    """One session being rendered."""

    def __init__(self, session: Assignment) -> None:
        plan = session.plan
        self.session, self.plan, self.rate = session, plan, plan.sample_rate
        self.course: Course = course(session)
        self.material = load_material(session.group.material)
        self.events = _events(self.course)
        self.noise = Noise(plan.force_sensor, session.random("wrench"))
        self.shaking = session.random("pose")
        self.filter = mount(plan.force_sensor.bandwidth, self.rate)
        width = np.hanning(2 * round(AVERAGE * self.rate) + 3)[1:-1]
        self.average: Floats = width / width.sum()
        self.reach = max(len(self.filter), len(self.average)) // 2

    def run(self) -> Iterator[Rendering]:
        before, now = np.zeros(self.reach), None
        for take in self._takes():
            if now is not None:
                yield self._piece(now, before, take.told["reaction"][: self.reach])
                before = np.concatenate([before, now.told["reaction"]])[-self.reach :]
            now = take
        if now is not None:
            yield self._piece(now, before, np.zeros(0))

    def _takes(self) -> Iterator[_Take]:
        """Yield what the twin gives, stretch by stretch, its drivers switched on the way."""
        motion, size = self.course.motion, round(PIECE * self.rate)
        switches = {round(self.course.on * self.rate): True, round(self.course.off * self.rate): False}
        end = math.ceil(motion.end * self.rate)
        twin = self._begin()
        for start in range(0, end, size):
            stop = min(start + size, end)
            edges = [start, *(frame for frame in switches if start < frame < stop), stop]
            parts = list[_Take]()
            for first, last in pairwise(edges):
                if first in switches:
                    twin = switch(twin, (switches[first], switches[first]))
                take, twin = advance(twin, last - first)
                labels = take.labels
                told = {name: np.asarray(getattr(labels, name)[0], np.float64) for name in TOLD}
                told["settled"] = labels.settled.astype(np.float64)
                parts.append(_Take(start=first, microphones=take.microphones, told=told))
            yield _Take(
                start=start,
                microphones=np.concatenate([part.microphones for part in parts], axis=1),
                told={name: np.concatenate([part.told[name] for part in parts]) for name in parts[0].told},
            )

    def _begin(self) -> Twin:
        session, sensor = self.session, self.session.sensor()
        touch = Touch(
            material=self.material, motion=self.course.motion.keys, radius=session.radius, rolls=False
        )
        scene = Scene(touches=(touch,), outside=self._room(sensor), drivers=(False, False))
        seed = int(session.random("twin").integers(2**62))
        return begin(sensor, scene, sample_rate=self.rate, seed=seed)

    def _room(self, sensor: Sensor) -> Outside | None:
        """Return what sounds in the room: the music, which pauses for the taps."""
        group, done = self.session.group, self.course
        if not group.music:
            return None
        music = _music(group.music, group.snr, self.session.seed, sensor, self.rate)
        time = np.arange(math.ceil(done.motion.end * self.rate)) / self.rate
        gate = np.clip(np.minimum(time - done.on, done.off - time) / FADE, 0.0, 1.0)
        samples = np.resize(music.samples, time.size) * gate.astype(np.float32)
        return Outside(samples=samples, level=music.level)

    def _piece(self, take: _Take, before: Floats, after: Floats) -> Rendering:
        plan, told = self.plan, take.told
        reaction = np.concatenate([before, told["reaction"], after, np.zeros(self.reach + 1 - len(after))])
        start, stop = take.start, take.stop
        return Rendering(
            start=start,
            sample_rate=self.rate,
            force_rate=plan.force_rate,
            pose_rate=plan.pose_rate,
            label_rate=plan.label_rate,
            microphones=take.microphones,
            wrench=self._wrench(take, self._smooth(reaction, self.filter)),
            pose=self._pose(take),
            labels=self._labels(take, self._smooth(reaction, self.average)),
            events=tuple(
                event for event in self.events if start / self.rate <= event.time < stop / self.rate
            ),
        )

    def _smooth(self, reaction: Floats, kernel: Floats) -> Floats:
        """Return the force of the stretch's frames, and of one more, through a filter without lag."""
        from scipy.signal import oaconvolve  # noqa: PLC0415

        return oaconvolve(reaction, kernel, mode="same")[self.reach :]

    def _times(self, take: _Take, rate: Hertz) -> Floats:
        first, last = (first_reading(frame, rate, self.rate) for frame in (take.start, take.stop))
        return np.arange(first, last) / rate

    def _wrench(self, take: _Take, force: Floats) -> Floats:
        time = self._times(take, self.plan.force_rate)
        at = time * self.rate - take.start
        frames = np.arange(len(force))
        along, across = (
            np.interp(at, frames[: take.told[n].size], take.told[n]) for n in ("along", "across")
        )
        touched = Touched(time=time, normal=np.interp(at, frames, force), along=along, across=across)
        return wrench_of(touched, self.material, self.plan.force_sensor) + self.noise.on(time)

    def _pose(self, take: _Take) -> Floats:
        time = self._times(take, self.plan.pose_rate)
        place = self.course.motion.path(time)
        place += self.plan.pose_noise * self.shaking.normal(size=place.shape)
        return np.hstack([place, np.tile(DOWNWARD, (len(time), 1))])

    def _labels(self, take: _Take, force: Floats) -> dict[str, Floats]:
        told = take.told
        time = self._times(take, self.plan.label_rate)
        at = np.minimum(np.rint(time * self.rate).astype(int) - take.start, told["contact"].size - 1)
        touching = told["contact"][at] > 0.0

        def where_touched(values: Floats) -> Floats:
            return np.where(touching, values, np.nan)

        return {
            "contact": told["contact"][at],
            "position": where_touched(told["position"][at]),
            "force": where_touched(np.interp(time * self.rate - take.start, np.arange(len(force)), force)),
            "slip": where_touched(told["slip"][at]),
            "slip_across": where_touched(told["across"][at]),
            "slip_along": where_touched(told["along"][at]),
            "settled": told["settled"][at],
        }


def _events(done: Course) -> list[Happening]:
    found = [Happening(time=phase.start, kind="phase", text=phase.kind) for phase in done.motion.phases]
    found += [Happening(time=time, kind="tap", data={"number": i}) for i, time in enumerate(done.taps)]
    found += [
        Happening(time=done.on, kind="drivers", text="on"),
        Happening(time=done.off, kind="drivers", text="off"),
    ]
    return sorted(found, key=lambda event: event.time)


@lru_cache(maxsize=4)
def _music(music: str, snr: float, seed: int, sensor: Sensor, sample_rate: int) -> Outside:
    if music == "synthetic":
        return outside_at(loop(seed, sample_rate=sample_rate), snr, sensor, sample_rate=sample_rate)
    import soundfile  # noqa: PLC0415  (needs its library)
    import soxr  # noqa: PLC0415

    try:
        samples, rate = soundfile.read(Path(music), dtype="float32", always_2d=True)
    except (OSError, RuntimeError) as error:
        raise InputError(f"music {music} ({error})", "synthetic, or a wav or flac file") from error
    mono = soxr.resample(samples.mean(axis=1), rate, sample_rate).astype(np.float32)
    return outside_at(mono, snr, sensor, sample_rate=sample_rate)
