"""The contract of a feature: frozen options, prepared for a signal, then called on windows."""

from abc import ABC, abstractmethod

from monochord.core.ranges import Checked
from monochord.core.types import Audio, Floats, Signal
from monochord.core.units import Samples


class Extractor(ABC):
    """A feature prepared for windows of one length.

    A row depends on its own window alone: a window gives the same bits in any batch, offline and live. An
    extractor never raises on audio. Silence and samples that are not numbers give finite rows.
    """

    @property
    @abstractmethod
    def columns(self) -> tuple[str, ...]:
        """The name of each column, such as ``mic 1 level 3``."""

    @abstractmethod
    def __call__(self, windows: Audio) -> Audio:
        """Return the features (n, columns) float32 of windows (n, channels, samples) float32."""


class Feature(Checked, ABC):
    """Options of a feature, as a frozen keyword-only dataclass.

    The feature's name and options identify it, also in caches.
    """

    @abstractmethod
    def prepare(self, signal: Signal, size: Samples) -> Extractor:
        """Return the extractor for windows of `size` frames of a signal.

        All slow work (tables, filters, weights, compilation) happens here. Raises `InputError` if the feature
        cannot handle the signal or the size, or if weights are missing; the message says how to get them.
        """


class SupportsCompliance(ABC):
    """Optional interface of an `Extractor`: contact-compliance augmentation, for training."""

    @abstractmethod
    def with_compliance(self, rows: Audio, force: Floats, share: Floats) -> Audio:
        """Return the features (n, columns) that objects of another compliance would give.

        Parameters
        ----------
        rows
            Features (n, columns) of recorded windows.
        force
            Force (n,) of the touch in each window, in N. A row with force 0 does not change.
        share
            Compliance (n,) as a multiple of the actual object's, above 0.
        """
