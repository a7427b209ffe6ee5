"""The contract of a feature: frozen options, prepared for a signal, then called on windows."""

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from monochord.core.ranges import Checked
from monochord.core.shapes import batch
from monochord.core.types import Audio, Signal
from monochord.core.units import Samples, Seconds

if TYPE_CHECKING:  # kernels: `import monochord` names these classes without them
    from monochord.perception.reader.memory import Memory
    from monochord.perception.spectrum import Spectrum, SpectrumAnalyser


class Extractor(ABC):
    """A feature prepared for windows of one length.

    A row depends on its own window alone: the same window gives the same bits alone, in any batch and at any
    place in it, offline and live. Only that of a `RecurrentExtractor` depends on the windows before, too. It
    never raises on audio: windows of silence or of samples that are not numbers give finite rows.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> import numpy as np
    >>> import monochord as mc
    >>> class Levels(mc.Extractor):
    ...     columns = ("mic 1 level", "mic 2 level")
    ...
    ...     def __call__(self, windows: np.ndarray) -> np.ndarray:
    ...         return np.nan_to_num(windows).std(axis=2).astype(np.float32)
    >>> Levels()(np.ones((3, 2, 4410), np.float32)).tolist()
    [[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]
    """

    @property
    @abstractmethod
    def columns(self) -> tuple[str, ...]:
        """The name of each column, such as ``mic 1 level 3``."""

    @abstractmethod
    def __call__(self, windows: Audio) -> Audio:
        """Return the features (n, columns) float32 of windows (n, channels, samples) float32."""


class SpectrumExtractor(Extractor):
    """An extractor that sees a window's spectrum alone, which others may use, too."""

    @property
    @abstractmethod
    def analyser(self) -> "SpectrumAnalyser":
        """The analyser that makes the spectra."""

    @abstractmethod
    def row(self, spectrum: "Spectrum") -> Audio:
        """Return the features (columns,) float32 of a window's spectrum."""

    def __call__(self, windows: Audio) -> Audio:
        """Return the features (n, columns) of windows (n, 2, samples)."""
        windows = batch(windows, 2, self.analyser.size)
        rows = np.empty((len(windows), len(self.columns)), np.float32)
        for window, row in zip(windows, rows, strict=True):
            row[:] = self.row(self.analyser.analyse(window))
        return rows


class RecurrentExtractor(SpectrumExtractor):
    """An extractor with a memory of the windows before, which is passed in and out."""

    @property
    @abstractmethod
    def tick(self) -> Seconds:
        """Time in s between two windows that enter the memory; fewer tell it less than live ones."""

    @abstractmethod
    def begin(self) -> "Memory":
        """Return the memory at the beginning of a stream."""

    @abstractmethod
    def step(self, memory: "Memory", spectrum: "Spectrum", time: Seconds) -> "tuple[Memory, Audio]":
        """Return the memory after a window that starts at a time in s, and its features (columns,)."""

    def row(self, spectrum: "Spectrum") -> Audio:
        """Return the features (columns,) float32 of a window at the beginning of a stream."""
        return self.step(self.begin(), spectrum, 0.0)[1]


class Feature(Checked, ABC):
    """Options of a feature, a frozen keyword-only dataclass; they and its name define it, for caches too.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> import numpy as np
    >>> import monochord as mc
    >>> class Levels(mc.Extractor):
    ...     columns = ("mic 1 level", "mic 2 level")
    ...
    ...     def __call__(self, windows: np.ndarray) -> np.ndarray:
    ...         return np.nan_to_num(windows).std(axis=2).astype(np.float32)
    >>> @dataclass(frozen=True, slots=True, kw_only=True)
    ... class Level(mc.Feature):
    ...     def prepare(self, signal: mc.Signal, size: int) -> mc.Extractor:
    ...         return Levels()
    >>> extractor = Level().prepare(mc.Signal(sample_rate=44100, channels=2), 4410)
    >>> extractor(np.zeros((3, 2, 4410), np.float32)).shape
    (3, 2)
    """

    @abstractmethod
    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Return the extractor for windows of `size` frames of a signal.

        All slow work (tables, filters, weights, compilation) happens here. Raises `InputError` if the feature
        cannot handle the signal or the size, or if weights are missing; the message says how to get them.
        """
