"""The contract of a feature: frozen options, prepared for a signal, then called on windows."""

from abc import ABC, abstractmethod

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats, Signal
from monochord.core.units import Samples


class Extractor(ABC):
    """A feature made ready for windows of one length.

    A row depends on its own window alone: the same window gives the same bits alone, in any batch and at any
    place in it, offline and live. It never raises on audio: windows of silence or of samples that are not
    numbers give finite rows.
    """

    @property
    @abstractmethod
    def columns(self) -> tuple[str, ...]:
        """Names of the columns, one each, such as ``mic 1 level 3``."""

    @abstractmethod
    def __call__(self, windows: Audio) -> Audio:
        """Return the rows (n, columns) float32 of windows (n, channels, samples) float32."""

    def as_if(self, rows: Audio, force: Floats, share: Floats) -> Audio:
        """Return the rows (n, columns) that other objects would have given, for training; few features can.

        Parameters
        ----------
        rows
            Of windows that were heard, (n, columns).
        force
            Of the touch in each, in N, (n,); 0 where nothing touches or it is not known, and the row stays.
        share
            How far the other object gives way, as a share of how far that one does, (n,), above 0.

        Raises
        ------
        InputError
            If the feature does not tell how far an object gives way.
        """
        del rows, force, share
        given = f"feature '{type(self).__module__.rpartition('.')[2]}' for objects that give way otherwise"
        raise InputError(given, "fft_harmonic with tones", "set objects.copies = 0")


class Feature(ABC):
    """Options of a feature, a frozen keyword-only dataclass; they and its name define it, for caches too."""

    @abstractmethod
    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Return the extractor for windows of `size` frames of such a signal.

        What is slow (tables, filters, weights, compiling) happens here. Raises `InputError` for a signal or a
        size that it cannot serve, and where weights are needed and not there, with the way to get them.
        """
