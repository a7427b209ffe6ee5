"""Adapting a model to a sensor and an object with a few touches of known position and force."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Literal, TypeAlias

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Flags, Floats, Indices, Progress
from monochord.core.units import Metres
from monochord.datasets.store import Dataset
from monochord.metrics import coverage
from monochord.perception.model.correction import (
    BUILD_SHARE,
    Correction,
    touch_weights,
)
from monochord.perception.model.definition import Definition, HeadRecord
from monochord.perception.model.faults import MAX_ODDS, fault_reason
from monochord.perception.model.forest import forest_of
from monochord.perception.model.model import Model
from monochord.perception.training.adaptation import Adaptation, HeadAdaptation, Suggestion, Trust
from monochord.perception.training.correct import (
    LabelledErrors,
    Replayed,
    correctable,
    labelled_errors,
    with_correction,
    with_residuals,
)
from monochord.perception.training.examples import stream_of, touches_of
from monochord.perception.training.touch_labels import refuse_impossible
from monochord.perception.training.train import read_in_turn, with_design_forces
from monochord.physics.known_touches import NODE_SHARE, node_distance

Objects: TypeAlias = Literal["same", "others"]
"""The objects that an adapted model is for: only the object of the known touches, or others too."""
MAX_FOLDS = 10
"""Largest number of cross-validation folds; up to this number of touches, each touch is a fold."""
MAX_ALARM_SHARE = 0.01
"""Largest share of a healthy sensor's windows that may still be reported as faulty."""
MIN_FOREST_TOUCHES = 10
"""Smallest number of touches from which trees learn."""
MIXTURES: Floats = np.array([[1.0, 0.0], [0.5, 0.5], [0.0, 1.0]])
"""Shares of trees on what physics and prior leave, and of trees instead of these."""
MAX_DEVIATIONS = 4.0
"""Number of stated standard errors up to which an error is learned by trees, and counts for those stated."""
MIN_GAIN = 0.01
"""Smallest share by which a correction lowers the error on left-out touches; with less, none is used."""
PRIOR_TOUCHES = 3.0
"""Number of touches that the standard errors of training count for."""
NO_TOUCHES = "0 touches with a label of position or force", "1 or more", "record labelled touches"
REMEDY = "train a model with the heads position and force"


