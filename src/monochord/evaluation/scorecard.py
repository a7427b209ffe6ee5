"""Everything that an evaluation tells, as one tree of numbers: what the report shows and what is kept."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monochord.core.config import Tree, to_tree
from monochord.core.types import Floats, StringParams
from monochord.core.units import Metres, Newtons, Seconds
from monochord.evaluation.detection import Band, Detection, by_speed, detection
from monochord.evaluation.limits import Bound, against_bound
from monochord.evaluation.regression import DRAWS, Regression, Rows, regression, scored
from monochord.evaluation.results import CLEAN, Results

QUANTITIES = ("position", "force")
STATES = ("touched", "at rest", "sliding")
"""Which touched windows a row of the table is of: all, those at rest, those that slide."""
EVERYTHING = "all objects"
PLACES, FORCES = 10, 10
"""Cells of an error map, along the string and over the force."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A row of the table: one object, or all of them, in one condition and one of `STATES`."""

    object: str
    condition: str
    state: str
    position: Regression
    force: Regression


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorMap:
    """Errors over where and how hard was touched, in one condition.

    `windows`, `answered` and `error` (mean absolute, None where nothing was answered) are rows of force and
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
class Scorecard:
    """What an evaluation told; `simulated` marks sound that is.

    `contact` and `slip` are by object and condition, `slip_by_speed` by condition and band in m/s, `by` the
    position and force of each day, build, radius and session in the clean condition, `bounds` and
    `abstentions` (estimate: reason: share) by condition. `force_floor` is what the force sensor was off by
    itself, in N, by session.
    """

    estimator: str
    simulated: bool
    window: Seconds
    hop: Seconds
    windows: int
    sessions: int
    table: tuple[Row, ...]
    contact: Mapping[str, Mapping[str, Detection]]
    slip: Mapping[str, Mapping[str, Detection]]
    slip_by_speed: Mapping[str, Mapping[str, Band]]
    by: Mapping[str, Mapping[str, Mapping[str, Regression]]]
    maps: tuple[ErrorMap, ...]
    bounds: Mapping[str, Mapping[str, Bound]]
    abstentions: Mapping[str, Mapping[str, Mapping[str, float]]]
    force_floor: Mapping[str, Newtons] = field(default_factory=dict[str, Newtons])
    options: Mapping[str, object] = field(default_factory=dict[str, object])
    notes: tuple[str, ...] = ()

    def tree(self) -> Tree:
        """Return it as plain values that JSON can hold."""
        return to_tree(self)

    def row(self, body: str, condition: str = CLEAN, state: str = "touched") -> Row | None:
        """Return a row of the table, or None."""
        wanted = (body, condition, state)
        return next((row for row in self.table if (row.object, row.condition, row.state) == wanted), None)


def scorecard(
    results: Results,
    *,
    string: StringParams | None = None,
    force_floor: Mapping[str, Newtons] | None = None,
    draws: int = DRAWS,
) -> Scorecard:
    """Return everything that results tell.

    Parameters
    ----------
    results
        Estimates beside the truth.
    string
        Of the sensor, for the Cramer-Rao bound.
    force_floor
        Of sessions by name, see `limits.force_floor`.
    draws
        For each interval; 0 for none.

    Raises
    ------
    InputError
        If an estimate of contact or slip is no probability.

    Examples
    --------
    ``monochord evaluate`` prints what this tells.
    """
    conditions = conditions_of(results)
    clean = results.of_trials("condition") == conditions[0]
    groups = {name: results.of_trials("condition") == name for name in conditions}
    bodies = {body: results.of_trials("object") == body for body in _known(results.of_trials("object"))}
    if len(bodies) > 1:
        bodies[EVERYTHING] = np.ones(len(results), bool)
    return Scorecard(
        estimator=results.estimator,
        simulated=results.simulated,
        window=results.window,
        hop=results.hop,
        windows=len(results),
        sessions=len(np.unique(results.of_trials("session"))),
        table=_table(results, groups, bodies, draws),
        contact=_detections(results, "contact", groups, bodies, draws),
        slip=_detections(results, "slip", groups, bodies, draws),
        slip_by_speed={name: by_speed(results.where(rows), draws=draws) for name, rows in groups.items()},
        by=_by(results.where(clean)),
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
    """Return the conditions, the clean one first, the others in the order of their trials.

    Examples
    --------
    ``monochord evaluate`` prints them in this order.
    """
    found = dict.fromkeys(trial.condition for trial in results.trials)
    return sorted(found, key=lambda name: name != CLEAN)


def error_map(results: Results, quantity: str, condition: str) -> ErrorMap:
    """Return the errors of "position" or "force" over where and how hard was touched.

    Examples
    --------
    ``monochord evaluate`` draws what this tells.
    """
    rows = scored(results, "position") & scored(results, "force")
    part = results.where(rows)
    places = _edges(part.label("position"), PLACES)
    forces = _edges(part.label("force"), FORCES)
    error = np.abs(part.error_of(quantity))
    told = np.isfinite(error)
    bins = [forces, places]
    at = [part.label("force"), part.label("position")]
    windows = np.histogramdd(at, bins)[0].astype(int)
    answered = np.histogramdd([each[told] for each in at], bins)[0].astype(int)
    total = np.histogramdd([each[told] for each in at], bins, weights=error[told])[0]
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
    """Return the share of touched windows that each estimate abstained on, by reason.

    Examples
    --------
    ``monochord evaluate`` prints what this tells.
    """
    touched = results.where((results.label("contact") == 1.0) & results.usable)
    found: dict[str, dict[str, float]] = {}
    for name, why in touched.why.items():
        counts = np.bincount(why, minlength=len(results.reasons))
        found[name] = {
            reason: count / max(len(touched), 1)
            for reason, count in zip(results.reasons, counts.tolist(), strict=True)
            if reason and count
        }
    return found


def _table(
    results: Results, groups: Mapping[str, Rows], bodies: Mapping[str, Rows], draws: int
) -> tuple[Row, ...]:
    slip = results.label("slip")
    states = dict(zip(STATES, (np.ones(len(results), bool), slip == 0.0, slip == 1.0), strict=True))
    rows: list[Row] = []
    for body, of_body in bodies.items():
        for condition, in_condition in groups.items():
            for state, in_state in states.items():
                at = of_body & in_condition & in_state
                told = {name: regression(results, name, at, draws=draws) for name in QUANTITIES}
                if told["position"].windows or told["force"].windows:
                    rows.append(Row(object=body, condition=condition, state=state, **told))
    return tuple(rows)


def _detections(
    results: Results, name: str, groups: Mapping[str, Rows], bodies: Mapping[str, Rows], draws: int
) -> dict[str, dict[str, Detection]]:
    told = {
        body: {
            condition: detection(results, name, of_body & rows, draws=draws)
            for condition, rows in groups.items()
        }
        for body, of_body in bodies.items()
    }
    return {body: {key: each for key, each in held.items() if each.windows} for body, held in told.items()}


def _by(results: Results) -> dict[str, dict[str, dict[str, Regression]]]:
    """Return position and force by what sessions differ in, without intervals."""
    found: dict[str, dict[str, dict[str, Regression]]] = {}
    for key in ("day", "build", "radius", "session"):
        told = results.of_trials(key)
        groups = {_name(value): told == value for value in _known(told)}
        found[key] = {
            value: {name: regression(results, name, rows, draws=0) for name in QUANTITIES}
            for value, rows in groups.items()
            if scored(results, "position")[rows].any()
        }
    return found


def _bounds(
    results: Results, groups: Mapping[str, Rows], string: StringParams
) -> dict[str, dict[str, Bound]]:
    found: dict[str, dict[str, Bound]] = {}
    for condition, rows in groups.items():
        told = {name: against_bound(results.where(rows), string, name) for name in QUANTITIES}
        found[condition] = {name: bound for name, bound in told.items() if bound is not None}
    return found


def _known(told: NDArray[Any]) -> list[Any]:
    """Return what is told, each once, without what is not a number."""
    return [value for value in np.unique(told).tolist() if isinstance(value, str) or np.isfinite(value)]


def _name(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def _edges(values: Floats, cells: int) -> Floats:
    if not values.size or values.min() == values.max():
        middle = float(values[0]) if values.size else 0.5
        return np.array([middle - 0.5, middle + 0.5])
    return np.linspace(values.min(), values.max(), cells + 1)
