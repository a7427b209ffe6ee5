"""The contract of an estimator: frozen options, prepared for a signal, then called window by window."""

from abc import ABC, abstractmethod

from monochord.core.types import Prepared, Signal
from monochord.core.units import Metres, Samples


class Estimator(ABC):
    """Options of an estimator, as a frozen keyword-only dataclass."""

    @abstractmethod
    def prepare(self, signal: Signal, size: Samples) -> Prepared:
        """Return the function from a window of `size` frames to its estimates by name.

        Everything slow (tables, filters) happens here, so that the returned function keeps a steady pace;
        what compiles at first use does so in the warm-up window of the live loop.
        It never raises on audio: a window that cannot be used (silence, a gap, samples that are not numbers)
        gives estimates that are not valid and say why. Equal streams of windows give equal estimates: a
        window that does not begin after the one before begins a new stream, without any state. Options
        that the signal cannot serve raise `InputError` here.
        """

    @property
    def string_length(self) -> Metres | None:
        """Length of the string in m where an option states it, for sinks that draw the string; else None."""
        return None
