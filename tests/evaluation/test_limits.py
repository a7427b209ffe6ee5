"""Limits are those of the string and of the force sensor, not of the estimator."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from monochord.evaluation.limits import against_bound, force_floor
from monochord.evaluation.results import Results
from monochord.physics.sensors import load_sensor
from monochord.sessions import read_session

Oracle = Callable[..., Results]
STRING = load_sensor("prototype").string


def test_errors_stand_beside_the_least_that_is_possible(oracle: Oracle) -> None:
    noisy, noisier = (against_bound(oracle(spread=spread), STRING, "position") for spread in (1.0, 2.0))
    assert noisy is not None
    assert noisier is not None
    assert noisy.bound == noisier.bound > 0.0
    assert noisy.error == pytest.approx(1e-3, rel=0.1)
    assert noisier.times == pytest.approx(2.0 * noisy.times)


def test_a_better_ratio_allows_less(oracle: Oracle) -> None:
    results = oracle(spread=1.0)
    loud, soft = (against_bound(results, STRING, "force", ratio=ratio) for ratio in (40.0, 20.0))
    assert loud is not None
    assert soft is not None
    assert loud.bound == pytest.approx(0.1 * soft.bound)


def test_without_answers_there_is_nothing_to_compare(oracle: Oracle) -> None:
    results = oracle()
    assert against_bound(results.where(results.label("contact") == 0.0), STRING, "force") is None


def test_the_floor_of_the_force_is_that_of_its_readings(sessions: tuple[Path, ...]) -> None:
    session = read_session(sessions[0])
    floor = force_floor(session, 0.1)
    assert floor is not None
    track, labels = session.readings("wrench"), session.labels
    free = np.interp(track.time, labels.time, np.nan_to_num(labels.columns["contact"])) == 0.0
    spread = float(np.std(track.column("fz")[free]))
    assert 0.0 < floor < spread
