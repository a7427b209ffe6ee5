from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import pytest

from monochord.capture.sources.base import Source, Stream
from monochord.core.errors import InputError
from monochord.core.types import Block, Estimate, Prepared, Signal, Window
from monochord.live import LiveRun, WindowSettings
from monochord.live.calibration import medians
from monochord.perception.estimators.base import Estimator


class Levels(Source, Stream):
    """A source whose windows of 10 frames hold one level each."""

    def __init__(self, *levels: float) -> None:
        self.levels = levels

    @contextmanager
    def open(self) -> Generator[Stream]:
        yield self

    @property
    def signal(self) -> Signal:
        return Signal(sample_rate=1000, channels=1)

    def __iter__(self) -> Iterator[Block]:
        for k, level in enumerate(self.levels):
            yield Block(samples=np.full((1, 10), level, np.float32), start=10 * k)


@dataclass(frozen=True, kw_only=True)
class Level(Estimator):
    """The level as a frequency; negative levels are silence."""

    def prepare(self, signal: Signal, size: int) -> Prepared:
        def estimate(window: Window) -> dict[str, Estimate]:
            level = float(window.samples[0, 0])
            if level < 0.0:
                return {"frequency": Estimate.abstain("Hz", "silence")}
            return {"frequency": Estimate(value=level, std=1.0, unit="Hz")}

        return estimate


def take(*levels: float) -> LiveRun:
    window = WindowSettings(length=0.01, hop=0.01)
    return LiveRun(source=Levels(*levels), estimator=Level(), window=window)


def test_the_median_over_the_windows_that_have_a_frequency() -> None:
    assert medians(take(-1, 110, 112, 900, 111, -1, -1, -1)) == {"frequency": 111.5}
    assert medians(take(-1, 110, 112, 900)) == {"frequency": 112.0}


@dataclass(frozen=True, kw_only=True)
class Deaf(Estimator):
    """Tells nothing at all."""

    def prepare(self, signal: Signal, size: int) -> Prepared:
        return lambda window: {}  # noqa: ARG005


def test_a_take_without_a_frequency_is_refused() -> None:
    deaf = LiveRun(source=Levels(1.0), estimator=Deaf(), window=WindowSettings(length=0.01, hop=0.01))
    for silent in (take(-1, -1), take(), deaf):
        with pytest.raises(InputError):
            medians(silent)
