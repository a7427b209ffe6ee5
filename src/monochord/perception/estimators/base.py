"""The contract of an estimator: frozen options, prepared for a signal, then called for each window."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

from monochord.core.ranges import Checked
from monochord.core.types import Estimates, Prepared, Signal, Window
from monochord.core.units import Metres, Samples, Seconds
from monochord.perception.watching import Condition, Watching

__all__ = ["Condition", "Estimator", "Watching"]


class Estimator(Checked, ABC):
    """Options of an estimator, as a frozen keyword-only dataclass.

    Examples
    --------
    >>> from dataclasses import dataclass
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

        All slow work (tables, filters) happens here, so the returned function takes a steady time. Code that
        compiles at first use compiles in the warm-up window of the live loop.

        The returned function never raises on audio. An unusable window (silence, a gap, samples that are not
        numbers) gives invalid estimates with a reason. Equal streams of windows give equal estimates. A
        window that starts no later than its predecessor begins a new stream with fresh state.

        Raises
        ------
        InputError
            If the signal does not allow the options.
        """

    def estimate_all(self, prepared: Sequence[Prepared], windows: Sequence[Window]) -> list[Estimates]:
        """Return the estimates for one window of each of several strings.

        `prepared` are functions that `prepare` returned, one for each window. An estimator that computes
        several strings faster at once overrides this method; its estimates have the same bits.
        """
        return [estimate(window) for estimate, window in zip(prepared, windows, strict=True)]

    @property
    def sample_rate(self) -> int | None:
        """Sample rate in Hz of the windows that it takes, None for any.

        The live loop resamples a source of a higher rate.
        """
        return None

    @property
    def window(self) -> Seconds | None:
        """Length in s of the windows that it learned with, None for any."""
        return None

    @property
    def tick(self) -> Seconds | None:
        """Time in s between the windows that its memory learned with, None for none.

        Where a dataset has fewer, a replay gives it those between, as the live loop would.
        """
        return None

    @property
    def string_length(self) -> Metres | None:
        """Length of the string in m if an option states it, else None; sinks draw the string with it."""
        return None

    @property
    def model(self) -> str:
        """Folder or name of the trained model that answers; empty where none does."""
        return ""
