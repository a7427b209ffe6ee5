"""Virtual sensors touched from Python, one or several; not available on the command line."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from monochord.capture.sources._labels import LabelMemory
from monochord.capture.sources._paced_stream import PacedStream
from monochord.capture.sources.base import Source
from monochord.core.identity import SensorIdentity
from monochord.core.ranges import Count
from monochord.core.types import Audio, Signal, Truth
from monochord.core.units import Samples, Seconds
from monochord.physics.sensors import with_sensor
from monochord.physics.twin.virtual_sensor import VirtualSensor
from monochord.physics.twin.virtual_sensors import VirtualSensors

LABELS = ("contact", "contacts", "position", "force", "slip", "slip_velocity", "settled")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VirtualSensorSource(Source):
    """A virtual sensor whose time advances by `block` frames whenever a block is read.

    It ends after `seconds`. Time skipped by the program with `VirtualSensor.advance` is a gap, and so is a
    jump back by `VirtualSensor.restore`, of one frame.
    """

    sensor: VirtualSensor
    block: Count = 441
    seconds: Seconds = math.inf

    def open(self) -> "_SensorStream":
        """Open at the sensor's present time, which is frame 0."""
        return _SensorStream(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VirtualSensorsSource(Source):
    """Virtual sensors of one rate whose time advances together, two channels each; as `VirtualSensorSource`.

    They have no truth: a source's truth names no string.
    """

    sensors: VirtualSensors
    block: Count = 441
    seconds: Seconds = math.inf

    def open(self) -> "_SensorsStream":
        """Open at the sensors' present time, which is frame 0."""
        return _SensorsStream(self)


class _Clock:
    """The frames of a stream by its sensors' times, each of which may go on, or back, between blocks."""

    def __init__(self, sensors: Sequence[VirtualSensor], sample_rate: int) -> None:
        self._sensors, self._rate = sensors, sample_rate
        self._origins = self._now

    @property
    def _now(self) -> list[Samples]:
        return [round(sensor.time * self._rate) for sensor in self._sensors]

    def lost(self, start: Samples) -> Samples:
        """Return how many frames are lost before the next one, which is frame `start` otherwise."""
        now = self._now
        ahead = [at - origin - start for at, origin in zip(now, self._origins, strict=True)]
        lost = max(*ahead, 1 if min(ahead) < 0 else 0)
        self._origins = [at - start - lost for at in now]
        return lost


class _SensorStream(PacedStream):
    def __init__(self, options: VirtualSensorSource) -> None:
        sensor, rate = options.sensor, options.sensor.sample_rate
        identity = SensorIdentity(build=sensor.build)
        signal = with_sensor(Signal(sample_rate=rate, channels=2, sensor=identity), sensor.design)
        end = round(options.seconds * rate) if options.seconds < math.inf else math.inf
        super().__init__(signal, block=options.block, speed=0.0, end=end)
        self._sensor, self._clock = sensor, _Clock([sensor], rate)
        self._labels = LabelMemory(LABELS, rate)

    def truth(self, start: Samples, stop: Samples) -> Truth:
        """Return the labels of frames [start, stop); of several objects, that with the largest force."""
        return self._labels.over(start, stop)

    def _lost(self) -> Samples:
        lost = self._clock.lost(self._start)
        if lost:
            self._labels.add({name: np.full(lost, np.nan) for name in LABELS}, lost)
        return lost

    def _read(self, frames: Samples) -> Audio:
        sound, labels = self._sensor.advance(max(frames, 0) / self._signal.sample_rate)
        self._labels.add(labels, sound.shape[1])
        return sound


class _SensorsStream(PacedStream):
    def __init__(self, options: VirtualSensorsSource) -> None:
        sensors, rate = options.sensors, options.sensors[0].sample_rate
        end = round(options.seconds * rate) if options.seconds < math.inf else math.inf
        signal = Signal(sample_rate=rate, channels=2 * len(sensors))
        super().__init__(signal, block=options.block, speed=0.0, end=end)
        self._sensors, self._clock = sensors, _Clock(sensors, rate)

    def _lost(self) -> Samples:
        return self._clock.lost(self._start)

    def _read(self, frames: Samples) -> Audio:
        sound, _ = self._sensors.advance(max(frames, 0) / self._signal.sample_rate)
        return sound.reshape(-1, sound.shape[-1])
