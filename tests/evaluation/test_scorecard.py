"""A scorecard holds all tables of an evaluation, its baselines and its limits."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tests.evaluation.conftest import STRING, Oracle

from monochord.core.errors import InputError
from monochord.evaluation.limits import compare_with_bound, force_floor
from monochord.evaluation.paper import keep_rows, paper_rows
from monochord.evaluation.results import Results, join
from monochord.evaluation.scorecard import EVERYTHING, abstentions, error_map, scorecard
from monochord.sessions import read_session

OBJECTS = ("plastic", "plastic", "wood", "wood", "wood", "metal")


def in_music(results: Results, ratio: float | None = None) -> Results:
    trials = tuple(replace(trial, noise="music", ratio=ratio) for trial in results.trials)
    return replace(results, trials=trials)


def test_the_table_has_every_object_condition_and_state(oracle: Oracle) -> None:
    results = oracle(objects=OBJECTS)
    conditions = {"clean", "music", "music 10 dB"}
    card = scorecard(join([results, in_music(results), in_music(results, 10.0)]), string=STRING, draws=0)
    assert {row.condition for row in card.table} == conditions
    assert {row.object for row in card.table} == {"plastic", "wood", "metal", EVERYTHING}
    assert len(card.table) == 4 * 3 * 3
    for row in card.table:
        for score in (row.position, row.force):
            assert (score.mae.value, score.within.value, score.answered) == (0.0, 1.0, 1.0)
    for scores in (card.contact, card.slip):
        assert set(scores) == {*OBJECTS, EVERYTHING}
        assert all(set(by_condition) == conditions for by_condition in scores.values())
        assert all(one.accuracy.value == 1.0 for each in scores.values() for one in each.values())
    rows = [card.row("wood", state=state) for state in ("touched", "at rest", "sliding")]
    windows = [row.position.windows for row in rows if row]
    assert windows[0] == 3 * 3 * 140 / 3 == windows[1] + windows[2]
    assert card.row("wood", "rain") is None


def test_baselines_have_tables_of_their_own(oracle: Oracle) -> None:
    results = oracle(objects=OBJECTS)
    worse = replace(results, value={**results.value, "force": results.estimate("force") + 0.5})
    card = scorecard(results, baselines={"ridge": worse}, draws=0)
    (row,) = [row for row in card.baselines["ridge"].table if row.object == EVERYTHING]
    assert (row.state, row.position.mae.value) == ("touched", 0.0)
    assert row.force.mae.value == pytest.approx(0.5)
    rows = paper_rows(card, "fft_harmonic")
    errors = {row["feature"]: row["force_mae_n"] for row in rows if row["object"] == EVERYTHING}
    assert errors == {"fft_harmonic": 0.0, "fft_harmonic, ridge": 0.5}


def test_scores_are_split_by_day_build_radius_and_session(oracle: Oracle) -> None:
    results = oracle(objects=OBJECTS)
    worse = results.estimate("force") + np.where(results.of_trials("day") == 2, 0.5, 0.0)
    card = scorecard(replace(results, value={**results.value, "force": worse}), draws=0)
    days = {day: scores["force"].mae.value for day, scores in card.by["day"].items()}
    assert days == pytest.approx({"0": 0.0, "1": 0.0, "2": 0.5})
    assert set(card.by["session"]) == {f"take{number}" for number in range(6)}
    assert card.by["radius"] == {}


def test_scores_are_split_by_the_mounts_that_sessions_name(oracle: Oracle) -> None:
    results = oracle()
    assert "mount" not in scorecard(results, draws=0).by
    kinds = ("soft", "bolted") * len(results.trials)
    trials = tuple(replace(one, mount=kind) for one, kind in zip(results.trials, kinds, strict=False))
    by = scorecard(replace(results, trials=trials), draws=0).by["mount"]
    assert {*by} == {"bolted", "soft"}
    assert by["soft"]["force"].mae.value == 0.0


def test_an_error_map_shows_where_errors_are(oracle: Oracle) -> None:
    results = oracle()
    truth = results.label("position")
    values = truth + np.where(truth > 0.1, 0.004, 0.0)
    errors = error_map(replace(results, value={"position": values}), "position", "clean")
    cells = np.array([[np.nan if value is None else value for value in row] for row in errors.error])
    middle = 0.5 * (np.array(errors.positions)[1:] + np.array(errors.positions)[:-1])
    assert np.nanmax(cells[:, middle < 0.09]) == 0.0
    assert np.nanmin(cells[:, middle > 0.11]) == pytest.approx(0.004)
    assert np.sum(errors.windows) == np.sum(errors.answered) == 6 * 140


def test_abstentions_are_counted_by_reason(oracle: Oracle) -> None:
    results = oracle()
    reason_index = {**results.reason_index, "force": np.arange(len(results), dtype=np.int16) % 2}
    assert abstentions(replace(results, reason_index=reason_index))["force"] == pytest.approx(
        {"no contact": 0.5}, abs=0.01
    )


def test_the_tree_is_what_json_returns(oracle: Oracle) -> None:
    results = oracle(objects=("wood",), spread=1.0)
    silent = replace(results, value={name: np.full(len(results), np.nan) for name in results.value})
    for each in (results, silent):
        tree = scorecard(each, string=STRING, force_floor={"take0": 0.01}, draws=20).tree()
        assert json.loads(json.dumps(tree, allow_nan=False)) == tree


def test_errors_scale_against_the_cramer_rao_bound(oracle: Oracle) -> None:
    one, two = (compare_with_bound(oracle(spread=spread), STRING, "position") for spread in (1.0, 2.0))
    assert one is not None
    assert two is not None
    assert one.bound == two.bound > 0.0
    assert one.error == pytest.approx(1e-3, rel=0.1)
    assert two.times == pytest.approx(2.0 * one.times)
    # A position known to a tenth of a millimetre at either end is known no better by any sound.
    assert 0.05e-3 < one.bound_built < 0.15e-3
    assert one.times_built == pytest.approx(one.error / one.bound_built)
    results = oracle(spread=1.0)
    loud, soft = (compare_with_bound(results, STRING, "force", ratio=ratio) for ratio in (40.0, 20.0))
    assert loud is not None
    assert soft is not None
    assert loud.bound == pytest.approx(0.1 * soft.bound)
    assert compare_with_bound(results.where(results.label("contact") == 0.0), STRING, "force") is None


def test_the_force_floor_is_below_the_scatter_of_readings(sessions: tuple[Path, ...]) -> None:
    session = read_session(sessions[0])
    floor = force_floor(session, 0.1)
    assert floor is not None
    track, labels = session.readings("wrench"), session.labels
    free = np.interp(track.time, labels.time, np.nan_to_num(labels.columns["contact"])) == 0.0
    assert 0.0 < floor < float(np.std(track.column("fz")[free]))


def test_rows_of_a_feature_replace_its_old_ones(oracle: Oracle, tmp_path: Path) -> None:
    file = tmp_path / "rows.json"
    card = scorecard(oracle(objects=("wood", "plastic")), draws=0)
    rows = paper_rows(card, "one")
    assert [row["object"] for row in rows] == ["plastic", "wood", EVERYTHING]
    for row in rows:
        assert (row["position_mae_mm"], row["force_within_0_2n"], row["slip_auc"]) == (0.0, 1.0, 1.0)
        assert (row["part"], row["n"], row["simulated"]) == ("test", row["n"], True)
    keep_rows(file, rows)
    keep_rows(file, paper_rows(card, "other")[:1])
    keep_rows(file, paper_rows(scorecard(oracle(objects=("metal",)), draws=0), "one"))
    stored = json.loads(file.read_text())
    assert [(row["feature"], row["object"]) for row in stored] == [("one", "metal"), ("other", "plastic")]
    assert "one" in file.with_suffix(".md").read_text()
    file.write_text('{"mine": 1}')
    with pytest.raises(InputError, match=file.name):
        keep_rows(file, [])
    assert file.read_text() == '{"mine": 1}'
