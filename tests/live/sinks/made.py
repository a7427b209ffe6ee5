"""An update as a run hands it to its sinks."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from monochord.core.types import Audio, Estimate, Prediction, Signal, StreamHealth, Window
from monochord.live.update import Update

SIGNAL = Signal(sample_rate=44100, channels=2)
SILENCE = np.zeros((2, 4410), np.float32)


def window_update(
    number: int, estimates: Mapping[str, Estimate] | None = None, samples: Audio = SILENCE, **more: Any
) -> Update:
    """Return the update of a window by its number, at a hop of 10 ms."""
    prediction = Prediction(start=441 * number, time=number / 100, estimates=estimates or {}, latency=2e-3)
    window = Window(samples=samples, start=441 * number, sample_rate=44100)
    usual: dict[str, Any] = {"health": StreamHealth(), "truth": {}, "skipped": 0}
    return Update(prediction=prediction, window=window, **(usual | more))


def update(
    estimates: Mapping[str, Estimate], truth: Mapping[str, float] | None = None, **more: Any
) -> Update:
    """Return the second window's update in a stream with xruns and a gap, of a run that skipped windows."""
    health = StreamHealth(dropped=64, gaps=1, xruns=5)
    return window_update(1, estimates, health=health, truth=truth or {}, skipped=3, **more)
