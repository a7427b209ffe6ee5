"""All scores of an evaluation as one tree of numbers, for the report and ``scores.json``."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monochord.core.config import Tree, to_tree
from monochord.core.types import Flags, Floats, StringParams
from monochord.core.units import Metres, Newtons, Seconds
from monochord.evaluation.limits import BoundComparison, compare_with_bound
from monochord.evaluation.results import CLEAN, Results
from monochord.evaluation.scores import (
    DRAWS,
    Detection,
    Regression,
    SpeedBand,
    by_speed,
    detection,
    regression,
    regression_rows,
)

QUANTITIES = ("position", "force")
STATES = ("touched", "at rest", "sliding")
"""Windows that a table row covers: all touched ones, those at rest, those that slide."""
EVERYTHING = "all objects"
MAP_CELLS = 10
"""Cells of an error map along each axis."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TableRow:
    """A row of the table: one object, or all of them, in one condition and one of `STATES`."""

    object: str
    condition: str
    state: str
    position: Regression
    force: Regression


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorMap:
    """Errors over true position and true force, in one condition.

    `windows`, `answered` and `error` (mean absolute error, None without an estimate) are rows of force and
    columns of position, between the edges `forces` in N and `positions` in m.
    """

    quantity: str
    condition: str
    positions: tuple[Metres, ...]
    forces: tuple[Newtons, ...]
    windows: tuple[tuple[int, ...], ...]
    answered: tuple[tuple[int, ...], ...]
    error: tuple[tuple[float | None, ...], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class ScoreTable:
    """Scores of a baseline: `table` of position and force; `contact` and `slip` by object and condition."""

    table: tuple[TableRow, ...]
    contact: Mapping[str, Mapping[str, Detection]]
    slip: Mapping[str, Mapping[str, Detection]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scorecard:
    """All scores of an evaluation; `simulated` marks simulated sound.

    `table`, `contact` and `slip` are the estimator's, `baselines` those of simple regressions on the same
    windows, by name. `slip_by_speed` is by condition and band in m/s. `by` has
    position and force by day, build, radius and session in the clean condition. `bounds` and `abstentions`
    (estimate: reason: share) are by condition. `force_floor` is the force sensor's mean absolute error, in N,
    by session.
    """

    estimator: str
    simulated: bool
    window: Seconds
    hop: Seconds
    windows: int
    sessions: int
    table: tuple[TableRow, ...]
    contact: Mapping[str, Mapping[str, Detection]]
    slip: Mapping[str, Mapping[str, Detection]]
    slip_by_speed: Mapping[str, Mapping[str, SpeedBand]]
    by: Mapping[str, Mapping[str, Mapping[str, Regression]]]
    maps: tuple[ErrorMap, ...]
    bounds: Mapping[str, Mapping[str, BoundComparison]]
    abstentions: Mapping[str, Mapping[str, Mapping[str, float]]]
    baselines: Mapping[str, ScoreTable] = field(default_factory=dict[str, ScoreTable])
    force_floor: Mapping[str, Newtons] = field(default_factory=dict[str, Newtons])
    options: Mapping[str, object] = field(default_factory=dict[str, object])
    notes: tuple[str, ...] = ()

    def tree(self) -> Tree:
        """Return the scores as plain values for JSON."""
        return to_tree(self)

    def row(self, body: str, condition: str = CLEAN, state: str = "touched") -> TableRow | None:
        """Return a row of the table, or None."""
        key = (body, condition, state)
        return next((row for row in self.table if (row.object, row.condition, row.state) == key), None)


def scorecard(
    results: Results,
    *,
    baselines: Mapping[str, Results] | None = None,
    string: StringParams | None = None,
    force_floor: Mapping[str, Newtons] | None = None,
    draws: int = DRAWS,
) -> Scorecard:
    """Return all scores of results.

    Parameters
    ----------
    results
        Estimates beside the truth.
    baselines
        Results of baselines on the same windows, by name.
    string
        The sensor's string, for the Cramer-Rao bound.
    force_floor
        The force sensor's error by session, see `limits.force_floor`.
    draws
        Bootstrap draws for each interval; 0 for no intervals.

    Raises
    ------
    InputError
        If an estimate of contact or slip is not a probability.

    Examples
    --------
    ``monochord evaluate`` prints its table.
    """
    conditions = conditions_of(results)
    groups = _by_condition(results)
    clean = results.where(groups[conditions[0]])
    scores = _score_table(results, STATES, draws)
    return Scorecard(
        estimator=results.estimator,
        simulated=results.simulated,
        window=results.window,
        hop=results.hop,
        windows=len(results),
        sessions=len(np.unique(results.of_trials("session"))),
        table=scores.table,
        contact=scores.contact,
        slip=scores.slip,
        baselines={name: _score_table(each, STATES[:1], draws) for name, each in (baselines or {}).items()},
        slip_by_speed={name: by_speed(results.where(rows), draws=draws) for name, rows in groups.items()},
        by=_by_session_field(clean),
        maps=tuple(
            error_map(results.where(rows), quantity, name)
            for quantity in QUANTITIES
            for name, rows in groups.items()
        ),
        bounds={} if string is None else _bounds(results, groups, string),
        abstentions={name: abstentions(results.where(rows)) for name, rows in groups.items()},
        force_floor=force_floor or {},
        options=results.options,
        notes=results.notes,
    )


def conditions_of(results: Results) -> list[str]:
    """Return the conditions, the clean one first, the others in order of the trials.

    Examples
    --------
    ``monochord evaluate`` prints them in this order.
    """
    names = dict.fromkeys(trial.condition for trial in results.trials)
    return sorted(names, key=lambda name: name != CLEAN)


def error_map(results: Results, quantity: str, condition: str) -> ErrorMap:
    """Return the errors of "position" or "force" over true position and true force.

    Examples
    --------
    ``monochord figure error_map`` draws it.
    """
    rows = regression_rows(results, "position") & regression_rows(results, "force")
    part = results.where(rows)
    places, forces = _edges(part.label("position")), _edges(part.label("force"))
    error = np.abs(part.error_of(quantity))
    finite = np.isfinite(error)
    bins = [forces, places]
    at = [part.label("force"), part.label("position")]
    windows = np.histogramdd(at, bins)[0].astype(int)
    answered = np.histogramdd([each[finite] for each in at], bins)[0].astype(int)
    total = np.histogramdd([each[finite] for each in at], bins, weights=error[finite])[0]
    return ErrorMap(
        quantity=quantity,
        condition=condition,
        positions=tuple(places.tolist()),
        forces=tuple(forces.tolist()),
        windows=tuple(map(tuple, windows.tolist())),
        answered=tuple(map(tuple, answered.tolist())),
        error=tuple(
            tuple(value / count if count else None for value, count in zip(*line, strict=True))
            for line in zip(total.tolist(), answered.tolist(), strict=True)
        ),
    )


def abstentions(results: Results) -> dict[str, dict[str, float]]:
    """Return the share of touched windows with an abstention of each estimate, by reason.

    Examples
    --------
    ``monochord evaluate --out FOLDER`` shows them in its report.
    """
    touched = results.where((results.label("contact") == 1.0) & results.usable)
    shares: dict[str, dict[str, float]] = {}
    for name, why in touched.reason_index.items():
        counts = np.bincount(why, minlength=len(results.reasons))
        shares[name] = {
            reason: count / max(len(touched), 1)
            for reason, count in zip(results.reasons, counts.tolist(), strict=True)
            if reason and count
        }
    return shares


def _by_condition(results: Results) -> dict[str, Flags]:
    column = results.of_trials("condition")
    return {name: column == name for name in conditions_of(results)}


def _score_table(results: Results, states: tuple[str, ...], draws: int) -> ScoreTable:
    """Return the scores of every object and condition, and of all objects where there are several."""
    groups, names = _by_condition(results), results.of_trials("object")
    bodies = {body: names == body for body in _distinct(names)}
    if len(bodies) > 1:
        bodies[EVERYTHING] = np.ones(len(results), bool)
    slip = results.label("slip")
    masks = (np.ones(len(results), bool), slip == 0.0, slip == 1.0)
    in_state: dict[str, Flags] = dict(zip(STATES, masks, strict=True))
    table: list[TableRow] = []
    detections: dict[str, dict[str, dict[str, Detection]]] = {"contact": {}, "slip": {}}
    for body, of_body in bodies.items():
        for condition, in_condition in groups.items():
            at = of_body & in_condition
            for state in states:
                rows = at & in_state[state]
                scores = {name: regression(results, name, rows, draws=draws) for name in QUANTITIES}
                if scores["position"].windows or scores["force"].windows:
                    table.append(TableRow(object=body, condition=condition, state=state, **scores))
            for name, by_body in detections.items():
                score = detection(results, name, at, draws=draws)
                by_body.setdefault(body, {}).update({condition: score} if score.windows else {})
    return ScoreTable(table=tuple(table), **detections)


def _by_session_field(results: Results) -> dict[str, dict[str, dict[str, Regression]]]:
    """Return position and force scores by fields that differ between sessions, without intervals."""
    scored = regression_rows(results, "position")
    scores: dict[str, dict[str, dict[str, Regression]]] = {}
    mounts = ("mount",) if any(trial.mount for trial in results.trials) else ()
    for key in ("day", "build", "radius", "session", *mounts):
        column = results.of_trials(key)
        scores[key] = {
            value if isinstance(value, str) else f"{value:g}": {
                name: regression(results, name, column == value, draws=0) for name in QUANTITIES
            }
            for value in _distinct(column)
            if scored[column == value].any()
        }
    return scores


def _bounds(
    results: Results, groups: Mapping[str, Flags], string: StringParams
) -> dict[str, dict[str, BoundComparison]]:
    bounds: dict[str, dict[str, BoundComparison]] = {}
    for condition, rows in groups.items():
        part = results.where(rows)
        compared = {name: compare_with_bound(part, string, name) for name in QUANTITIES}
        bounds[condition] = {name: bound for name, bound in compared.items() if bound is not None}
    return bounds


def _distinct(column: NDArray[Any]) -> list[Any]:
    """Return the distinct values of a column, sorted, without NaN."""
    return [value for value in np.unique(column).tolist() if isinstance(value, str) or np.isfinite(value)]


def _edges(values: Floats) -> Floats:
    if not values.size or values.min() == values.max():
        middle = float(values[0]) if values.size else 0.5
        return np.array([middle - 0.5, middle + 0.5])
    return np.linspace(values.min(), values.max(), MAP_CELLS + 1)
