"""Inference of the heads: from features to outputs, and from outputs to estimates."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from monochord.core.errors import InputError
from monochord.core.kernels import kernel
from monochord.core.types import Audio, Estimate, Indices
from monochord.metrics import DECISION
from monochord.perception.heads.base import Loss
from monochord.perception.model.correction import Correction
from monochord.perception.model.definition import Definition, HeadRecord
from monochord.perception.model.rise import rises

NO_CONTACT, UNCERTAIN, TWO_PLACES = "no contact", "too uncertain", "two candidates"
"""Reasons for a head to abstain."""
CONTACT_LIMIT_SHARE = 2.0 / 3.0
"""Share of the contact head's limit on its standard error up to which other heads state estimates. At nodes
of a string on a compliant mount, contact becomes uncertain before the position does."""
MAX_LOGIT = 700.0
"""Largest logit whose exponential is a finite double."""
MAX_LOG_SPREAD = 20.0
"""Largest magnitude of the logarithm of a spread."""
NO_RISE: Audio = np.zeros(0, np.float32)
NO_CORRECTIONS: Mapping[str, Correction] = {}
STD_OF_SPREAD: Mapping[Loss, float] = {"gauss": 1.0, "laplace": math.sqrt(2.0)}
"""Standard deviation of an error distribution whose spread is 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """Output of a head's last layer: a logit, or a scaled quantity with the logarithm of its spread.

    `certainty` is the probability that the position which a head refines is right. `variables` are the values
    of the correction's variables, without the head's own estimate.
    """

    value: float
    log_spread: float = 0.0
    certainty: float = 1.0
    variables: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Layers:
    """The layers of a network; all but the last have a ReLU.

    `columns` (inputs,) are the indices of the columns that enter the first layer. `units` (layers + 1,) is
    the number of inputs, then the number of outputs of each layer. `weights` is one array with the matrix
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

    def outputs(self, rows: Audio) -> Audio:
        """Return the outputs (n, outputs) for rows (n, d); equal rows give equal bits in any batch.

        >>> layers = Layers.of([0, 2], [(np.ones((1, 2), np.float32), np.zeros(1, np.float32))])
        >>> layers.outputs(np.array([[1.0, 9.0, 2.0], [0.0, 9.0, -3.0]], np.float32)).tolist()
        [[3.0], [-3.0]]
        """
        return _outputs(rows, self.columns, self.units, self.weights)


@kernel()
def _outputs(rows: Audio, columns: Indices, units: Indices, weights: Audio) -> Audio:
    if columns.max() >= rows.shape[1]:
        raise IndexError("the network reads columns that the rows lack")
    values, at = rows, 0
    for layer in range(units.size - 1):
        inputs, outputs = units[layer], units[layer + 1]
        sums = np.zeros((rows.shape[0], outputs), np.float32)
        # Inputs outside, outputs inside: each weight is read once for all rows, and the compiler sums several
        # outputs at once without a change of the order in which any of them is summed.
        for i in range(inputs):
            weight, at = weights[at : at + outputs], at + outputs
            for k in range(rows.shape[0]):
                value = values[k, columns[i] if layer == 0 else i]
                if layer > 0 and value <= 0.0:  # the ReLU of the layer before
                    continue
                for o in range(outputs):
                    sums[k, o] += value * weight[o]
        bias, at = weights[at : at + outputs], at + outputs
        for k in range(rows.shape[0]):
            for o in range(outputs):
                sums[k, o] += bias[o]
        values = sums
    return values


@dataclass(frozen=True, slots=True, kw_only=True)
class Network:
    """The scaling and the layers of all heads.

    `layers` holds the layers of each head, which read columns of `inputs`. `rise_columns` are the columns
    that give the rise of the pitch; empty if no head uses it.
    """

    scaler: tuple[Audio, Audio]
    context_scaler: tuple[Audio, Audio] | None
    clip: float
    layers: Mapping[str, Layers]
    rise_columns: tuple[int, ...]

    @classmethod
    def of(cls, definition: Definition, weights: Mapping[str, Audio]) -> "Network":
        """Return the network of a definition with weights of the shapes in `Definition.shapes`."""
        has_context = definition.widths[1] > 0
        return cls(
            scaler=(weights["scaler.mean"], weights["scaler.scale"]),
            context_scaler=(weights["context.mean"], weights["context.scale"]) if has_context else None,
            clip=definition.clip,
            layers={
                name: Layers.of(
                    definition.input_columns(name),
                    [
                        (weights[f"{name}.{number}.weight"], weights[f"{name}.{number}.bias"])
                        for number in range(len(record.task.hidden) + 1)
                    ],
                )
                for name, record in definition.heads.items()
            },
            rise_columns=definition.rise_columns,
        )

    def scaled(self, row: Audio) -> Audio:
        """Return features (..., d) minus their mean, in standard deviations, limited to `clip`."""
        return scaled(row, *self.scaler, self.clip)

    def scaled_context(self, row: Audio) -> Audio:
        """Return untouched references (..., c) scaled like the features; an absent reference gives zeros."""
        if self.context_scaler is None:
            return row[..., :0]
        return scaled(row, *self.context_scaler, self.clip) * row[..., -1:]

    def rises(self, row: Audio, reference: Audio) -> Audio:
        """Return the rise of the pitch as inputs, from unscaled features (..., d) and references (..., c)."""
        return rises(row, reference, self.rise_columns) if self.rise_columns else row[..., :0]

    def inputs(self, row: Audio, reference: Audio) -> Audio:
        """Return heads' inputs (..., d + c + r) from unscaled features (..., d) and references (..., c)."""
        parts = self.scaled(row), self.scaled_context(reference), self.rises(row, reference)
        return np.concatenate(parts, axis=-1)

    def output(self, name: str, base: Audio, context: Audio, rise: Audio = NO_RISE) -> Output:
        """Return the output of a head for scaled features (d,), a scaled reference (c,) and the rise (r,)."""
        return self.outputs(name, np.concatenate([base, context, rise])[np.newaxis])[0]

    def outputs(self, name: str, inputs: Audio) -> list[Output]:
        """Return the outputs of a head for each row of `inputs` (n, d + c + r)."""
        return [
            Output(
                value=value,
                log_spread=more[0] if more else 0.0,
                certainty=1.0 / (1.0 + math.exp(min(-more[1], MAX_LOGIT))) if len(more) > 1 else 1.0,
            )
            for value, *more in self.layers[name].outputs(inputs).tolist()
        ]


