"""Delays, false alarms, errors and lag of what is followed, on predictions whose answers are known."""

import math
from dataclasses import replace

import numpy as np
import pytest
from studies._onsets import PARTS, Recorded, WithNoise, errors, onsets, record

from monochord.capture.sources import SOURCES
from monochord.core.errors import InputError
from monochord.core.types import Estimate, Floats, Prediction, Truth
from monochord.live import LiveRun
from monochord.live.filter import FilterSettings
from monochord.perception.estimators import ESTIMATORS

HOP, WINDOW = 0.01, 0.1
SETTINGS = FilterSettings()


def take(
    touched: Floats,
    probability: Floats,
    position: Floats | None = None,
    std: float = 3e-4,
    error: Floats | float = 0.0,
    unknown: range = range(0),
) -> Recorded:
    """Return windows (n,) whose last hop is touched or not, with the estimates of each."""
    count = len(touched)
    true = np.full(count, 0.08) if position is None else position
    place = true + error
    predictions, truth = list[Prediction](), list[Truth]()
    for k in range(count):
        estimates = {
            "contact": Estimate(value=float(probability[k]), std=0.1, unit=""),
            "slip": Estimate(value=0.02, std=0.1, unit=""),
            "position": Estimate(value=float(place[k]), std=std, unit="m"),
        }
        predictions.append(Prediction(start=441 * k, time=HOP * k, estimates=estimates))
        truth.append({"contact": 1.0, "position": float(true[k])} if touched[k] else {"contact": 0.0})
        if k in unknown:
            truth[-1] = {}
    fine = np.repeat(touched, PARTS) > 0.5
    time = WINDOW + HOP * np.arange(1 - PARTS, (count - 1) * PARTS + 1) / PARTS
    return Recorded(
        predictions=tuple(predictions),
        truth=tuple(truth),
        window=WINDOW,
        hop=HOP,
        time=time,
        touched=fine,
        slides=np.zeros(len(fine), bool),
    )


TOUCHED = np.concatenate([np.zeros(50), np.ones(100), np.zeros(50)])
LATE = np.where(np.roll(TOUCHED, 3) > 0.5, 0.95, 0.05)
"""Estimates that show a touch three windows late."""


def test_the_delay_of_single_windows_is_that_of_their_estimates() -> None:
    seen = onsets([take(TOUCHED, LATE)], "contact", 0.5, None)
    assert seen.median == pytest.approx(0.03, abs=HOP)
    assert (seen.missed, seen.false_alarms, seen.events) == (0.0, 0.0, 1)


def test_following_costs_little_delay_and_ends_false_alarms() -> None:
    flicker = LATE.copy()
    flicker[[10, 20, 30, 180]] = 0.9
    single = onsets([take(TOUCHED, flicker)], "contact", 0.5, None)
    followed = onsets([take(TOUCHED, flicker)], "contact", 0.5, SETTINGS)
    assert single.false_alarms == pytest.approx(4 / (200 * HOP / 60.0))
    assert followed.false_alarms == 0.0
    assert single.median < followed.median <= single.median + 0.03


def test_an_alarm_where_the_truth_is_not_known_is_none() -> None:
    taps = LATE.copy()
    taps[[20, 180]] = 0.9
    seen = onsets([take(TOUCHED, taps, unknown=range(15, 25))], "contact", 0.5, None)
    assert seen.false_alarms == pytest.approx(1 / ((200 - 30) * HOP / 60.0))


def test_what_is_never_decided_is_missed() -> None:
    seen = onsets([take(TOUCHED, 0.0 * LATE + 0.1)], "contact", 0.5, SETTINGS)
    assert seen.missed == 1.0
    assert math.isnan(seen.median)
    assert onsets([take(TOUCHED, LATE)], "slip", 0.5, SETTINGS).events == 0


def test_errors_of_held_and_moving_touches_are_apart() -> None:
    held = np.full(200, 0.08)
    moving: Floats = np.linspace(0.05, 0.11, 200)
    noise: Floats = np.random.default_rng(1).normal(0.0, 2e-4, 200)
    plain = errors([take(TOUCHED, LATE, held), take(TOUCHED, LATE, moving)], "position", SETTINGS)
    assert (plain.raw, plain.windows, plain.raw_answered) == (0.0, 200, 1.0)
    assert (plain.tracked_held, plain.tracked_moving) == (0.0, 0.0)
    noisy = errors([take(TOUCHED, LATE, held, error=noise)], "position", SETTINGS)
    assert noisy.tracked_held == noisy.raw_held > 1e-4
    assert math.isnan(noisy.tracked_moving)


def test_errors_need_a_touch() -> None:
    with pytest.raises(InputError, match="touch"):
        errors([take(0.0 * TOUCHED, LATE)], "position", SETTINGS)


def test_a_run_is_recorded_with_what_is_true() -> None:
    script = [{"start": 0.3, "position": 0.08, "force": 1.0, "seconds": 0.4}]
    twin = SOURCES.build("twin", {"speed": 0.0, "duration": 1.0, "script": script})
    setup = LiveRun(source=twin, estimator=ESTIMATORS.build("closed_form"))
    plain = record(setup)
    begun = plain.time[np.argmax(plain.touched)]
    assert begun == pytest.approx(0.3, abs=0.02)
    assert len(plain.time) == PARTS * len(plain.predictions)
    positions = [each["position"] for each in plain.truth if "position" in each]
    assert positions == pytest.approx([0.08] * len(positions), abs=1e-3)
    assert positions
    noise = np.random.default_rng(0).standard_normal(1000).astype(np.float32)
    noisy = record(replace(setup, source=WithNoise(source=twin, sound=noise, gain=0.1)))
    assert [each.time for each in noisy.predictions] == [each.time for each in plain.predictions]
    assert noisy.predictions[5].estimates != plain.predictions[5].estimates
    silent = record(replace(setup, source=WithNoise(source=twin, sound=noise, gain=0.0)))
    assert repr([each.estimates for each in silent.predictions]) == repr(
        [each.estimates for each in plain.predictions]
    )


def test_noise_without_frames_is_refused() -> None:
    source = WithNoise(source=SOURCES.build("twin"), sound=np.zeros(0, np.float32))
    with pytest.raises(InputError, match="frames"):
        record(LiveRun(source=source, estimator=ESTIMATORS.build("closed_form")))
