"""The untouched reference: what enters it, what does not, and that nothing from later does."""

from collections.abc import Sequence

import numpy as np
import pytest

from monochord.perception.model.context import ModelState, context_row, step
from monochord.perception.model.definition import FeatureRecord, Reference

FEATURE = FeatureRecord(name="untouched", options={}, columns=("pitch", "level"))


def rule(**options: float) -> Reference:
    return Reference(feature=FEATURE, **options)  # pyright: ignore[reportArgumentType]


def fold(rule: Reference, contact: Sequence[float], hop: float = 0.1) -> list[float]:
    """Return the first number of the reference before each window, NaN before any; row k holds k."""
    state, reference = ModelState(), list[float]()
    for k, chance in enumerate(contact):
        row = context_row(state, 3)
        reference.append(float(row[0]) if row[-1] else float("nan"))
        state = step(state, rule, hop * k, chance, lambda k=k: np.array([k, 1.0], np.float32))
    return reference


def test_it_is_the_median_of_windows_before() -> None:
    reference = fold(rule(), [0.0] * 8)
    assert np.isnan(reference[:2]).all()
    assert reference[2:] == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]


def test_windows_that_may_be_touched_do_not_enter() -> None:
    reference = fold(rule(settle=0.0), [0.0, 0.0, 0.9, 0.2, 0.1, 0.0, 0.0])
    assert reference[5:] == [0.0, 0.0]


def test_the_window_just_before_a_touch_does_not_enter() -> None:
    assert fold(rule(), [0.0, 0.0, 1.0, 1.0])[3] == 0.0
    assert fold(rule(guard=0.0, settle=0.0), [0.0, 0.0, 0.0, 1.0, 1.0])[4] == 0.5


def test_after_a_touch_the_string_is_let_settle() -> None:
    touches = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert np.isnan(fold(rule(settle=0.5), touches)).all()
    assert fold(rule(settle=0.2), touches)[-2:] == [2.0, 2.5]


def test_a_finer_hop_gives_the_same_reference() -> None:
    coarse = fold(rule(), [0.0] * 20)
    fine = fold(rule(), [0.0] * 191, hop=0.01)
    assert fine[-1] == pytest.approx(10.0 * coarse[-1])


def test_what_comes_later_changes_nothing_before() -> None:
    rng = np.random.default_rng(0)
    contact = rng.choice([0.0, 1.0], 60, p=[0.8, 0.2]).tolist()
    whole = fold(rule(), contact)
    np.testing.assert_array_equal(fold(rule(), contact[:30]), whole[:30])


def test_the_state_is_bounded() -> None:
    state, hop = ModelState(), 0.01
    for k in range(500):
        state = step(state, rule(), hop * k, 0.0, lambda: np.zeros(2, np.float32))
    assert len(state.rows) == 8
    assert len(state.pending) <= 2


@pytest.mark.parametrize("options", [{"below": 0.0}, {"keep": 0}, {"settle": -1.0}, {"every": 100.0}])
def test_a_rule_that_makes_no_sense_is_refused(options: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(options))):
        rule(**options)
