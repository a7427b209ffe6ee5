"""What is claimed under music and speech, held by a test."""

import numpy as np
import pytest
from studies.interference import Interference, drawn, string_errors

from monochord.evaluation import folder, takes

real = pytest.mark.skipif(folder() is None, reason="no real recordings (MONOCHORD_REALSTRINGS)")

BOUNDS = {20.0: (93.0, 99.5), 10.0: (88.0, 99.0), 5.0: (75.0, 98.0), 0.0: (45.0, 98.0)}
"""Per ratio in dB: least share answered, and least share of the answers within 5 mm, in %."""


@pytest.mark.slow
@real
@pytest.mark.parametrize("ratio", BOUNDS)
def test_answers_enough_and_rightly(ratio: float) -> None:
    answered, near = BOUNDS[ratio]
    for row in Interference(ratios=(ratio,)).run():
        least = near if row.name.endswith("within 5 mm") else answered
        assert row.value >= least, row


@pytest.mark.slow
@real
def test_realstrings_draws_every_string_and_a_curve_for_each_interference() -> None:
    by_string = string_errors()
    assert len(by_string) >= 2
    errors = np.concatenate([e for own in by_string.values() for _, e in own])
    assert np.nanmean(np.abs(errors)) < 1.6e-3
    curves = drawn(ratios=(20.0,)).axes[1]
    assert len(curves.lines) == 3 * len(takes(kind="interference"))