def adapt(
    model: Model,
    dataset: Dataset,
    *,
    touches: int | None = None,
    objects: Objects = "same",
    sensing_range: tuple[Metres, Metres] | None = None,
    replayed: Replayed | None = None,
    progress: Progress = lambda *_: None,
) -> Adaptation:
    """Return a model adapted to the sensor and the object of a dataset's sessions.

    As in training, features are relative to each session's own string, and forces are scaled to the design's
    tension. The sensor is assumed healthy: the adapted model no longer reports faults in the
    sensor's present sound as a fault.

    Parameters
    ----------
    model
        A model; corrections that it has no prior for have one by physics. Earlier adaptations stay in effect.
    dataset
        Labelled windows of one build, with one object; with `objects` "others", one object in each session.
    touches
        Number of touches to use, 1 or more, the earliest first; all by default.
    objects
        "same" learns sensor and object. "others" learns the sensor alone, for use with unknown objects; it
        improves less, because most of the error comes from the object.
    sensing_range
        Range of positions in m for the suggested next touch; any position by default.
    replayed
        The model's outputs for the dataset, if already computed; see `train.read_in_turn`.
    progress
        Called with the progress.

    Raises
    ------
    InputError
        If the model has no position or force; if no touch can be estimated, or fewer than `touches`; if a
        label is impossible; or if `objects` is "others" and the model was adapted before.
    """
    _refuse_unfit(model, objects)
    given, dataset = dataset, with_design_forces(model, dataset)
    rows, touch = stream_of(dataset, np.arange(len(dataset))), touches_of(dataset)
    ready = correctable(model)
    labelled = np.any([np.isfinite(dataset.label(name)) for name in ready.corrections], axis=0)
    known_touches = np.unique(touch[rows][labelled[rows]])[:touches]
    reader = with_residuals(ready)
    if replayed is None:
        replayed = read_in_turn(reader, dataset, rows, progress)
    refuse_impossible(model, dataset, touch, known_touches, replayed.outputs)
    rows = rows[touch[rows] <= known_touches.max(initial=0)]
    model, mistaken = desensitised(model, _odds(replayed, rows))
    heads: dict[str, HeadAdaptation] = {}
    known: dict[str, Correction] = {}
    spreads: dict[str, float] = {}
    for name, record in ready.definition.heads.items():
        if record.task.is_probability:
            continue
        correction = ready.corrections.get(name)
        errors = labelled_errors(ready.definition, name, dataset, replayed.outputs)
        window_touch = touch[errors.rows]
        numbers = np.unique(window_touch)
        if 0 < len(numbers) < (touches or 0) and correction is not None:
            given_touches = f"{len(numbers)} touches with a label of {name}"
            raise InputError(given_touches, f"{touches} or more", "record more touches")
        used = np.isin(window_touch, numbers[:touches])
        errors, window_touch = errors.at(used), window_touch[used]
        if not window_touch.size:  # no position is certain
            continue
        if correction is None or record.correction is None:
            heads[name] = _adaptation(record, errors.error, errors.error, errors.std, window_touch)
            continue
        group = dataset.session[errors.rows].astype(np.int64) if objects == "others" else None
        heads[name], known[name] = _corrected(ready, name, correction, errors, window_touch, group)
        spreads[name] = float(np.median(errors.std))
        if heads[name].used:
            prior = {
                key: each for key, each in ready.weights.items() if key.startswith(f"{name}.correction.")
            }
            model = with_correction(
                replace(
                    model, definition=_with_record(model, name, record), weights={**model.weights, **prior}
                ),
                name,
                known[name],
                touches=record.correction.touches + heads[name].touches,
                sessions=record.correction.sessions,
                kept=ready.weights[f"{name}.correction.touches"],
            )
    if not heads:
        raise InputError(*NO_TOUCHES)
    sessions = {part.name: part.checksum for part in dataset.manifest.parts}
    definition = replace(
        model.definition,
        sessions={**model.definition.sessions, **sessions},
        simulated=model.definition.simulated or dataset.manifest.simulated,
    )
    model = replace(model, definition=definition)
    return Adaptation(
        model=model,
        heads=heads,
        next_touch=_suggestion(ready, known, spreads, sensing_range),
        mistaken=mistaken,
        trust=_trust(given, np.isin(touch, known_touches), heads, objects),
    )


def judge(
    model: Model,
    dataset: Dataset,
    *,
    sensing_range: tuple[Metres, Metres] | None = None,
    progress: Progress = lambda *_: None,
) -> Adaptation:
    """Return the errors of a model on all known touches, without adapting the model; it needs no correction.

    Arguments are those of `adapt`; the dataset has one object. Raises `InputError` if no touch has a label,
    or a label is impossible.
    """
    given, dataset = dataset, with_design_forces(model, dataset)
    rows, touch = stream_of(dataset, np.arange(len(dataset))), touches_of(dataset)
    replayed = read_in_turn(model, dataset, rows, progress)
    refuse_impossible(model, dataset, touch, np.unique(touch[rows]), replayed.outputs)
    heads: dict[str, HeadAdaptation] = {}
    known: dict[str, Correction] = {}
    spreads: dict[str, float] = {}
    used = np.zeros(len(dataset), bool)
    for name, record in model.definition.heads.items():
        if record.task.is_probability:
            continue
        errors = labelled_errors(model.definition, name, dataset, replayed.outputs)
        if not errors.rows.size:
            continue
        error, std, correction = errors.error, errors.std, model.correction(name)
        if correction is not None:
            expected, std = correction.stated(errors.variables, std)
            error = error - expected
            known[name], spreads[name] = correction, float(np.median(errors.std))
        head = _adaptation(record, error, error, std, touch[errors.rows])
        heads[name] = replace(head, learned=False)
        used[errors.rows] = True
    if not heads:
        raise InputError(*NO_TOUCHES)
    return Adaptation(
        model=model,
        heads=heads,
        next_touch=_suggestion(model, known, spreads, sensing_range),
        mistaken=desensitised(model, _odds(replayed, rows))[1],
        trust=_trust(given, np.isin(touch, np.unique(touch[used])), heads),
        learned=False,
    )


