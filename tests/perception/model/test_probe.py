"""A feature whose code changed after training is found out."""

import dataclasses

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Signal
from monochord.perception.model import Model
from monochord.perception.model.probe import made_up, refuse_another

KEPT = np.random.default_rng(0).normal(size=(3, 40)).astype(np.float32)
SCALE = np.full(40, 2.0, np.float32)


def test_the_windows_are_loud_and_unlike() -> None:
    windows = made_up(2, 4410)
    assert 0.1 < np.abs(windows).max() < 1.0
    assert not np.array_equal(windows[0], windows[2])


def test_rounding_and_a_peak_picked_otherwise_pass() -> None:
    found = KEPT + 1e-4
    found[1, 3] += 50.0
    refuse_another("bands", found, KEPT, SCALE)


@pytest.mark.parametrize("found", [1.5 * KEPT, KEPT[::-1], np.full_like(KEPT, np.nan)])
def test_another_feature_does_not(found: np.ndarray) -> None:
    with pytest.raises(InputError, match="feature 'bands', which is not what it was in training"):
        refuse_another("bands", found, KEPT, SCALE)


def test_a_model_looks_before_it_listens(drawn: Model, signal: Signal) -> None:
    weights = {**drawn.weights, "scaler.probe": drawn.weights["scaler.probe"] + 3.0}
    with pytest.raises(InputError, match="not what it was in training"):
        dataclasses.replace(drawn, weights=weights).open(signal)
