"""The bundled model on a simulator that it never heard: the paper's split string, with other drivers.

It is driven by two ideal drivers, touched by rigid clamps and heard without crosstalk of its frame or hum.
"""

from pathlib import Path

import numpy as np
import pytest

from monochord.capture.sources import SOURCES
from monochord.live import LiveRun, run
from monochord.live.sinks.base import Listener, Moment
from monochord.perception.estimators.model import ModelEstimator

pytestmark = pytest.mark.slow
SECONDS = 15.0


class Kept(Listener):
    def __init__(self) -> None:
        self.moments: list[Moment] = []

    def write(self, moment: Moment) -> None:
        self.moments.append(moment)


@pytest.mark.parametrize("noise", [0.0, 1e-4, 1e-3])
def test_a_foreign_sensor_is_answered_and_not_taken_for_a_faulty_one(noise: float) -> None:
    options = {"preset": "prototype", "speed": 0.0, "seed": 3, "noise": noise}
    kept, model = Kept(), ModelEstimator(path=Path("demo"))
    source = SOURCES.build("split_string", options)
    run(LiveRun(source=source, estimator=model, sinks=(kept,), seconds=SECONDS))
    steady = [m for m in kept.moments if m.truth.get("transition") == 0.0]
    touched = [m for m in steady if m.truth["contact"] == 1.0]
    positions = [m.prediction.estimate("position") for m in touched]
    off = [abs(e.value - m.truth["position"]) for e, m in zip(positions, touched, strict=True) if e.valid]
    assert len(off) > 0.9 * len(touched)
    assert np.mean(off) < 1e-3
    contact = [m.prediction.estimate("contact") for m in steady]
    right = [
        (e.value > 0.5) == bool(m.truth["contact"]) for e, m in zip(contact, steady, strict=True) if e.valid
    ]
    assert len(right) > 0.9 * len(steady)
    assert np.mean(right) > 0.9
