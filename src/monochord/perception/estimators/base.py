"""The contract of an estimator: frozen options, prepared for a signal, then called window by window."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

from monochord.core.ranges import Checked
from monochord.core.types import Estimate, Estimates, Prepared, Signal, Window
from monochord.core.units import Metres, Samples

NOT_MEASURED = Estimate.abstain("Hz", "not measured yet")


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """What an estimator knows of the string besides its estimates of a touch.

    `open_frequency` is that of the untouched string in Hz, without stiffness, as last measured, and
    `deviation` the share by which it lies above the known one, None where it was not measured. `follows` says
    whether estimates are made for the pitch that was measured.
    """

    open_frequency: Estimate = NOT_MEASURED
    deviation: float | None = None
    follows: bool = True


class Watching(ABC):
    """A prepared estimator that also watches the string; one with nothing to report is a plain function."""

    @abstractmethod
    def __call__(self, window: Window) -> Estimates:
        """Return the estimates of a window."""

    @property
    @abstractmethod
    def condition(self) -> Condition:
        """What is known of the string after the last window."""


class Estimator(Checked, ABC):
    """Options of an estimator, as a frozen keyword-only dataclass.

    Examples
    --------
    >>> import monochord as mc
    >>> @dataclass(frozen=True, slots=True, kw_only=True)
    ... class Level(mc.Estimator):
    ...     def prepare(self, signal: mc.Signal, size: int) -> Prepared:
    ...         return lambda window: {"level": mc.Estimate(value=window.samples.std(), std=0.0, unit="1")}
    >>> twin = mc.VirtualSensor("prototype", seed=1)
    >>> update = next(mc.listen(twin, model=Level()))
    >>> 0.0 < float(update.level) < 1.0
    True
    """

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

    def estimate_all(self, prepared: Sequence[Prepared], windows: Sequence[Window]) -> list[Estimates]:
        """Return the estimates of windows of several strings, each as its own function gives them alone.

        `prepared` are functions that `prepare` returned. One that is cheaper to compute for several strings
        at once overrides it; the estimates are the same to the bit.
        """
        return [estimate(window) for estimate, window in zip(prepared, windows, strict=True)]

    @property
    def string_length(self) -> Metres | None:
        """Length of the string in m where an option states it, for sinks that draw the string; else None."""
        return None

    @property
    def model(self) -> str:
        """Folder or name of the trained model that answers; empty where none does."""
        return ""
