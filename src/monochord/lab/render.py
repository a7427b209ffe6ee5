"""Simulates a session of a plan: microphones, wrench, pose, labels and events.

A rendering has no delays, jitter or losses: its times are true. The code that plays or writes it adds them.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, Samples, Seconds
from monochord.dsp.music import loop
from monochord.dsp.speech import babble
from monochord.lab.assignment import Assignment
from monochord.lab.force_sensor import ContactHistory, SensorNoise, bandwidth_filter, wrench_of
from monochord.lab.motors import motor_sound
from monochord.lab.partner import partner_keys
from monochord.lab.schedule import Schedule, schedule
from monochord.physics.twin import Labels, Outside, Scene, Sensor, Twin, advance, begin, switch
from monochord.physics.twin.outside import outside_at
from monochord.sessions import Event

CHUNK: Seconds = 2.0
"""Duration simulated at once, in s."""
FORCE_AVERAGE: Seconds = 0.005
"""Averaging of the force label in s: half the width of a raised cosine centred on its time."""
MUSIC_FADE: Seconds = 0.05
"""Fade-in and fade-out time of music, in s."""
PLAYED = (0.75, 1.25)
"""Range of how much lower and slower drawn music and speech are than synthesised; below one, higher."""
DOWNWARD = (1.0, 0.0, 0.0, 0.0)
"""Orientation of the tool, as a quaternion: half a turn about x, pointing down at the string."""
PLACES = ("position_1", "position_2")
"""Labels of a session of two objects: the place of each while it touches."""
LABELS = ("contact", "position", "reaction", "slip", "across", "along")


@dataclass(frozen=True, slots=True, kw_only=True)
class Rendering:
    """A session, or a stretch of one, at true times.

    `microphones` (2, n) float32 in full scale begin at frame `start`. `wrench` (m, 6) in N and N m, `pose`
    (k, 7) in m and as a unit quaternion, and every column (l,) of `labels` begin at their first sample at or
    after that time. Touch labels are NaN without contact. `contacts` is the number of objects that touch;
    while two press, `position` is NaN, and in sessions of two objects each one's own is in `position_1` and
    `position_2`. An event of kind "fault" has the number of a driver that is dead from then on.
    """

    start: Samples
    sample_rate: int
    force_rate: Hertz
    pose_rate: Hertz
    label_rate: Hertz
    microphones: Audio
    wrench: Floats
    pose: Floats
    labels: dict[str, Floats]
    events: tuple[Event, ...]

    @property
    def begin(self) -> Seconds:
        """Start time, in s."""
        return self.start / self.sample_rate

    @property
    def seconds(self) -> Seconds:
        """Duration in s."""
        return self.microphones.shape[1] / self.sample_rate

    def index(self, rate: Hertz, count: int) -> NDArray[np.int64]:
        """Return the numbers of `count` readings in a stream of a given rate."""
        return first_reading(self.start, rate, self.sample_rate) + np.arange(count, dtype=np.int64)

    @property
    def wrench_time(self) -> Floats:
        """Times of the wrenches, (m,) in s."""
        return self.index(self.force_rate, len(self.wrench)) / self.force_rate

    @property
    def pose_time(self) -> Floats:
        """Times of the poses, (k,) in s."""
        return self.index(self.pose_rate, len(self.pose)) / self.pose_rate

    @property
    def label_time(self) -> Floats:
        """Times of the labels, (l,) in s."""
        return self.index(self.label_rate, len(self.labels["contact"])) / self.label_rate


def concatenate(parts: Iterable[Rendering]) -> Rendering:
    """Join consecutive stretches of a session, in order; raises `ValueError` if there are none."""
    parts = list(parts)
    if not parts:
        raise ValueError("nothing to concatenate")
    first = parts[0]
    return Rendering(
        start=first.start,
        sample_rate=first.sample_rate,
        force_rate=first.force_rate,
        pose_rate=first.pose_rate,
        label_rate=first.label_rate,
        microphones=np.concatenate([part.microphones for part in parts], axis=1),
        wrench=np.concatenate([part.wrench for part in parts]),
        pose=np.concatenate([part.pose for part in parts]),
        labels={name: np.concatenate([part.labels[name] for part in parts]) for name in first.labels},
        events=tuple(event for part in parts for event in part.events),
    )


def first_reading(frame: Samples, rate: Hertz, sample_rate: int) -> int:
    """Return the number of the first reading, at a rate, at or after a microphone frame.

    >>> first_reading(44100, 1000.0, 44100), first_reading(44101, 1000.0, 44100)
    (1000, 1001)
    """
    return math.ceil(frame * rate / sample_rate - 1e-9)


def render(session: Assignment) -> Rendering:
    """Return a whole session; takes some 0.5 MB of memory per second.

    Examples
    --------
    >>> from monochord.lab import assignments
    >>> from monochord.lab.plans import load_plan
    >>> sound = render(assignments(load_plan("small"))[0])
    >>> sound.microphones.shape[0], sound.wrench.shape[1], sound.pose.shape[1], len(sound.labels)
    (2, 6, 7, 8)
    """
    return concatenate(pieces(session))


def pieces(session: Assignment) -> Iterator[Rendering]:
    """Yield a session in chunks of `CHUNK`, equal to those of the whole, in little memory."""
    return _Renderer(session).run()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Chunk:
    """A chunk of the twin's output; `labels` are columns (n,), one value a frame."""

    start: Samples
    microphones: Audio
    labels: dict[str, Floats]

    @property
    def stop(self) -> Samples:
        return self.start + self.microphones.shape[1]


