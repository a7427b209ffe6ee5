"""The choice of each head's method by its error on validation: the network, ridge regression or extra trees.

A network needs many builds to be better than a linear map; for one sensor, ridge regression often is. All of
them have the same inputs, and state and calibrate their uncertainty in the same way.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import compress

import numpy as np

from monochord.core.types import Audio, Floats
from monochord.perception.heads.base import RIGHT_WITHIN
from monochord.perception.model.definition import Definition, HeadRecord, Method
from monochord.perception.model.network import Network, Output
from monochord.perception.training.calibrate import temperature
from monochord.perception.training.examples import Examples, inputs_of, targets_of
from monochord.perception.training.regression import fit_regression, groups_of

MARGIN = 0.05
"""Share by which a method's error must be below that of an earlier one to be chosen instead."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """The chosen method of a head, and the error of each method on the validation part and its noisy copies.

    The error of a quantity is its mean absolute error in the label's unit. Where the head refines a position,
    a window without an answer counts as 5 mm: a wrong answer costs more than none. The error of a probability
    is its log loss at its best temperature.
    """

    method: Method
    errors: Mapping[Method, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """What one method learned: a definition, and the weights of all heads."""

    definition: Definition
    weights: Mapping[str, Audio]


def regressions(
    method: Method,
    definition: Definition,
    scaler: Mapping[str, Audio],
    train: Examples,
) -> Candidate:
    """Return all heads as ridge regression or extra trees learn them from the examples and their copies.

    Parameters
    ----------
    method
        "ridge" or "extra_trees".
    definition
        The model, whose heads may have hidden layers; the result's have none.
    scaler
        The arrays ``scaler.*`` of the model.
    train
        Examples to learn from.
    """
    inputs = inputs_of(definition, scaler, train)
    group = groups_of(train.session, train.touch)
    heads, weights = dict[str, HeadRecord](), dict[str, Audio]()
    for name, record in definition.heads.items():
        mask = train.masks[name]
        rows = inputs[:, mask].take(definition.columns_of(name), axis=2)
        target = targets_of(definition, name, train)[:, mask]
        learned = fit_regression(
            method,
            record.task,
            rows.reshape(-1, rows.shape[2]),
            target.ravel(),
            np.tile(group[mask], len(inputs)),
        )
        task = dataclasses.replace(record.task, hidden=())
        heads[name] = dataclasses.replace(record, task=task, method=method, nodes=len(learned.forest))
        weights |= {f"{name}.0.weight": learned.weight, f"{name}.0.bias": learned.bias}
        if len(learned.forest):
            weights[f"{name}.forest"] = learned.forest
    return Candidate(definition=dataclasses.replace(definition, heads=heads), weights=weights)


def choose(
    candidates: Mapping[Method, Candidate], scaler: Mapping[str, Audio], validation: Examples
) -> tuple[Candidate, dict[str, Choice]]:
    """Return each head by the method with the smallest error on validation, and the choices.

    A method is chosen over an earlier one if its error is smaller by `MARGIN`.
    """
    errors = dict[Method, dict[str, float]]()
    for method, candidate in candidates.items():
        errors[method] = _errors(candidate, scaler, validation)
    first = next(iter(candidates.values())).definition
    heads, weights = dict[str, HeadRecord](), dict[str, Audio]()
    choices: dict[str, Choice] = {}
    for name in first.heads:
        own: dict[Method, float] = {method: of[name] for method, of in errors.items()}
        best, *others = own
        for method in others:
            if own[method] < (1.0 - MARGIN) * own[best]:
                best = method
        choices[name] = Choice(method=best, errors=own)
        heads[name] = candidates[best].definition.heads[name]
        weights |= {
            key: array for key, array in candidates[best].weights.items() if key.partition(".")[0] == name
        }
    return Candidate(definition=dataclasses.replace(first, heads=heads), weights=weights), choices


def _errors(candidate: Candidate, scaler: Mapping[str, Audio], examples: Examples) -> dict[str, float]:
    """Return the error of each head over all copies of examples; see `Choice`."""
    definition = candidate.definition
    network = Network.of(definition, {**scaler, **candidate.weights})
    outputs = [network.outputs(copy) for copy in examples.base]
    errors: dict[str, float] = {}
    for name, record in definition.heads.items():
        mask = examples.masks[name]
        own = [each[name] for copy in outputs for each in compress(copy, mask.tolist())]
        errors[name] = head_error(record, own, targets_of(definition, name, examples)[:, mask].ravel())
    return errors


def head_error(record: HeadRecord, outputs: list[Output], target: Floats) -> float:
    """Return the error of a head's outputs for targets (n,) in its scale; see `Choice`."""
    value = np.array([each.value for each in outputs])
    if record.task.is_probability:
        bound = np.log(len(value) + 1.0)  # as after calibration
        logit = np.clip(value / temperature(target == 1.0, value), -bound, bound)
        return float(np.logaddexp(0.0, np.where(target == 1.0, -logit, logit)).mean())
    error = record.scale * np.abs(value - target)
    if record.task.refines:
        certain = np.array([each.certainty for each in outputs]) >= record.task.certain
        error = np.where(certain, error, RIGHT_WITHIN)
    return float(error.mean())
