"""The choice of each head's method by its error on validation: the network, ridge regression or extra trees.

A network needs many builds to be better than a linear map; for one sensor, ridge regression often is. All of
them have the same inputs, and state and calibrate their uncertainty in the same way.
"""

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from monochord.core.types import Audio, Floats, Indices
from monochord.perception.heads.base import RIGHT_WITHIN
from monochord.perception.model.definition import Definition, HeadRecord, Method
from monochord.perception.model.network import HeadNetwork
from monochord.perception.training.calibrate import temperature
from monochord.perception.training.examples import Examples, inputs_of, targets_of
from monochord.perception.training.regression import RegressionWindows, fit_regression, groups_of

MARGIN = 0.05
"""Share by which a method's error must be below that of an earlier one to be chosen instead."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodChoice:
    """The chosen method of a head, and each method's mean error on the validation part and its noisy copies.

    The error of a quantity is its mean absolute error in the label's unit. Where the head refines a position,
    a window without an answer counts as 5 mm: a wrong answer costs more than none. The error of a probability
    is its log loss at its best temperature. `noises` names the noise of each copy.
    """

    method: Method
    errors: Mapping[Method, float]
    noises: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class LearnedHeads:
    """What one method learned: a definition, and the weights of all heads."""

    definition: Definition
    weights: Mapping[str, Audio]


def regressions(
    method: Method,
    definition: Definition,
    scaler: Mapping[str, Audio],
    train: Examples,
) -> LearnedHeads:
    """Return all heads as ridge regression or extra trees learn them from the examples and their copies.

    The heads of the definition may have hidden layers; those of the result have none. `scaler` are the arrays
    ``scaler.*`` of the model.
    """
    heads, weights = dict[str, HeadRecord](), dict[str, Audio]()
    for name, record in definition.heads.items():
        learned = fit_regression(method, record.task, _windows_of(definition, name, scaler, train))
        task = dataclasses.replace(record.task, hidden=())
        heads[name] = dataclasses.replace(record, task=task, method=method, nodes=len(learned.forest))
        weights |= {f"{name}.0.weight": learned.weight, f"{name}.0.bias": learned.bias}
        if len(learned.forest):
            weights[f"{name}.forest"] = learned.forest
    return LearnedHeads(definition=dataclasses.replace(definition, heads=heads), weights=weights)


def _windows_of(
    definition: Definition, name: str, scaler: Mapping[str, Audio], train: Examples
) -> RegressionWindows:
    """Return the windows that count for a head, in all copies."""
    mask, count = train.masks[name], len(train.base)
    place, total = np.cumsum(mask) - 1, int(mask.sum())

    def blocks() -> Iterator[tuple[Indices, Audio]]:
        for at, block in train.blocks():
            inputs = inputs_of(definition, scaler, block)
            numbers = np.arange(count)[:, np.newaxis] * total + place[at][mask[at]]
            rows = inputs[:, mask[at]].take(definition.columns_of(name), axis=2)
            yield numbers.ravel(), rows.reshape(-1, rows.shape[2])

    target = targets_of(definition, name, train)[:, mask].ravel()
    group = groups_of(train.session, train.touch)[mask]
    return RegressionWindows(blocks=blocks, target=target, group=np.tile(group, count))


def choose(
    candidates: Mapping[Method, LearnedHeads],
    scaler: Mapping[str, Audio],
    validation: Examples,
    noises: tuple[str, ...] = (),
) -> tuple[LearnedHeads, dict[str, MethodChoice]]:
    """Return each head by the method with the smallest error on validation, and the choices.

    A method is chosen over an earlier one if its error is smaller by `MARGIN`. `noises` names the noise of
    each copy in `validation`.
    """
    errors = dict[Method, dict[str, float]]()
    for method, candidate in candidates.items():
        errors[method] = _errors(candidate, scaler, validation)
    first = next(iter(candidates.values())).definition
    heads, weights = dict[str, HeadRecord](), dict[str, Audio]()
    choices: dict[str, MethodChoice] = {}
    for name in first.heads:
        head_errors: dict[Method, float] = {method: of[name] for method, of in errors.items()}
        best, *others = head_errors
        for method in others:
            if head_errors[method] < (1.0 - MARGIN) * head_errors[best]:
                best = method
        choices[name] = MethodChoice(method=best, errors=head_errors, noises=noises)
        heads[name] = candidates[best].definition.heads[name]
        weights |= {
            key: array for key, array in candidates[best].weights.items() if key.partition(".")[0] == name
        }
    return LearnedHeads(definition=dataclasses.replace(first, heads=heads), weights=weights), choices


def _errors(candidate: LearnedHeads, scaler: Mapping[str, Audio], examples: Examples) -> dict[str, float]:
    """Return the error of each head over all copies of examples; see `MethodChoice`."""
    definition, outputs = candidate.definition, _outputs(candidate, scaler, examples)
    errors: dict[str, float] = {}
    for name, record in definition.heads.items():
        mask = examples.masks[name]
        value, certainty = outputs[name][:, :, mask].reshape(2, -1)
        target = targets_of(definition, name, examples)[:, mask].ravel()
        errors[name] = head_error(record, value, certainty, target)
    return errors


def _outputs(candidate: LearnedHeads, scaler: Mapping[str, Audio], examples: Examples) -> dict[str, Floats]:
    """Return value and certainty (2, copies, n) of each head for all copies of examples."""
    network = HeadNetwork.of(candidate.definition, {**scaler, **candidate.weights})
    outputs = {name: np.empty((2, *examples.base.shape[:2])) for name in candidate.definition.heads}
    for at, block in examples.blocks():
        for copy, rows in enumerate(np.asarray(block.base)):
            readings = network.outputs(rows)
            for name, values in outputs.items():
                values[:, copy, at] = np.array([(row[name].value, row[name].certainty) for row in readings]).T
    return outputs


def noisy_logits(
    candidate: LearnedHeads, scaler: Mapping[str, Audio], examples: Examples
) -> dict[str, tuple[Floats, Floats, Indices]]:
    """Return labels, logits and sessions (n,) of each probability on all noisy copies of examples."""
    outputs, copies = _outputs(candidate, scaler, examples), len(examples.base) - 1
    result: dict[str, tuple[Floats, Floats, Indices]] = {}
    for name, record in candidate.definition.heads.items():
        mask = examples.masks[name]
        if record.task.is_probability:
            label, session = examples.labels[name][mask], examples.session[mask]
            logit = outputs[name][0, 1:, mask].T.ravel()
            result[name] = np.tile(label, copies), logit, np.tile(session, copies)
    return result


def head_error(record: HeadRecord, value: Floats, certainty: Floats, target: Floats) -> float:
    """Return the error of a head's values and certainties for scaled targets (n,); see `MethodChoice`."""
    if record.task.is_probability:
        bound = np.log(len(value) + 1.0)  # as after calibration
        logit = np.clip(value / temperature(target == 1.0, value), -bound, bound)
        return float(np.logaddexp(0.0, np.where(target == 1.0, -logit, logit)).mean())
    error = record.scale * np.abs(value - target)
    if record.task.refines:
        error = np.where(certainty >= record.task.certain, error, RIGHT_WITHIN)
    return float(error.mean())
