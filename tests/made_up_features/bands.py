"""A feature for tests: the log levels of bands, as any rate and length give them."""

from dataclasses import dataclass

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Signal
from monochord.core.units import Samples
from monochord.perception.features.base import Extractor, Feature

LOWEST, HIGHEST = 150.0, 3500.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Bands(Feature):
    """Log levels of `count` bands of each channel, and the pitch of its strongest line."""

    count: int = 24

    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        if self.count < 1:
            raise InputError(f"{self.count} bands", "1 or more")
        return _Bands(self.count, signal, size)


class _Bands(Extractor):
    def __init__(self, count: int, signal: Signal, size: Samples) -> None:
        self._channels, self._count = signal.channels, count
        self._taper = np.hanning(size)
        self._frequency = np.fft.rfftfreq(8 * size, 1.0 / signal.sample_rate)
        edges = np.geomspace(LOWEST, HIGHEST, count + 1)
        self._edges = np.searchsorted(self._frequency, edges)

    @property
    def columns(self) -> tuple[str, ...]:
        names = [f"band {number + 1}" for number in range(self._count)] + ["pitch"]
        return tuple(f"mic {channel + 1} {name}" for channel in range(self._channels) for name in names)

    def __call__(self, windows: Audio) -> Audio:
        return np.array([self._row(window) for window in windows], np.float32).reshape(len(windows), -1)

    def _row(self, window: Audio) -> list[float]:
        row: list[float] = []
        for channel in np.nan_to_num(np.clip(window, -2.0, 2.0)):
            power = np.abs(np.fft.rfft(channel * self._taper, 8 * len(channel))) ** 2
            total = np.add.reduceat(power, self._edges[:-1])
            strongest = self._edges[0] + int(np.argmax(power[self._edges[0] : self._edges[-1]]))
            row += [*np.log(total + 1e-9), float(np.log(self._frequency[strongest]))]
        return row
