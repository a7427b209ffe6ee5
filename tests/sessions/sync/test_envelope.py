"""The line under a cloud of points: below all of them, and as near to them as can be."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from monochord.sessions.sync.arrival import BINS, line_under


@given(st.integers(0, 10_000), st.integers(2, 60))
def test_it_is_the_solution_of_the_linear_programme(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-1.0, 1.0, count), rng.exponential(1.0, count)
    a, b = line_under(x, y)
    assert (a + b * x <= y + 1e-9).all()
    best = linprog(
        [-count, -x.sum()], A_ub=np.stack([np.ones(count), x], axis=1), b_ub=y, bounds=[(None, None)] * 2
    )
    assert count * a + b * x.sum() == pytest.approx(-best.fun, abs=1e-6)


def test_many_points_are_thinned_without_loss() -> None:
    rng = np.random.default_rng(2)
    x = rng.uniform(-30.0, 30.0, 50 * BINS)
    delays = rng.exponential(3e-4, x.size)
    a, b = line_under(x, 0.01 + 2e-6 * x + delays)
    assert a == pytest.approx(0.01, abs=2e-6)
    assert b == pytest.approx(2e-6, abs=1e-7)


def test_points_at_one_place_have_a_level_line() -> None:
    assert line_under(np.ones(3), np.array([3.0, 1.0, 2.0])) == (1.0, 0.0)