class _Renderer:
    """One session being rendered."""

    def __init__(self, session: Assignment) -> None:
        plan = session.plan
        self.session, self.plan, self.rate = session, plan, plan.sample_rate
        self.schedule: Schedule = schedule(session)
        motion, length = self.schedule.motion, session.sensor().string.length
        self.motions = [keys for keys in (motion.keys, partner_keys(session, motion, length)) if keys]
        self.material = session.material
        self.events = _events(self.schedule, session.deviation.dead_driver)
        self.noise = SensorNoise(plan.force_sensor, session.random("wrench"))
        self.pose_noise = session.random("pose")
        self.errors = _RobotErrors(session, self.schedule)
        self.filter = bandwidth_filter(plan.force_sensor.bandwidth, self.rate)
        width = np.hanning(2 * round(FORCE_AVERAGE * self.rate) + 3)[1:-1]
        self.average: Floats = width / width.sum()
        self.reach = max(len(self.filter), len(self.average)) // 2

    def run(self) -> Iterator[Rendering]:
        before, now = np.zeros(self.reach), None
        for chunk in self._chunks():
            if now is not None:
                yield self._piece(now, before, chunk.labels["reaction"][: self.reach])
                before = np.concatenate([before, now.labels["reaction"]])[-self.reach :]
            now = chunk
        if now is not None:
            yield self._piece(now, before, np.zeros(0))

    def _chunks(self) -> Iterator[_Chunk]:
        """Yield the twin's output chunk by chunk, switching its drivers on and off in between."""
        motion, size = self.schedule.motion, round(CHUNK * self.rate)
        switches = _switches(self.schedule, self.rate)
        end = math.ceil(motion.end * self.rate)
        twin = self._begin()
        for start in range(0, end, size):
            stop = min(start + size, end)
            edges = [start, *(frame for frame in switches if start < frame < stop), stop]
            parts = list[_Chunk]()
            for first, last in pairwise(edges):
                if first in switches:
                    twin = switch(twin, switches[first])
                take, twin = advance(twin, last - first)
                labels = _columns(take.labels, self._pressed(first, last))
                parts.append(_Chunk(start=first, microphones=take.microphones, labels=labels))
            yield _Chunk(
                start=start,
                microphones=np.concatenate([part.microphones for part in parts], axis=1),
                labels={
                    name: np.concatenate([part.labels[name] for part in parts]) for name in parts[0].labels
                },
            )

    def _pressed(self, first: Samples, last: Samples) -> NDArray[np.bool_]:
        """Return whether the motion of each object presses at each frame, (objects, n)."""
        if len(self.motions) == 1:
            return np.ones((1, last - first), np.bool_)
        time = np.arange(first, last) / self.rate
        return np.stack(
            [
                np.interp(time, [key.time for key in keys], [key.force for key in keys]) > 0.0
                for keys in self.motions
            ]
        )

    def _begin(self) -> Twin:
        session, sensor = self.session, self.session.sensor()
        touches = tuple(session.touch(keys) for keys in self.motions)
        scene = Scene(touches=touches, outside=self._ambient(sensor), drivers=(False, False))
        seed = int(session.random("twin").integers(2**62))
        return begin(sensor, scene, sample_rate=self.rate, seed=seed)

    def _ambient(self, sensor: Sensor) -> Outside | None:
        """Return the ambient sound: music, speech and motors, which pause for the taps."""
        group, timing = self.session.group, self.schedule
        if not (group.music or group.motors):
            return None
        time = np.arange(math.ceil(timing.motion.end * self.rate)) / self.rate
        gate = np.clip(np.minimum(time - timing.on, timing.off - time) / MUSIC_FADE, 0.0, 1.0)
        gate = gate.astype(np.float32)
        if not group.motors:
            music = self._music(sensor, time.size)
            return Outside(samples=np.resize(music.samples, time.size) * gate, level=music.level)
        sound = motor_sound(self.session.random("motors"), timing.motion.path(time), self.rate)
        # Their rms at full speed is one.
        ratio = self._ratio(group.motor_snr, "motor ratio")
        sound *= outside_at(np.ones(1, np.float32), ratio, sensor, sample_rate=self.rate).level
        if group.music:
            music = self._music(sensor, time.size)
            sound += np.float32(music.level) * np.resize(music.samples, time.size)
        return Outside(samples=sound * gate)

    def _music(self, sensor: Sensor, count: Samples) -> Outside:
        """Return the session's music or speech."""
        session, rate = self.session, self.rate
        name, ratio = session.group.music, self._ratio(session.group.snr, "ratio")
        if name not in ("drawn", "synthetic speech"):
            return _recorded(name, ratio, session.seed, sensor, rate)
        random = session.random(name)
        other = round(rate * random.uniform(*PLAYED))  # played at another rate: other pitches and speeds
        if name == "drawn":
            return outside_at(
                loop(int(random.integers(2**31)), sample_rate=other), ratio, sensor, sample_rate=rate
            )
        speech = babble(random, count, float(other)).astype(np.float32)
        return outside_at(speech, ratio, sensor, sample_rate=rate)

    def _ratio(self, ratio: float | tuple[float, float], purpose: str) -> float:
        """Return a ratio in dB, drawn where it is a range."""
        return float(self.session.random(purpose).uniform(*ratio)) if isinstance(ratio, tuple) else ratio

    def _piece(self, chunk: _Chunk, before: Floats, after: Floats) -> Rendering:
        plan, labels = self.plan, chunk.labels
        reaction = np.concatenate([before, labels["reaction"], after, np.zeros(self.reach + 1 - len(after))])
        start, stop = chunk.start, chunk.stop
        return Rendering(
            start=start,
            sample_rate=self.rate,
            force_rate=plan.force_rate,
            pose_rate=plan.pose_rate,
            label_rate=plan.label_rate,
            microphones=chunk.microphones,
            wrench=self._wrench(chunk, self._smooth(reaction, self.filter)),
            pose=self._pose(chunk),
            labels=self._labels(chunk, self._smooth(reaction, self.average)),
            events=tuple(
                event for event in self.events if start / self.rate <= event.time < stop / self.rate
            ),
        )

    def _smooth(self, reaction: Floats, kernel: Floats) -> Floats:
        """Return the force at the chunk's frames, and one more, through a zero-delay filter."""
        from scipy.signal import oaconvolve  # noqa: PLC0415

        return oaconvolve(reaction, kernel, mode="same")[self.reach :]

    def _times(self, chunk: _Chunk, rate: Hertz) -> Floats:
        first, last = (first_reading(frame, rate, self.rate) for frame in (chunk.start, chunk.stop))
        return np.arange(first, last) / rate

    def _wrench(self, chunk: _Chunk, force: Floats) -> Floats:
        time = self._times(chunk, self.plan.force_rate)
        at = time * self.rate - chunk.start
        frames = np.arange(len(force))
        along, across = (
            np.interp(at, frames[: chunk.labels[n].size], chunk.labels[n]) for n in ("along", "across")
        )
        contact = ContactHistory(time=time, normal=np.interp(at, frames, force), along=along, across=across)
        wrench = wrench_of(contact, self.material, self.plan.force_sensor)
        return self.errors.gain * wrench + self.noise.on(time)

    def _pose(self, chunk: _Chunk) -> Floats:
        time = self._times(chunk, self.plan.pose_rate)
        place = self.schedule.motion.path(time)
        place[:, 0] += self.errors.along(time)
        place += self.plan.pose_noise * self.pose_noise.normal(size=place.shape)
        return np.hstack([place, np.tile(DOWNWARD, (len(time), 1))])

    def _labels(self, chunk: _Chunk, force: Floats) -> dict[str, Floats]:
        labels = chunk.labels
        time = self._times(chunk, self.plan.label_rate)
        at = np.minimum(np.rint(time * self.rate).astype(int) - chunk.start, labels["contact"].size - 1)
        touching = labels["contact"][at] > 0.0

        def in_contact(values: Floats) -> Floats:
            return np.where(touching, values, np.nan)

        return {
            "contact": labels["contact"][at],
            "contacts": labels["contacts"][at],
            "position": in_contact(labels["position"][at]),
            "force": in_contact(np.interp(time * self.rate - chunk.start, np.arange(len(force)), force)),
            "slip": in_contact(labels["slip"][at]),
            "slip_across": in_contact(labels["across"][at]),
            "slip_along": in_contact(labels["along"][at]),
            "settled": labels["settled"][at],
            **{name: labels[name][at] for name in PLACES if name in labels},
        }


