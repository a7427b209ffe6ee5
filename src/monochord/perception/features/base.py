"""The contract of a feature: frozen options, prepared for a signal, then called on windows."""

from abc import ABC, abstractmethod

from monochord.core.ranges import Checked
from monochord.core.types import Audio, Floats, Signal
from monochord.core.units import Samples


class Extractor(ABC):
    """A feature prepared for windows of one length.

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


class Feature(Checked, ABC):
    """Options of a feature, a frozen keyword-only dataclass; they and its name define it, for caches too."""

    @abstractmethod
    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Return the extractor for windows of `size` frames of such a signal.

        What is slow (tables, filters, weights, compiling) happens here. Raises `InputError` for a signal or a
        size that it cannot serve, and for missing weights, with the way to get them.
        """


class SupportsCompliance(ABC):
    """Optional interface of an `Extractor`: contact-compliance augmentation, for training."""

    @abstractmethod
    def with_compliance(self, rows: Audio, force: Floats, share: Floats) -> Audio:
        """Return the rows (n, columns) of objects of another compliance.

        Parameters
        ----------
        rows
            Of recorded windows, (n, columns).
        force
            Of the touch in each, in N, (n,); a row whose force is 0 stays as it is.
        share
            Compliance as a share of the actual object's, (n,), above 0.
        """
