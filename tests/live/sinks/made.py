"""An update as a run hands it to its sinks."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from monochord.core.types import Estimate, Prediction, Signal, StreamHealth, Window
from monochord.live.update import Update

SIGNAL = Signal(sample_rate=44100, channels=2)


def update(
    estimates: Mapping[str, Estimate], truth: Mapping[str, float] | None = None, **more: Any
) -> Update:
    return Update(
        prediction=Prediction(start=441, time=0.01, estimates=estimates, latency=0.002),
        window=Window(samples=np.zeros((2, 4410), np.float32), start=441, sample_rate=44100),
        health=StreamHealth(dropped=64, gaps=1, xruns=5),
        truth=truth or {},
        skipped=3,
        **more,
    )
