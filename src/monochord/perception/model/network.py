"""The heads as arithmetic in NumPy: from a row of features to outputs, and from these to estimates."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Estimate
from monochord.metrics import DECISION
from monochord.perception.heads.base import Loss
from monochord.perception.model.correction import Correction
from monochord.perception.model.definition import Definition, HeadRecord
from monochord.perception.model.rise import rises

Indices = NDArray[np.int64]
Layers = tuple[tuple[Audio, Audio], ...]
NO_CONTACT, UNCERTAIN = "no contact", "too uncertain"
"""Why a head abstains."""
MAX_LOGIT = 700.0
"""Largest logit whose exponential is a finite double."""
NOTHING: Audio = np.zeros(0, np.float32)
NO_CORRECTIONS: Mapping[str, Correction] = {}
STD_OF_SPREAD: Mapping[Loss, float] = {"gauss": 1.0, "laplace": math.sqrt(2.0)}
"""Standard deviation of an error distribution whose spread is 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """Output of a head's last layer: a logit, or a scaled quantity with the logarithm of its spread.

    `variables` are the values of those of its correction, beside its own.
    """

    value: float
    log_spread: float = 0.0
    variables: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """The scaling and the layers of all heads.

    Each row is a product of its own, in a batch too, so that equal rows give equal bits alone and among
    others, live and offline.
    `linear` holds the linear path of the heads that have one, `columns` the features that a head sees and
    `reference` the reference's, None for all; `context` says whether it sees that. `rise` names the heads
    that have the rise of the pitch as an input, of `rise_columns`.
    """

    scaler: tuple[Audio, Audio]
    context_scaler: tuple[Audio, Audio] | None
    clip: float
    layers: Mapping[str, Layers]
    linear: Mapping[str, tuple[Audio, Audio]]
    context: Mapping[str, bool]
    columns: Mapping[str, Indices | None]
    reference: Mapping[str, Indices | None]
    rise: frozenset[str]
    rise_columns: tuple[int, ...]

    @classmethod
    def of(cls, definition: Definition, weights: Mapping[str, Audio]) -> "Network":
        """Build it from a definition and weights of its shapes."""
        heads = definition.heads

        def layer(name: str) -> tuple[Audio, Audio]:
            return weights[f"{name}.weight"], weights[f"{name}.bias"]

        return cls(
            scaler=(weights["scaler.mean"], weights["scaler.scale"]),
            context_scaler=(weights["context.mean"], weights["context.scale"])
            if definition.widths[1]
            else None,
            clip=definition.clip,
            layers={
                name: tuple(layer(f"{name}.{number}") for number in range(len(record.task.hidden) + 1))
                for name, record in heads.items()
            },
            linear={name: layer(f"{name}.linear") for name, record in heads.items() if record.task.linear},
            context={name: record.task.context for name, record in heads.items()},
            columns={
                name: np.array(definition.columns_of(name)) if record.task.columns else None
                for name, record in heads.items()
            },
            reference={
                name: np.array(definition.reference_of(name)) if record.task.reference else None
                for name, record in heads.items()
            },
            rise=frozenset(name for name, record in heads.items() if record.task.rise),
            rise_columns=definition.rise_columns,
        )

    def scaled(self, row: Audio) -> Audio:
        """Return windows' features (..., d) less their mean, in standard deviations, bounded by `clip`."""
        return scaled(row, *self.scaler, self.clip)

    def scaled_context(self, row: Audio) -> Audio:
        """Return untouched references (..., c) as `scaled` does; absent ones are zeros."""
        if self.context_scaler is None:
            return row[..., :0]
        return np.where(row[..., -1:], scaled(row, *self.context_scaler, self.clip), np.float32(0.0))

    def rises(self, row: Audio, reference: Audio) -> Audio:
        """Return the rise of the pitch as inputs, of features (..., d) and references (..., c), unscaled."""
        return rises(row, reference, self.rise_columns) if self.rise_columns else row[..., :0]

    def output(self, name: str, base: Audio, context: Audio, rise: Audio = NOTHING) -> Output:
        """Return the output of a head for scaled features (d,), a scaled reference (c,) and the rise."""
        return self.outputs(name, base[np.newaxis], context[np.newaxis], rise[np.newaxis])[0]

    def outputs(self, name: str, base: Audio, context: Audio, rise: Audio) -> list[Output]:
        """Return the outputs of a head for rows (n, d), (n, c) and (n, r), as `output` does for each."""
        columns, reference = self.columns[name], self.reference[name]
        parts = [base if columns is None else base[:, columns]]
        if self.context[name]:
            parts.append(context if reference is None else context[:, reference])
        parts += [rise] if name in self.rise else []
        # Rows in one piece: of others the product is summed in another order.
        inputs = np.ascontiguousarray(np.concatenate(parts, axis=1))
        row = inputs if len(inputs) > 1 else inputs[0]  # a vector alone costs NumPy a third less
        values = np.atleast_2d(layered(row, self.layers[name])).tolist()
        linear = layered(row, (self.linear[name],)).ravel().tolist() if name in self.linear else None
        return [
            Output(value=value + linear[k] if linear else value, log_spread=spread[0] if spread else 0.0)
            for k, (value, *spread) in enumerate(values)
        ]


