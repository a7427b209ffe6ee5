"""The study of a skin, kept short: what it measures is what the page promises."""

import pytest
from studies.skin import Skin


@pytest.mark.slow
def test_the_wrench_is_exact_and_its_covariance_that_of_many_errors() -> None:
    rows = {row.name: row.value for row in Skin(strings=2, touches=1, draws=8000, world="ideal").run()}
    assert rows["adjoint, largest error"] <= 2.3e-16
    for name in ("least", "most"):
        assert rows[f"variances, Monte Carlo over stated, {name}"] == pytest.approx(1.0, abs=0.05)
    assert rows["windows whose touched strings are right"] > 90.0
    assert rows["point, median error"] < 1.0
    assert 0.0 < rows["its combining alone"] < rows["an update, processor time"]
    assert rows["updates in real time"] > 0.0
