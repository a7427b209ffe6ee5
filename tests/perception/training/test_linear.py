"""The linear path: a robust ridge regression whose residuals are of windows that it did not see."""

import numpy as np
import pytest

from monochord.perception.training.linear import folds_of, solve


def rows(count: int, width: int = 6, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(count, width)).astype(np.float32)


TRUE = np.array([1.0, -2.0, 0.0, 0.5, 3.0, 0.0])


def test_outliers_do_not_pull_it() -> None:
    clean = rows(500)
    label = clean @ TRUE + 0.3
    label[::20] += 50.0
    path = solve([clean], label, np.arange(500) % 5)
    np.testing.assert_allclose(path.weight, TRUE, atol=1e-2)
    assert path.bias == pytest.approx(0.3, abs=1e-2)


def test_the_residual_of_few_windows_is_that_of_new_ones() -> None:
    rng = np.random.default_rng(1)
    few, many = rows(40, 60), rows(2000, 60, seed=2)
    weight = rng.normal(size=60)
    label, truth = few @ weight, many @ weight
    path = solve([few], label, np.arange(40) // 8)
    own, new = (np.abs(x @ path.weight + path.bias - y).mean() for x, y in ((few, label), (many, truth)))
    assert own < 0.7 * path.residual
    assert path.residual == pytest.approx(new, rel=0.5)


def test_very_few_windows_give_finite_numbers() -> None:
    for count in (1, 2, 3):
        fold = folds_of(np.zeros(count, np.int64), np.zeros(count, np.int64))
        path = solve([rows(count)], np.arange(count, dtype=float), fold)
        assert np.isfinite([*path.weight, path.residual]).all()


def test_a_touch_or_a_session_is_in_one_fold() -> None:
    touch = np.repeat(np.arange(12), 5)
    for session in (np.zeros(60, np.int64), np.repeat(np.arange(6), 10)):
        fold = folds_of(session, touch)
        assert 2 <= len(np.unique(fold)) <= 5
        group = touch if session.max() == 0 else session
        assert all(len(np.unique(fold[group == each])) == 1 for each in np.unique(group))
