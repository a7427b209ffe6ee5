"""Results keep their rows together."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.evaluation.results import Results, join

Oracle = Callable[..., Results]


def test_rows_are_chosen_in_every_column(oracle: Oracle) -> None:
    results = oracle()
    rows = results.of_trials("session") == "take2"
    part = results.where(rows)
    assert len(part) == rows.sum() == 200
    assert set(part.of_trials("session")) == {"take2"}
    np.testing.assert_array_equal(part.label("force"), results.label("force")[rows])
    np.testing.assert_array_equal(part.why["slip"], results.why["slip"][rows])


def test_what_a_trial_does_not_tell_is_not_a_number(oracle: Oracle) -> None:
    assert np.isnan(oracle().of_trials("radius")).all()
    assert oracle().of_trials("day").max() == 2


def test_an_oracle_is_never_wrong_and_an_unknown_estimate_is_missing(oracle: Oracle) -> None:
    results = oracle()
    assert np.nanmax(np.abs(results.error_of("position"))) == 0.0
    assert np.isnan(results.estimate("torque")).all()
    assert np.isnan(results.error_of("torque")).all()


def test_joined_results_keep_reasons_and_lack_what_one_part_lacks(oracle: Oracle) -> None:
    one = oracle()
    other = replace(
        one,
        reasons=("", "gap", "no contact"),
        why={name: np.where(column > 0, 2, 0).astype(np.int16) for name, column in one.why.items()},
        value={name: column for name, column in one.value.items() if name != "slip"},
        notes=("added noise",),
    )
    both = join([one, other])
    assert both.notes == ("added noise",)
    assert both.trial.max() == 11
    told = [both.reasons[number] for number in both.why["position"].tolist()]
    assert told[: len(one)] == told[len(one) :]
    assert np.isnan(both.estimate("slip")[len(one) :]).all()


def test_results_of_two_estimators_are_not_joined(oracle: Oracle) -> None:
    with pytest.raises(InputError, match="beside oracle: allowed is one estimator"):
        join([oracle(), replace(oracle(), estimator="other")])
    with pytest.raises(InputError, match="no results to join"):
        join([])
