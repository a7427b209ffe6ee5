"""Rows of features stand in one file, each feature's once."""

from collections.abc import Callable
from pathlib import Path

import pytest

from monochord.core.errors import InputError
from monochord.evaluation.paper_rows import keep_rows, paper_rows
from monochord.evaluation.results import Results
from monochord.evaluation.scorecard import scorecard

Oracle = Callable[..., Results]
NAMES = {
    "feature",
    "object",
    "condition",
    "part",
    "position_mae_mm",
    "position_within_5mm",
    "position_r",
    "force_mae_n",
    "force_within_0_2n",
    "force_r",
    "contact_accuracy",
    "slip_auc",
    "n",
}


def test_an_oracles_rows_are_perfect(oracle: Oracle) -> None:
    rows = paper_rows(scorecard(oracle(objects=("wood", "plastic")), draws=0), "oracle")
    assert [row["object"] for row in rows] == ["plastic", "wood", "all objects"]
    for row in rows:
        assert set(row) >= NAMES
        assert (row["position_mae_mm"], row["force_within_0_2n"], row["slip_auc"]) == (0.0, 1.0, 1.0)
        assert row["simulated"]


def test_a_feature_takes_the_place_of_what_it_had(oracle: Oracle, tmp_path: Path) -> None:
    file = tmp_path / "rows.json"
    card = scorecard(oracle(objects=("wood",)), draws=0)
    keep_rows(file, paper_rows(card, "one"))
    keep_rows(file, paper_rows(card, "other"))
    kept = keep_rows(file, paper_rows(scorecard(oracle(objects=("metal",)), draws=0), "one"))
    assert [(row["feature"], row["object"]) for row in kept] == [("one", "metal"), ("other", "wood")]


def test_a_file_that_holds_something_else_is_left_alone(tmp_path: Path) -> None:
    file = tmp_path / "rows.json"
    file.write_text('{"mine": 1}')
    with pytest.raises(InputError, match=r"rows .* \(damaged"):
        keep_rows(file, [])
    assert file.read_text() == '{"mine": 1}'
