"""Results keep their rows together, in memory and on disk."""

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.evaluation.conftest import Oracle

from monochord.core.errors import InputError
from monochord.evaluation.results import join, read_results, write_csv, write_results


def test_where_selects_rows_of_every_column(oracle: Oracle) -> None:
    results = oracle()
    rows = results.of_trials("session") == "take2"
    part = results.where(rows)
    assert len(part) == rows.sum() == 200
    assert set(part.of_trials("session")) == {"take2"}
    np.testing.assert_array_equal(part.label("force"), results.label("force")[rows])
    np.testing.assert_array_equal(part.reason_index["slip"], results.reason_index["slip"][rows])


def test_unknown_fields_and_estimates_are_nan(oracle: Oracle) -> None:
    results = oracle()
    assert np.isnan(results.of_trials("radius")).all()
    assert results.of_trials("day").max() == 2
    assert np.nanmax(np.abs(results.error_of("position"))) == 0.0
    assert np.isnan(results.error_of("torque")).all()


def test_join_renumbers_reasons_and_fills_missing_columns(oracle: Oracle) -> None:
    one = oracle()
    other = replace(
        one,
        reasons=("", "gap", "no contact"),
        reason_index={
            name: np.where(column > 0, 2, 0).astype(np.int16) for name, column in one.reason_index.items()
        },
        value={name: column for name, column in one.value.items() if name != "slip"},
        notes=("added noise",),
    )
    both = join([one, other])
    assert (both.notes, both.trial.max()) == (("added noise",), 11)
    reasons = [both.reasons[number] for number in both.reason_index["position"].tolist()]
    assert reasons[: len(one)] == reasons[len(one) :]
    assert np.isnan(both.estimate("slip")[len(one) :]).all()


def test_join_refuses_nothing_and_two_estimators(oracle: Oracle) -> None:
    with pytest.raises(InputError, match="oracle"):
        join([oracle(), replace(oracle(), estimator="other")])
    with pytest.raises(InputError):
        join([])


def test_a_file_returns_what_was_written(oracle: Oracle, tmp_path: Path) -> None:
    results = oracle(spread=1.0)
    write_results(results, tmp_path / "results.npz")
    read = read_results(tmp_path / "results.npz")
    assert (read.estimator, read.trials, read.reasons) == (results.estimator, results.trials, results.reasons)
    for kind in ("truth", "value", "std", "reason_index"):
        for name, column in getattr(results, kind).items():
            np.testing.assert_array_equal(getattr(read, kind)[name], column)
    np.testing.assert_array_equal(read.start, results.start)


def test_the_table_has_a_row_a_window_and_reasons(oracle: Oracle, tmp_path: Path) -> None:
    results = oracle()
    write_csv(results, tmp_path / "results.csv")
    with (tmp_path / "results.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(results)
    assert (rows[0]["position"], rows[0]["position_why_not"]) == ("", "no contact")
    assert float(rows[10]["true_force"]) == pytest.approx(results.label("force")[10], rel=1e-8)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda path: path.unlink(),
        lambda path: path.write_bytes(path.read_bytes()[:200]),
        lambda path: np.savez(path, start=np.zeros(3)),
        lambda path: np.savez(path, about=np.array('{"format": 1, "trials": 3}'), start=np.zeros(3)),
        lambda path: np.savez(path, about=np.array('{"format": 99}')),
        lambda path: np.savez(path, about=np.array("[]"), trial=np.zeros(2), start=np.zeros(3)),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(
    oracle: Oracle, tmp_path: Path, spoil: Callable[[Path], object]
) -> None:
    path = tmp_path / "results.npz"
    write_results(oracle(), path)
    spoil(path)
    with pytest.raises(InputError, match=path.name):
        read_results(path)