def scaled(row: Audio, mean: Audio, scale: Audio, clip: float) -> Audio:
    """Return rows (..., d) minus `mean`, divided by `scale`, and limited to plus or minus `clip`.

    >>> one, two = np.ones(1, np.float32), np.full(1, 2.0, np.float32)
    >>> scaled(np.array([[5.0], [100.0]], np.float32), one, two, 8.0).tolist()
    [[2.0], [8.0]]
    """
    if not mean.shape == scale.shape == row.shape[-1:]:
        raise InputError(f"rows of {row.shape[-1]} columns", f"{mean.size} columns, as in the scaling")
    return _scaled(row.reshape(-1, row.shape[-1]), mean, scale, clip).reshape(row.shape)


@kernel()
def _scaled(rows: Audio, mean: Audio, scale: Audio, clip: float) -> Audio:
    values = np.empty_like(rows)
    for k in range(rows.shape[0]):
        for i in range(rows.shape[1]):
            # NumPy's minimum and maximum keep what is not a number.
            values[k, i] = np.minimum(np.maximum((rows[k, i] - mean[i]) / scale[i], -clip), clip)
    return values


def probability(output: Output, record: HeadRecord) -> float:
    """Return the calibrated probability that a head estimates.

    After calibration with n windows, the probability stays at least 1 / (n + 2) away from 0 and 1 (rule of
    succession): n windows without an error do not justify more certainty.

    >>> from monochord.perception.heads.base import Task
    >>> round(probability(Output(value=0.0), HeadRecord(task=Task(label="slip", loss="logistic"))), 3)
    0.5
    """
    logit = output.value / record.calibration.factor
    bound = math.log(record.calibration.windows + 1.0) if record.calibration.windows else MAX_LOGIT
    return 1.0 / (1.0 + math.exp(-min(max(logit, -bound), bound)))


def quantity(output: Output, record: HeadRecord, correction: Correction | None = None) -> tuple[float, float]:
    """Return a quantity and its calibrated standard error, in the label's unit.

    A correction adds the expected error to the quantity, and its uncertainty to the standard error.
    """
    std = spread(output, record)
    value = output.value
    if correction is not None:
        terms = correction.terms(np.array((value, *output.variables)))
        error, uncertain = correction.error(terms)
        value, std = value + float(error), math.sqrt(correction.noise * std**2 + float(uncertain) ** 2)
    return record.offset + record.scale * value, record.scale * std


def spread(output: Output, record: HeadRecord) -> float:
    """Return the calibrated standard error of a head without correction, in units of its scale."""
    log_spread = min(max(output.log_spread, -MAX_LOG_SPREAD), MAX_LOG_SPREAD)
    own = STD_OF_SPREAD.get(record.task.loss, 1.0) * math.exp(log_spread)
    return record.calibration.factor * own


def estimates_of(
    definition: Definition,
    outputs: Mapping[str, Output],
    corrections: Mapping[str, Correction] = NO_CORRECTIONS,
) -> dict[str, Estimate]:
    """Return the estimates of all heads; heads that require a touch abstain without contact.

    `corrections` holds the corrections by head. The standard error of a probability p is sqrt(p (1 - p)).
    """
    gate = definition.heads[definition.gate]
    contact = probability(outputs[definition.gate], gate)
    contact_std = math.sqrt(contact * (1.0 - contact))
    is_certain = contact_std <= gate.task.limit * (1.0 if contact < DECISION else CONTACT_LIMIT_SHARE)
    estimates: dict[str, Estimate] = {}
    for name, record in definition.heads.items():
        task = record.task
        if task.touched and not (is_certain and contact >= DECISION):
            estimates[name] = Estimate.abstain(task.unit, NO_CONTACT if is_certain else UNCERTAIN)
            continue
        if task.is_probability:
            value = probability(outputs[name], record)
            std = math.sqrt(value * (1.0 - value))
        else:
            if outputs[name].certainty < task.certain:
                estimates[name] = Estimate.abstain(task.unit, TWO_PLACES)
                continue
            value, std = quantity(outputs[name], record, corrections.get(name))
        estimates[name] = (
            Estimate(value=value, std=std, unit=task.unit)
            if std <= task.limit
            else Estimate.abstain(task.unit, UNCERTAIN)
        )
    return estimates