def _trust(
    dataset: Dataset, known: Flags, heads: Mapping[str, HeadAdaptation], objects: Objects = "same"
) -> Trust:
    """Return what touches whose windows are known (n,) cover, in forces as they were given."""

    def span(name: str) -> tuple[float, float] | None:
        values = dataset.label(name)[known] if name in dataset.labels else np.zeros(0)
        values = values[np.isfinite(values)]
        return (float(values.min()), float(values.max())) if values.size else None

    sliding = "slip" in dataset.labels and bool(np.any(dataset.label("slip")[known] == 1.0))
    return Trust(
        touches=max((head.touches for head in heads.values()), default=0),
        position=span("position"),
        force=span("force"),
        errors={name: head.expected for name, head in heads.items() if name in ("position", "force")},
        sliding=sliding,
        others=objects == "others" and len(np.unique(dataset.session[known])) > 1,
    )


def desensitised(model: Model, odds: Sequence[Floats]) -> tuple[Model, dict[str, float]]:
    """Return a model that reports no faults of a healthy sensor, and the share of faulty windows by reason.

    The limit of each fault is raised until at most `MAX_ALARM_SHARE` of the windows exceed it, but by no more
    than `MAX_ODDS`. `odds` are the log odds (faults,) of each window of the sensor. The shares are of windows
    from which the given model abstains.
    """
    record = model.definition.faults
    if record is None or not odds:
        return model, {}
    every = np.stack(odds)
    limits = np.array(record.limits)
    reasons = Counter(why for each in every if (why := fault_reason(each, limits)))
    high = np.quantile(every, 1.0 - MAX_ALARM_SHARE, axis=0)
    raised = np.clip(high, limits, limits + MAX_ODDS)
    record = replace(record, limits=tuple(raised.tolist()))
    model = replace(model, definition=replace(model.definition, faults=record))
    return model, {why: count / len(every) for why, count in reasons.most_common()}


def _odds(replayed: Replayed, rows: Indices) -> list[Floats]:
    return [replayed.odds[row] for row in rows.tolist() if row in replayed.odds]


def _with_record(model: Model, name: str, record: HeadRecord) -> Definition:
    return replace(model.definition, heads={**model.definition.heads, name: record})


def _corrected(
    model: Model,
    name: str,
    correction: Correction,
    errors: LabelledErrors,
    touch: Indices,
    group: Indices | None,
) -> tuple[HeadAdaptation, Correction]:
    """Return a head's errors on left-out touches, and the correction to use.

    Few touches condition what physics and prior say. With more, trees learn what that leaves, or the whole
    error: the mixture with the smallest error on left-out touches is used (`MIXTURES`), unless it gains less
    than `MIN_GAIN` on the error without correction. Their errors also tell the factor of the standard error.
    If `group` gives the object (n,) of each window, the correction is for other objects: whole objects are
    left out, and there are no trees.
    """
    record, variables = model.definition.heads[name], errors.variables
    # A length is the same for all objects.
    share = 1.0 if record.task.unit == "m" else BUILD_SHARE

    def learned(rows: Flags) -> Correction:
        known = variables[rows], errors.error[rows], errors.std[rows], touch[rows]
        return (
            correction.given(*known) if group is None else correction.of_the_build(*known, group[rows], share)
        )

    def with_trees(by: Correction, rows: Flags, mixture: Floats) -> Correction:
        mixed = replace(by, mean=mixture @ np.stack([by.mean, correction.mean]))
        for part, base in zip(mixture.tolist(), (by, correction), strict=True):
            if part:
                expected, std = base.stated(variables[rows], errors.std[rows])
                # A misread touch says nothing of the others.
                off = np.clip(errors.error[rows] - expected, -MAX_DEVIATIONS * std, MAX_DEVIATIONS * std)
                mixed = mixed.with_forest(forest_of(variables[rows], off), part)
        return mixed

    of = touch if group is None or len(np.unique(group)) == 1 else group
    every, rows, weight = np.unique(of), np.ones(len(of), bool), touch_weights(touch)
    expected, stds = correction.stated(variables, errors.std)
    before = errors.error - expected
    has_trees = group is None and len(every) >= MIN_FOREST_TOUCHES
    corners = np.tile(expected, (2, 1))
    for out in (np.isin(of, fold) for fold in np.array_split(every, min(MAX_FOLDS, len(every)))):
        if not out.all():
            others = learned(~out)
            corners[:, out], stds[out] = others.stated(variables[out], errors.std[out])
            for corner, mixture in zip(corners, np.eye(2), strict=True):
                if has_trees:
                    corner[out] = with_trees(others, ~out, mixture).error(variables[out])[0]
    left = errors.error - MIXTURES @ corners
    best = int((np.abs(left) @ weight).argmin())
    after, result = left[best], learned(rows)
    if has_trees:
        result = with_trees(result, rows, MIXTURES[best])
    gained = 1.0 - weight @ np.abs(after) / (weight @ np.abs(before))
    used = len(every) == 1 or bool(gained >= MIN_GAIN)
    ratio = np.minimum(np.abs(after) / stds, MAX_DEVIATIONS) ** 2
    factor = float(np.sqrt((PRIOR_TOUCHES + weight @ ratio) / (PRIOR_TOUCHES + weight.sum())))
    factor = factor if len(every) > 1 else 1.0
    head = replace(_adaptation(record, before, after, factor * stds, touch), used=used)
    return head, result.scaled(factor) if used else correction


