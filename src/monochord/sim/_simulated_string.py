"""A string in a physics simulation: a virtual sensor that the simulation's contacts lead, as a source."""

from collections import deque
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import ceil

import numpy as np

from monochord.capture.sources._labels import LabelMemory
from monochord.capture.sources._paced_stream import PacedStream
from monochord.capture.sources.base import Source
from monochord.core.identity import SensorIdentity
from monochord.core.types import Audio, Floats, Signal, Truth
from monochord.core.units import MetresPerSecond, Samples, Seconds
from monochord.physics.sensors import with_sensor
from monochord.physics.twin.virtual_sensor import VirtualSensor
from monochord.sim._contacts import TRUTH, UNTOUCHED, ContactSlots, Counts, Row, SimulatedContact, truth_of

PERIOD: Seconds = 0.01
"""Sound is made in blocks of this length."""
AHEAD: Seconds = 8e-4
"""The twin reads motions up to this far ahead, so that its sound is at least so much later than them."""
WARM_UP: Seconds = 0.5
"""Sound of the untouched string before the simulation begins: its drivers have brought it to its swing."""
BEFORE = 10
"""Blocks of sound with which a stream begins: those before its opening, of the untouched string at first."""
RESET_GAP: Samples = 1
"""Gap in the stream where the simulation was reset."""
MOST_WAITING: Seconds = 30.0
"""Sound that waits for a listener; what is older is a gap."""
SLIP_SPEED: MetresPerSecond = 5e-4
"""Speed from which the truth is slip, as in the labels of the twin."""
LABELS = (*TRUTH, "settled")


@dataclass(frozen=True, slots=True)
class SoundBlock:
    """A block of sound: `sound` (2, n) in full scale, its first frame, and what is true of each frame."""

    start: Samples
    sound: Audio
    labels: dict[str, Floats]


