"""A scorecard holds every table; an oracle's is perfect, and a guesser's is chance."""

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from monochord.evaluation.results import Results, join
from monochord.evaluation.scorecard import EVERYTHING, abstentions, error_map, scorecard
from monochord.physics.sensors import load_sensor

Oracle = Callable[..., Results]
OBJECTS = ("plastic", "plastic", "wood", "wood", "wood", "metal")
STRING = load_sensor("prototype").string


def in_music(results: Results, ratio: float | None = None) -> Results:
    return replace(
        results, trials=tuple(replace(trial, noise="music", ratio=ratio) for trial in results.trials)
    )


def test_an_oracle_has_a_perfect_table(oracle: Oracle) -> None:
    results = oracle(objects=OBJECTS)
    card = scorecard(join([results, in_music(results), in_music(results, 10.0)]), string=STRING, draws=20)
    assert {row.condition for row in card.table} == {"clean", "music", "music 10 dB"}
    assert {row.object for row in card.table} == {"plastic", "wood", "metal", EVERYTHING}
    assert len(card.table) == 4 * 3 * 3
    for row in card.table:
        for told in (row.position, row.force):
            assert (told.mae.value, told.within.value, told.answered) == (0.0, 1.0, 1.0)
            assert told.r.value == pytest.approx(1.0)
    for held in (card.contact, card.slip):
        assert {body: set(each) for body, each in held.items()} == {
            body: {"clean", "music", "music 10 dB"} for body in (*set(OBJECTS), EVERYTHING)
        }
        assert all(told.accuracy.value == 1.0 for each in held.values() for told in each.values())
    assert card.simulated


def test_rows_hold_what_they_say(oracle: Oracle) -> None:
    card = scorecard(oracle(objects=OBJECTS), draws=0)
    whole, still, sliding = (card.row("wood", state=state) for state in ("touched", "at rest", "sliding"))
    assert whole is not None
    assert still is not None
    assert sliding is not None
    assert whole.position.windows == 3 * 140 == still.position.windows + sliding.position.windows
    assert card.row("wood", "rain") is None
    assert whole.position.mae.low is None


def test_what_sessions_differ_in_is_told_apart(oracle: Oracle) -> None:
    results = oracle(objects=OBJECTS)
    worse = results.estimate("force") + np.where(results.of_trials("day") == 2, 0.5, 0.0)
    card = scorecard(replace(results, value={**results.value, "force": worse}), draws=0)
    days = {day: told["force"].mae.value for day, told in card.by["day"].items()}
    assert days == pytest.approx({"0": 0.0, "1": 0.0, "2": 0.5})
    assert set(card.by["session"]) == {f"take{number}" for number in range(6)}
    assert card.by["radius"] == {}


def test_an_error_map_shows_where_it_is_wrong(oracle: Oracle) -> None:
    results = oracle()
    place = results.label("position")
    values = place + np.where(place > 0.1, 0.004, 0.0)
    told = error_map(replace(results, value={"position": values}), "position", "clean")
    errors = np.array([[np.nan if value is None else value for value in row] for row in told.error])
    middle = 0.5 * (np.array(told.positions)[1:] + np.array(told.positions)[:-1])
    assert np.nanmax(errors[:, middle < 0.09]) == 0.0
    assert np.nanmin(errors[:, middle > 0.11]) == pytest.approx(0.004)
    assert np.sum(told.windows) == np.sum(told.answered) == 6 * 140


def test_abstentions_are_told_by_reason(oracle: Oracle) -> None:
    results = oracle()
    why = {**results.why, "force": np.arange(len(results), dtype=np.int16) % 2}
    assert abstentions(replace(results, why=why))["force"] == pytest.approx({"no contact": 0.5}, abs=0.01)


def test_it_is_plain_values_that_json_holds(oracle: Oracle) -> None:
    results = oracle(objects=("wood",), spread=1.0)
    silent = replace(results, value={name: np.full(len(results), np.nan) for name in results.value})
    for told in (results, silent):
        tree = scorecard(told, string=STRING, force_floor={"take0": 0.01}, draws=20).tree()
        assert json.loads(json.dumps(tree, allow_nan=False)) == tree
