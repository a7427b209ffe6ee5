"""Inference of the heads: from features to outputs, and from outputs to estimates."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from monochord.core.errors import InputError
from monochord.core.kernels import kernel, part
from monochord.core.reasons import Reason
from monochord.core.types import Audio, Estimate, Indices
from monochord.metrics import DECISION
from monochord.perception.heads.base import CERTAINTY, Loss
from monochord.perception.model.correction import Correction
from monochord.perception.model.definition import Definition, HeadRecord
from monochord.perception.model.forest import forest_sums

CONTACT_LIMIT_SHARE = 2.0 / 3.0
"""Share of the contact head's limit on its standard error up to which other heads state estimates. At nodes
of a string on a compliant mount, contact becomes uncertain before the position does."""
MAX_LOGIT = 700.0
"""Largest logit whose exponential is a finite double."""
MAX_LOG_SPREAD = 20.0
"""Largest magnitude of the logarithm of a spread."""
NO_CORRECTIONS: Mapping[str, Correction] = {}
STD_OF_SPREAD: Mapping[Loss, float] = {"gauss": 1.0, "laplace": math.sqrt(2.0)}
"""Standard deviation of an error distribution whose spread is 1."""


class HeadOutput(NamedTuple):
    """Output of a head's last layer: a logit, or a scaled quantity with the logarithm of its spread.

    `certainty` is the probability that the position which a head refines is right. `variables` are the values
    of the correction's variables, without the head's own estimate.
    """

    value: float
    log_spread: float = 0.0
    certainty: float = 1.0
    variables: tuple[float, ...] = ()


class Layers(NamedTuple):
    """The layers of one head; all but the last have a ReLU.

    `columns` (inputs,) are the indices of the inputs that enter the first layer. `units` (layers + 1,) is the
    number of inputs, then the number of outputs of each layer. `weights` is one array with the matrix
    (inputs, outputs) and the bias of each layer in turn, so one compiled kernel serves any number of layers.
    """

    columns: Indices
    units: Indices
    weights: Audio

    @classmethod
    def of(cls, columns: Sequence[int], layers: Sequence[tuple[Audio, Audio]]) -> "Layers":
        """Return the layers; each has a matrix (outputs, inputs) and a bias (outputs,)."""
        return cls(
            columns=np.array(columns, np.int64),
            units=np.array([len(columns), *(len(bias) for _, bias in layers)]),
            weights=np.concatenate([part for weight, bias in layers for part in (weight.T.ravel(), bias)]),
        )


class Scaling(NamedTuple):
    """Mean and scale of the feature (d,)."""

    mean: Audio
    scale: Audio

    @classmethod
    def of(cls, weights: Mapping[str, Audio]) -> "Scaling":
        """Return the scaling of a model with weights of the shapes in `Definition.shapes`."""
        return cls(mean=weights["scaler.mean"], scale=weights["scaler.scale"])


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadNetwork:
    """The scaling of the inputs and the layers of all heads, in the order of `names`.

    `forests` holds the nodes (n, 3) of the trees that add to the first output of a head, by its number.
    `certainty` is the column with each head's certainty; None for a head that refines no position.
    """

    scaling: Scaling
    clip: float
    names: tuple[str, ...]
    heads: tuple[Layers, ...]
    forests: Mapping[int, Audio]
    certainty: tuple[int | None, ...]

    @classmethod
    def of(cls, definition: Definition, weights: Mapping[str, Audio]) -> "HeadNetwork":
        """Return the network of a definition with weights of the shapes in `Definition.shapes`."""
        heads = [
            Layers.of(
                definition.columns_of(name),
                [
                    (weights[f"{name}.{number}.weight"], weights[f"{name}.{number}.bias"])
                    for number in range(len(record.task.hidden) + 1)
                ],
            )
            for name, record in definition.heads.items()
        ]
        names = tuple(definition.heads)
        return cls(
            scaling=Scaling.of(weights),
            clip=definition.clip,
            names=names,
            heads=tuple(heads),
            forests={
                number: weights[f"{name}.forest"]
                for number, name in enumerate(names)
                if definition.heads[name].nodes
            },
            certainty=tuple(
                definition.feature.columns.index(CERTAINTY) if definition.heads[name].task.refines else None
                for name in names
            ),
        )

    def outputs(self, rows: Audio) -> list[dict[str, HeadOutput]]:
        """Return the outputs of all heads for features (n, d).

        Equal rows give equal bits in any batch.
        """
        outputs = _outputs(rows, self.scaling, self.clip, self.heads)
        if self.forests:
            inputs = network_inputs(rows, self.scaling, self.clip).astype(np.float64)
            for number, nodes in self.forests.items():
                outputs[:, number, 0] += forest_sums(inputs.take(self.heads[number].columns, 1), nodes)
        return [
            {
                name: HeadOutput(value, log_spread, 1.0 if column is None else float(row[column]))
                for name, column, (value, log_spread) in zip(self.names, self.certainty, by_head, strict=True)
            }
            for by_head, row in zip(outputs.tolist(), rows, strict=True)
        ]


def network_inputs(rows: Audio, scaling: Scaling, clip: float) -> Audio:
    """Return the inputs (n, d) of the heads from features (n, d).

    Features are minus their mean, in standard deviations, limited to `clip`.

    Examples
    --------
    >>> one = np.ones(2, np.float32)
    >>> network_inputs(np.array([[5.0, 100.0]], np.float32), Scaling(one, 2.0 * one), 8.0).tolist()
    [[2.0, 8.0]]
    """
    if rows.shape[1:] != scaling.mean.shape:
        raise InputError(f"rows of {rows.shape[1]} columns", f"{scaling.mean.size}, as in the scaling")
    return _network_inputs(rows, scaling, clip)


@kernel()
def _network_inputs(rows: Audio, scaling: Scaling, clip: float) -> Audio:
    return _inputs(rows, scaling, clip)


@part()
def _inputs(rows: Audio, scaling: Scaling, clip: float) -> Audio:
    inputs = np.empty(rows.shape, np.float32)
    for k in range(rows.shape[0]):
        for i in range(rows.shape[1]):
            # NumPy's minimum and maximum keep what is not a number.
            value = (rows[k, i] - scaling.mean[i]) / scaling.scale[i]
            inputs[k, i] = np.minimum(np.maximum(value, -clip), clip)
    return inputs


@kernel()
def _outputs(rows: Audio, scaling: Scaling, clip: float, heads: tuple[Layers, ...]) -> Audio:
    """Return the outputs (n, heads, 2): a head with one has 0 for its spread."""
    outputs = np.zeros((rows.shape[0], len(heads), 2), np.float32)
    inputs = _inputs(rows, scaling, clip)
    for h in range(len(heads)):
        values, at = inputs, 0
        columns, units, weights = heads[h]
        for layer in range(units.size - 1):
            count, width = units[layer], units[layer + 1]
            sums = np.zeros((rows.shape[0], width), np.float32)
            # Inputs outside, outputs inside: each weight is read once for all rows, and the compiler sums
            # several outputs at once without a change of the order in which any of them is summed.
            for i in range(count):
                weight, at = weights[at : at + width], at + width
                for k in range(rows.shape[0]):
                    value = values[k, columns[i] if layer == 0 else i]
                    if layer > 0 and value <= 0.0:  # the ReLU of the layer before
                        continue
                    for o in range(width):
                        sums[k, o] += value * weight[o]
            bias, at = weights[at : at + width], at + width
            for k in range(rows.shape[0]):
                for o in range(width):
                    sums[k, o] += bias[o]
            values = sums
        outputs[:, h, : values.shape[1]] = values
    return outputs


def probability(output: HeadOutput, record: HeadRecord) -> float:
    """Return the calibrated probability that a head estimates.

    After calibration with n windows, the probability stays at least 1 / (n + 2) away from 0 and 1 (rule of
    succession): n windows without an error do not justify more certainty.

    >>> from monochord.perception.heads.base import Task
    >>> round(probability(HeadOutput(value=0.0), HeadRecord(task=Task(label="slip", loss="logistic"))), 3)
    0.5
    """
    logit = output.value / record.calibration.factor
    bound = math.log(record.calibration.windows + 1.0) if record.calibration.windows else MAX_LOGIT
    return 1.0 / (1.0 + math.exp(-min(max(logit, -bound), bound)))


def quantity(
    output: HeadOutput, record: HeadRecord, correction: Correction | None = None
) -> tuple[float, float]:
    """Return a quantity and its calibrated standard error, in the label's unit.

    A correction adds the expected error to the quantity, and its uncertainty to the standard error.
    """
    std = spread(output, record)
    value = output.value
    if correction is not None:
        error, stated = correction.stated(np.array((value, *output.variables)), np.array(std))
        value, std = value + float(error), float(stated)
    return record.offset + record.scale * value, record.scale * std


def spread(output: HeadOutput, record: HeadRecord) -> float:
    """Return the calibrated standard error of a head without correction, in units of its scale."""
    log_spread = min(max(output.log_spread, -MAX_LOG_SPREAD), MAX_LOG_SPREAD)
    std = STD_OF_SPREAD.get(record.task.loss, 1.0) * math.exp(log_spread)
    return record.calibration.factor * std


def estimates_of(
    heads: Mapping[str, HeadRecord],
    gate: str,
    outputs: Mapping[str, HeadOutput],
    corrections: Mapping[str, Correction] = NO_CORRECTIONS,
) -> dict[str, Estimate]:
    """Return the estimates of all heads; heads that require a touch abstain without contact.

    `gate` is the head that estimates contact; see `Definition.gate`. `corrections` holds the corrections by
    head. The standard error of a probability p is sqrt(p (1 - p)).
    """
    contact = probability(outputs[gate], heads[gate])
    contact_std = math.sqrt(contact * (1.0 - contact))
    is_certain = contact_std <= heads[gate].task.limit * (1.0 if contact < DECISION else CONTACT_LIMIT_SHARE)
    estimates: dict[str, Estimate] = {}
    for name, record in heads.items():
        task = record.task
        if task.touched and not (is_certain and contact >= DECISION):
            reason = Reason.NO_CONTACT if is_certain else Reason.UNCERTAIN
            estimates[name] = Estimate.abstain(task.unit, reason)
            continue
        if task.is_probability:
            value = probability(outputs[name], record)
            std = math.sqrt(value * (1.0 - value))
        else:
            if outputs[name].certainty < task.certain:
                estimates[name] = Estimate.abstain(task.unit, Reason.TWO_CANDIDATES)
                continue
            value, std = quantity(outputs[name], record, corrections.get(name))
        estimates[name] = (
            Estimate(value=value, std=std, unit=task.unit)
            if task.states(value, std)
            else Estimate.abstain(task.unit, Reason.UNCERTAIN)
        )
    return estimates