class StringTwin:
    """A virtual sensor whose objects are led by the contacts of a simulation, step after step.

    Its sound runs in blocks of 10 ms on the sample clock, contacts on the simulation's, every `step` s. The
    sound is `delay` later than the contacts: one step, or as many as 0.8 ms have. The sensor comes at its
    beginning, with `slots` objects for each of `materials` materials.
    """

    def __init__(self, sensor: VirtualSensor, step: Seconds, materials: int, slots: int) -> None:
        self.sensor, self.step = sensor, step
        self._steps, self._late = round(PERIOD / step), ceil(AHEAD / step - 1e-9)
        self.delay = self._late * step
        self.frames = round(PERIOD * sensor.sample_rate)
        self._slots = ContactSlots(sensor.sensor.string.length, step, materials, slots)
        self._step_of_frame = np.rint(np.arange(self.frames) / (sensor.sample_rate * step)).astype(int)
        self._truth = [UNTOUCHED] * (self._steps + 1)
        self._queues: list[deque[SoundBlock]] = []
        self._past = deque[SoundBlock](maxlen=BEFORE)
        self._start: Samples = 0
        for _ in range(round(WARM_UP / PERIOD)):
            self._advance()
        self._warm, self._untouched = sensor.snapshot(), tuple(self._past)
        self._begin()

    @property
    def counts(self) -> Counts:
        """What was left out so far."""
        return self._slots.counts

    @property
    def block(self) -> SoundBlock:
        """The latest block of sound."""
        return self._past[-1]

    def restart(self) -> None:
        """Go back to the warm string, untouched; streams have a gap of a frame."""
        self.sensor.restore(self._warm)
        self._start += RESET_GAP
        begun = range(self._start - BEFORE * self.frames, self._start, self.frames)
        self._past.extend(
            replace(block, start=start) for block, start in zip(self._untouched, begun, strict=True)
        )
        self._begin()

    def _begin(self) -> None:
        before = self._late + 1
        self.contacts: tuple[SimulatedContact, ...] = ()
        self._rows: list[list[Row]] = [self._slots.away() for _ in range(before)]
        self._truth = [UNTOUCHED] * before
        self._slots.restart()

    def follow(self, contacts: Sequence[SimulatedContact]) -> None:
        """Take the contacts after another step; every 10 ms there is another block of sound."""
        self.contacts = tuple(contacts)
        self._rows.append(self._slots.follow(contacts))
        self._truth.append(truth_of(contacts, SLIP_SPEED))
        if len(self._rows) == self._steps + self._late + 1:
            self._sound()

    def _sound(self) -> None:
        rows = np.array(self._rows[1:]).transpose(2, 1, 0)
        self.sensor.lead(self.step, position=rows[0], force=rows[1], clearance=rows[2], across=rows[3])
        self._advance()
        del self._rows[: self._steps], self._truth[: self._steps]

    def _advance(self) -> None:
        sound, labels = self.sensor.advance(PERIOD)
        known = np.array(self._truth).T[:, self._step_of_frame]
        truth = {**dict(zip(TRUTH, known, strict=True)), "settled": labels["settled"]}
        block = SoundBlock(self._start, sound, truth)
        for queue in (self._past, *self._queues):
            queue.append(block)
        self._start += self.frames

    @contextmanager
    def listened(self) -> Generator[deque[SoundBlock]]:
        """Have a queue with the latest 0.1 s of sound, in which every further block comes."""
        queue = deque(self._past, maxlen=round(MOST_WAITING / PERIOD))
        self._queues.append(queue)
        try:
            yield queue
        finally:
            self._queues[:] = [each for each in self._queues if each is not queue]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SimulatedString(Source):
    """A string of a simulation; `mc.listen` takes it and yields updates with the simulation's truth.

    `name` is its name in the simulation and `twin` its virtual sensor. `step` is called for another step of
    the simulation whenever a listener waits for sound.
    """

    name: str
    twin: StringTwin
    step: Callable[[], None]

    @property
    def counts(self) -> Counts:
        """How many readings of contacts were clipped or left out, with `notes` in words."""
        return self.twin.counts

    @property
    def contacts(self) -> tuple[SimulatedContact, ...]:
        """Contacts and objects nearby at the latest step, at most as many as the contact sensor has."""
        return self.twin.contacts

    @property
    def sound(self) -> Audio:
        """The latest 10 ms of sound, (2, n) in full scale."""
        return self.twin.block.sound

    @contextmanager
    def open(self) -> Generator["_StringStream"]:
        """Open 0.1 s before the simulation's present time, with the sound that there is, from frame 0 on."""
        with self.twin.listened() as queue, _StringStream(self, queue) as stream:
            yield stream


class _StringStream(PacedStream):
    """Sound that the simulation has made; where it has made none yet, it is stepped."""

    def __init__(self, string: SimulatedString, queue: deque[SoundBlock]) -> None:
        twin = string.twin
        rate = twin.sensor.sample_rate
        identity = SensorIdentity(build=twin.sensor.build)
        signal = with_sensor(Signal(sample_rate=rate, channels=2, sensor=identity), twin.sensor.design)
        super().__init__(signal, block=twin.frames, speed=0.0)
        self._advance, self._queue, self._origin = string.step, queue, queue[0].start
        self._labels = LabelMemory(LABELS, rate)

    @property
    def simulated(self) -> bool:
        """Always."""
        return True

    def truth(self, start: Samples, stop: Samples) -> Truth:
        """Return the simulation's labels of frames [start, stop); of several contacts the strongest's."""
        return self._labels.over(start, stop)

    def _lost(self) -> Samples:
        while not self._queue:
            self._advance()
        lost = self._queue[0].start - self._origin - self._start
        if lost:
            self._labels.add({name: np.full(lost, np.nan) for name in LABELS}, lost)
        return lost

    def _read(self, frames: Samples) -> Audio:  # noqa: ARG002  (blocks have their own length)
        block = self._queue.popleft()
        self._labels.add(block.labels, block.sound.shape[1])
        return block.sound
