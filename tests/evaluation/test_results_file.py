"""Results come back from disk as they were, and what is no such file is told in a line."""

import csv
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.evaluation.results import Results
from monochord.evaluation.results import read_results, write_csv, write_results

Oracle = Callable[..., Results]


def test_results_come_back_as_they_were(oracle: Oracle, tmp_path: Path) -> None:
    told = oracle(spread=1.0)
    write_results(told, tmp_path / "results.npz")
    back = read_results(tmp_path / "results.npz")
    assert (back.estimator, back.trials, back.reasons) == (told.estimator, told.trials, told.reasons)
    for kind in ("truth", "value", "std", "why"):
        for name, column in getattr(told, kind).items():
            np.testing.assert_array_equal(getattr(back, kind)[name], column)
    np.testing.assert_array_equal(back.start, told.start)


def test_the_table_has_a_row_a_window_and_says_why_there_is_no_estimate(
    oracle: Oracle, tmp_path: Path
) -> None:
    told = oracle()
    write_csv(told, tmp_path / "results.csv")
    with (tmp_path / "results.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(told)
    assert rows[0]["position"] == ""
    assert rows[0]["position_why_not"] == "no contact"
    assert float(rows[10]["true_force"]) == pytest.approx(told.label("force")[10], rel=1e-8)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda path: path.unlink(),
        lambda path: path.write_bytes(path.read_bytes()[:200]),
        lambda path: path.write_text("no archive"),
        lambda path: np.savez(path, start=np.zeros(3)),
        lambda path: np.savez(path, about=np.array('{"format": 1}'), start=np.zeros(3)),
        lambda path: np.savez(path, about=np.array('{"format": 1, "trials": 3}'), start=np.zeros(3)),
        lambda path: np.savez(path, about=np.array('{"format": 99}')),
        lambda path: np.savez(path, about=np.array("[]"), trial=np.zeros(2), start=np.zeros(3)),
    ],
)
def test_a_file_that_is_none_is_told_in_a_line(
    oracle: Oracle, tmp_path: Path, spoil: Callable[[Path], object]
) -> None:
    path = tmp_path / "results.npz"
    write_results(oracle(), path)
    spoil(path)
    with pytest.raises(InputError, match="results") as told:
        read_results(path)
    assert "\n" not in str(told.value)
