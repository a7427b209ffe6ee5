"""A row of figures says what its results are, whatever they are of."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from studies._rows import KEYS, keep_summary, read_summary, summary_row, write_summary_csv
from studies.hardware_suite import hardware_page

from monochord.core.errors import InputError
from monochord.evaluation.results import Results


def off(results: Results, name: str, rows: np.ndarray, by: float) -> Results:
    """Return results whose estimates are off in some rows."""
    value = results.value[name].copy()
    value[rows] += by
    return replace(results, value={**results.value, name: value})


def touched(results: Results) -> np.ndarray:
    return np.flatnonzero(results.label("contact") == 1.0)


def of_builds(results: Results, builds: int) -> Results:
    trials = tuple(replace(trial, build=at % builds) for at, trial in enumerate(results.trials))
    return replace(results, trials=trials)


def test_an_oracle_is_right_and_knows_it(oracle: Any) -> None:
    row = summary_row(oracle(), model="oracle", world="ideal", touches=5, condition="clean")
    assert tuple(row)[: len(KEYS)] == KEYS
    assert (row["position_mae_mm"], row["force_mae_n"]) == (0.0, 0.0)
    assert all(row[name] == 1.0 for name in ("position_within_5mm", "contact_accuracy", "slip_auc"))
    assert (row["coverage_1se"], row["gross_share"], row["answered"], row["builds"]) == (1.0, 0.0, 1.0, 1)
    assert (row["touches"], row["n"]) == (5, len(touched(oracle())))


def test_coverage_is_of_normal_errors_and_overconfidence_shows(oracle: Any) -> None:
    honest = summary_row(oracle(spread=1.0), model="honest", draws=0)
    assert honest["coverage_1se"] == pytest.approx(0.683, abs=0.03)
    assert honest["coverage_2se"] == pytest.approx(0.954, abs=0.02)
    assert honest["position_mae_mm"] == pytest.approx(np.sqrt(2.0 / np.pi), rel=0.05)
    assert honest["gross_share"] == 0.0
    bold = summary_row(oracle(spread=3.0), model="bold", draws=0)
    assert bold["coverage_1se"] == pytest.approx(0.261, abs=0.03)
    assert bold["gross_share"] == pytest.approx(1.0 - (1.0 - 0.0956) ** 2, abs=0.03)


def test_gross_errors_are_counted_by_window_and_abstentions_are_no_answers(oracle: Any) -> None:
    results, at = oracle(), touched(oracle())
    wrong = off(off(results, "position", at[:30], 6e-3), "force", at[20:40], -1.0)
    row = summary_row(wrong, model="wrong", draws=0)
    assert row["gross_share"] == pytest.approx(40 / len(at), rel=1e-3)
    assert row["position_within_5mm"] == pytest.approx(1.0 - 30 / len(at), rel=1e-3)
    assert summary_row(off(results, "position", at, 4.9e-3), model="close", draws=0)["gross_share"] == 0.0
    silent = off(wrong, "force", at[:100], np.nan)
    row = summary_row(silent, model="silent", draws=0)
    assert row["answered"] == pytest.approx(1.0 - 100 / len(at), rel=1e-3)
    assert row["gross_share"] == pytest.approx(30 / len(at), rel=1e-3)
    assert row["position_within_5mm"] == pytest.approx(1.0 - 30 / len(at), rel=1e-3)


def test_no_standard_errors_and_no_estimates_leave_blanks(oracle: Any) -> None:
    results = oracle()
    bare = replace(results, std={name: np.full(len(results), np.nan) for name in results.std})
    row = summary_row(bare, model="bare")
    assert row["coverage_1se"] is row["gross_share"] is None
    assert row["position_mae_mm"] == 0.0
    mute = replace(results, value={name: np.full(len(results), np.nan) for name in results.value})
    row = summary_row(mute, model="mute")
    assert row["position_mae_mm"] is row["coverage_1se"] is None
    assert (row["answered"], row["position_within_5mm"], row["contact_accuracy"]) == (0.0, 0.0, 0.0)


def test_intervals_draw_builds_where_there_are_enough(oracle: Any) -> None:
    few, many = (of_builds(oracle(objects=("plastic",) * 12, spread=1.0), count) for count in (3, 6))
    assert [summary_row(each, model="m")["drawn"] for each in (few, many)] == ["sessions", "builds"]
    assert summary_row(many, model="m")["builds"] == 6
    one_bad = off(many, "position", np.flatnonzero(many.of_trials("build") == 0), 20e-3)
    low, high = summary_row(one_bad, model="m")["intervals"]["position_mae_mm"]
    assert low < 2.0  # some draws have no bad build
    assert high > 5.0  # some have two


def test_rows_are_kept_beside_others_and_replaced_by_their_labels(oracle: Any, tmp_path: Path) -> None:
    file = tmp_path / "rows.json"
    first = [summary_row(oracle(), model=name, condition="clean") for name in ("a", "b")]
    keep_summary(file, first, hardware_page)
    again = summary_row(oracle(spread=1.0), model="a", condition="clean")
    keep_summary(file, [again, {**again, "condition": "motors"}], hardware_page)
    rows = read_summary(file)
    assert [(row["model"], row["condition"]) for row in rows] == [
        ("a", "clean"),
        ("b", "clean"),
        ("a", "motors"),
    ]
    assert rows[0] == json.loads(json.dumps(again))
    assert "motors" in file.with_suffix(".md").read_text()
    write_summary_csv(tmp_path / "rows.csv", rows)
    head, *lines = (tmp_path / "rows.csv").read_text().splitlines()
    assert head.split(",")[: len(KEYS)] == list(KEYS)
    assert len(lines) == 3
    for text in ('[{"model": "a"}]', "["):
        file.write_text(text)
        with pytest.raises(InputError, match="rows"):
            read_summary(file)