def _adaptation(
    record: HeadRecord, before: Floats, after: Floats, std: Floats, touch: Indices
) -> HeadAdaptation:
    """Return what errors (n,) of windows before and after correction say, in units of the head's scale."""
    means = [record.scale * float(np.mean(np.abs(error))) for error in (before, after)]
    zeros = np.zeros(len(after))
    return HeadAdaptation(
        unit=record.task.unit,
        touches=len(np.unique(touch)),
        windows=len(touch),
        before=means[0],
        after=means[1],
        std=record.scale * float(np.median(std)),
        coverage=coverage(zeros, after, std, 1.0),
        within_two=coverage(zeros, after, std, 2.0),
        used=False,
        corrected=record.correction is not None,
    )


def _refuse_unfit(model: Model, objects: Objects) -> None:
    """Refuse a model that cannot be adapted, or cannot be adapted for these objects."""
    if not correctable(model).corrections:
        raise InputError("a model without position or force", "a model that can be adapted", REMEDY)
    records = (each.correction for each in model.definition.heads.values())
    if objects == "others" and (touches := max(each.touches for each in records if each)):
        given = f"a model that was adapted to {touches} touches, for other objects"
        raise InputError(given, "the model before any adaptation", "adapt it to all sessions at once")


def _suggestion(
    model: Model,
    known: dict[str, Correction],
    spreads: dict[str, float],
    sensing_range: tuple[Metres, Metres] | None,
) -> Suggestion | None:
    """Return which of the touches that the model keeps would lower the variance of all others most.

    One outside the sensing range or at a node is never proposed; None where there is no other.
    """
    gains: dict[str, Floats] = {}
    places: Floats = np.zeros((0, 2))
    for name, correction in known.items():
        kept = model.weights[f"{name}.correction.touches"].astype(np.float64)
        places, terms = kept[:, :2], correction.terms(kept[:, 2:])
        shared = terms @ correction.covariance @ terms.T
        variance = np.diag(shared)
        # A touch lowers the variance at another by the square of what they share over its own.
        lowered = (shared**2 / (correction.noise * spreads[name] ** 2 + variance)).mean(axis=0)
        gains[name] = lowered / (correction.noise * spreads[name] ** 2 + variance.mean())
    low, high = sensing_range or (-np.inf, np.inf)
    possible = (low <= places[:, 0]) & (places[:, 0] <= high) & (places[:, 1] > 0.0)
    if (string := model.definition.string) is not None:
        possible &= np.abs(node_distance(places[:, 0], string.length)) >= NODE_SHARE * string.length
    if not possible.any():
        return None
    total = np.where(possible, np.mean(list(gains.values()), axis=0), -np.inf)
    best = int(total.argmax())
    position, force = places[best].tolist()
    return Suggestion(position=position, force=force, gain=float(total[best]))