def layered(row: Audio, layers: Layers) -> Audio:
    """Return what layers, each but the last with a ReLU, make of rows (..., d): one product for each row.

    >>> one = np.ones((1, 2), np.float32), np.zeros(1, np.float32)
    >>> layered(np.array([[1.0, 2.0], [0.0, -3.0]], np.float32), (one,)).tolist()
    [[3.0], [-3.0]]
    """
    for number, (weight, bias) in enumerate(layers, start=1):
        product = weight @ row if row.ndim == 1 else (weight @ row[..., np.newaxis])[..., 0]
        row = product + bias
        row = np.maximum(row, np.float32(0.0)) if number < len(layers) else row
    return row


def scaled(row: Audio, mean: Audio, scale: Audio, clip: float) -> Audio:
    """Return rows (..., d) less `mean`, divided by `scale`, and bounded by `clip` on both sides.

    >>> one, two = np.ones(1, np.float32), np.full(1, 2.0, np.float32)
    >>> scaled(np.array([[5.0], [100.0]], np.float32), one, two, 8.0).tolist()
    [[2.0], [8.0]]
    """
    return np.clip((row - mean) / scale, -clip, clip)


def probability(output: Output, record: HeadRecord) -> float:
    """Return the calibrated probability of a yes.

    After n windows of calibration it is never nearer to 0 or 1 than 1 / (n + 2), the rule of succession: so
    many windows without an error justify no more.

    >>> from monochord.perception.heads.base import Task
    >>> round(probability(Output(value=0.0), HeadRecord(task=Task(label="slip", loss="logistic"))), 3)
    0.5
    """
    logit = output.value / record.calibration.factor
    bound = math.log(record.calibration.windows + 1.0) if record.calibration.windows else MAX_LOGIT
    return 1.0 / (1.0 + math.exp(-min(max(logit, -bound), bound)))


def quantity(output: Output, record: HeadRecord, correction: Correction | None = None) -> tuple[float, float]:
    """Return a quantity and its calibrated standard error, in the unit of the label.

    With a correction, the expected error is added, and its uncertainty to that of the head.
    """
    std = spread(output, record)
    value = output.value
    if correction is not None:
        terms = correction.terms(np.array((value, *output.variables)))
        error, uncertain = correction.error(terms)
        value, std = value + float(error), math.sqrt(correction.noise * std**2 + float(uncertain) ** 2)
    return record.offset + record.scale * value, record.scale * std


def spread(output: Output, record: HeadRecord) -> float:
    """Return the calibrated standard error that a head states by itself, in units of its scale."""
    own = STD_OF_SPREAD.get(record.task.loss, 1.0) * math.exp(min(max(output.log_spread, -20.0), 20.0))
    return record.calibration.factor * own


def estimates_of(
    definition: Definition,
    outputs: Mapping[str, Output],
    corrections: Mapping[str, Correction] = NO_CORRECTIONS,
) -> dict[str, Estimate]:
    """Return the estimates of all heads; those that need a touch abstain where there is none.

    `corrections` are those of the heads that have one. The standard error of a probability p is that of the
    yes or no, sqrt(p (1 - p)).
    """
    gate = definition.gate
    touched = probability(outputs[gate], definition.heads[gate]) >= DECISION
    estimates: dict[str, Estimate] = {}
    for name, record in definition.heads.items():
        task = record.task
        if task.touched and not touched:
            estimates[name] = Estimate.abstain(task.unit, NO_CONTACT)
            continue
        if task.is_probability:
            value = probability(outputs[name], record)
            std = math.sqrt(value * (1.0 - value))
        else:
            value, std = quantity(outputs[name], record, corrections.get(name))
        estimates[name] = (
            Estimate(value=value, std=std, unit=task.unit)
            if std <= task.limit
            else Estimate.abstain(task.unit, UNCERTAIN)
        )
    return estimates
