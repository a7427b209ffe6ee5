import math

import numpy as np
import pytest

from monochord.live import Score
from monochord.sinks.base import Moment
from monochord.types import Estimate, Prediction, Signal, StreamHealth, Window

WINDOW = Window(samples=np.zeros((2, 10), np.float32), start=0, sample_rate=44100)


def moment(position: float | None, truth: dict[str, float]) -> Moment:
    estimate = (
        Estimate.abstain("m", "silence") if position is None else Estimate(value=position, std=0.0, unit="m")
    )
    return Moment(
        prediction=Prediction(start=0, time=0.0, estimates={"position": estimate}),
        window=WINDOW,
        health=StreamHealth(),
        truth=truth,
        skipped=0,
    )


def test_settled_windows_with_a_touch_count() -> None:
    score = Score()
    touch = {"contact": 1.0, "position": 0.2, "settled": 1.0}
    with score.open(Signal(sample_rate=44100, channels=2)) as writer:
        for position in (0.201, 0.197, 0.2, 0.21):
            writer.write(moment(position, touch))
        writer.write(moment(None, touch))
        writer.write(moment(0.5, {**touch, "settled": 0.0}))
        writer.write(moment(0.5, {"contact": 0.0}))
        writer.write(moment(0.5, {}))
    assert score.median_error() == pytest.approx(0.002)
    assert score.abstained == 1
    assert score.tree() == {"median_error": pytest.approx(0.002), "answered": 4, "abstained": 1}
    assert score.lines() == [
        "settled windows with a touch: 4 answered, 1 abstained",
        "position error against truth: median 2.00 mm, 75.0 % within 5 mm",
    ]


def test_nothing_to_score() -> None:
    score = Score()
    score.write(moment(None, {"contact": 1.0, "position": 0.2}))
    assert math.isnan(score.median_error())
    assert score.tree()["median_error"] is None
    assert score.lines() == ["settled windows with a touch: 0 answered, 1 abstained"]