class _RobotErrors:
    """The session's errors of pose and force, which no reading shows."""

    def __init__(self, session: Assignment, timing: Schedule) -> None:
        errors, random = session.plan.errors, session.random("errors")
        self.gain = 1.0 + errors.gain * random.normal()
        self._begins = np.array([phase.start for phase in timing.motion.phases if phase.kind == "travel"])
        tool = errors.tool * random.normal()
        self._offsets = tool + errors.repeat * random.normal(size=self._begins.size + 1)

    def along(self, time: Floats) -> Floats:
        """Return the error of the pose in x in m, constant within a touch, at times (n,)."""
        return self._offsets[np.searchsorted(self._begins, time, side="right")]


def _columns(labels: Labels, pressed: NDArray[np.bool_]) -> dict[str, Floats]:
    """Return the labels (n,) of all touches as one; `pressed` (touches, n) says which of them are led down.

    Of two objects, the place and the sliding are those of the one that alone presses; none has a place where
    both do.
    """
    columns = {name: np.asarray(getattr(labels, name)[0], np.float64) for name in LABELS}
    columns["contacts"] = labels.contact.sum(axis=0, dtype=np.float64)
    if len(labels.contact) > 1:
        for name in ("contact", "slip"):
            columns[name] = getattr(labels, name).max(axis=0).astype(np.float64)
        columns["reaction"] = labels.reaction.sum(axis=0, dtype=np.float64)
        alone = pressed[0] != pressed[1]
        for name in ("position", "across", "along"):
            columns[name] = np.where(alone & pressed[1], getattr(labels, name)[1], columns[name])
        columns["position"] = np.where(alone, columns["position"], np.nan)
        for i, name in enumerate(PLACES):
            columns[name] = np.where(labels.contact[i] > 0, labels.position[i], np.nan)
    columns["settled"] = labels.settled.astype(np.float64)
    return columns


def _switches(timing: Schedule, rate: int) -> dict[Samples, tuple[bool, bool]]:
    """Return which drivers are on from which frames on."""
    switches = {round(timing.on * rate): (True, True)}
    if timing.death is not None:
        time, driver = timing.death
        switches[round(time * rate)] = (driver != 1, driver != 2)
    return {**switches, round(timing.off * rate): (False, False)}


def _events(timing: Schedule, dead_driver: int) -> list[Event]:
    events = [Event(time=phase.start, kind="phase", text=phase.kind) for phase in timing.motion.phases]
    events += [Event(time=time, kind="tap", data={"number": i}) for i, time in enumerate(timing.taps)]
    events += [
        Event(time=timing.on, kind="drivers", text="on"),
        Event(time=timing.off, kind="drivers", text="off"),
    ]
    deaths = [(0.0, dead_driver)] if dead_driver else []
    deaths += [timing.death] if timing.death is not None else []
    events += [Event(time=time, kind="fault", text="dead driver", data={"driver": n}) for time, n in deaths]
    return sorted(events, key=lambda event: event.time)


@lru_cache(maxsize=4)
def _recorded(music: str, snr: float, seed: int, sensor: Sensor, sample_rate: int) -> Outside:
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
