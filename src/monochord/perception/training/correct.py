"""Corrections of a model: the prior from sessions outside the training, and the update from known touches."""

import dataclasses
from array import array
from bisect import bisect_left
from collections.abc import Iterator, Mapping

import numpy as np

from monochord.core.types import Audio, Flags, Floats, Indices
from monochord.core.units import Metres
from monochord.datasets.store import Dataset
from monochord.perception.model.correction import Correction, physical, prior
from monochord.perception.model.definition import TOUCHES_KEPT, CorrectionRecord, Definition
from monochord.perception.model.model import Model
from monochord.perception.model.network import HeadOutput, spread
from monochord.perception.training.examples import masks_of

TOOL_OFFSET: Metres = 4e-4
"""Standard deviation of a tool's offset, assumed: known positions are measured to it."""
LENGTH_STD = 0.0058
"""Relative standard deviation of strings' lengths, for a model that does not state it."""
FORCE_STDS = (0.05, 0.2, 0.1)
"""Standard deviations of force's error, assumed: constant in N, by N, and by N^2."""
NONE_KEPT: Audio = np.zeros((TOUCHES_KEPT, 2), np.float32)
Outputs = Mapping[int, Mapping[str, HeadOutput]]
"""The outputs of every head for the windows of a dataset, by row."""


class PackedOutputs(Outputs):
    """Outputs of windows in rising order of their rows, as numbers without objects around them.

    >>> outputs = PackedOutputs()
    >>> outputs.append(3, {"force": HeadOutput(0.5, variables=(2.0,))})
    >>> list(outputs), outputs[3]["force"].variables
    ([3], (2.0,))
    """

    def __init__(self) -> None:
        self._rows, self._values = array("q"), array("d")
        self._sizes: dict[str, int] = {}

    def append(self, row: int, outputs: Mapping[str, HeadOutput]) -> None:
        """Add a window's outputs, of the same heads as before."""
        self._sizes = {name: 3 + len(output.variables) for name, output in outputs.items()}
        self._rows.append(row)
        for value, log_spread, certainty, variables in outputs.values():
            self._values.extend((value, log_spread, certainty, *variables))

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[int]:
        return iter(self._rows)

    def __getitem__(self, row: int) -> Mapping[str, HeadOutput]:
        number = bisect_left(self._rows, row)
        if number == len(self._rows) or self._rows[number] != row:
            raise KeyError(row)
        first, outputs = number * sum(self._sizes.values()), dict[str, HeadOutput]()
        for name, size in self._sizes.items():
            value, log_spread, certainty, *variables = self._values[first : first + size]
            outputs[name] = HeadOutput(value, log_spread, certainty, tuple(variables))
            first += size
        return outputs


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Replayed:
    """A model's outputs for the windows of a dataset, by row, computed window by window as in the live loop.

    `outputs` holds the outputs of every head. `odds` holds the log odds of faults (faults,); empty
    for a model that reports none. Unusable windows are absent from both.
    """

    outputs: Outputs
    odds: Mapping[int, Floats]


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class LabelledErrors:
    """Errors of a head on labelled windows (n,): label minus estimate, in units of the head's scale.

    `rows` (n,) are the windows in the dataset. `std` (n,) is the standard error that the head states.
    `variables` (n, v) are the correction's variables; the first is the head's estimate.
    """

    rows: Indices
    error: Floats
    std: Floats
    variables: Floats

    def at(self, used: Flags) -> "LabelledErrors":
        """Return the errors on some of the windows."""
        some = {field.name: getattr(self, field.name)[used] for field in dataclasses.fields(self)}
        return LabelledErrors(**some)


def with_variables(definition: Definition, corrections: Mapping[str, tuple[str, ...]]) -> Definition:
    """Return a definition whose heads have corrections with these variables, but no prior yet.

    Raises `InputError` if a variable names an unknown column.
    """
    heads = dict(definition.heads)
    for name, variables in corrections.items():
        heads[name] = dataclasses.replace(heads[name], correction=CorrectionRecord(variables=variables))
    definition = dataclasses.replace(definition, heads=heads)
    for name in corrections:
        definition.variables_of(name)
    return definition


def counting(definition: Definition, name: str, dataset: Dataset, outputs: Outputs) -> Indices:
    """Return the rows of windows that count for a head and have an output."""
    rows = np.array(sorted(outputs), np.int64)
    task = definition.heads[name].task
    rows = rows[masks_of(dataset, {name: task})[name][rows]]
    # A position that is not certain is not stated, and its error tells nothing of those that are.
    return (
        rows[[outputs[row][name].certainty >= task.certain for row in rows.tolist()]] if len(rows) else rows
    )


def labelled_errors(definition: Definition, name: str, dataset: Dataset, outputs: Outputs) -> LabelledErrors:
    """Return the errors of a head on the windows that count for it."""
    record, rows = definition.heads[name], counting(definition, name, dataset, outputs)
    head_outputs = [outputs[row][name] for row in rows.tolist()]
    value = np.array([each.value for each in head_outputs])
    return LabelledErrors(
        rows=rows,
        error=(dataset.label(record.task.label)[rows] - record.offset) / record.scale - value,
        std=np.array([spread(each, record) for each in head_outputs]),
        variables=np.array([(each.value, *each.variables) for each in head_outputs])
        if head_outputs
        else np.zeros((0, 1 + len(definition.variables_of(name)))),
    )


def correctable(model: Model) -> Model:
    """Return a model that can correct every position and force; by physics where training left no prior."""
    definition = model.definition
    stds = {"m": (TOOL_OFFSET, definition.length_std or LENGTH_STD, 0.0), "N": FORCE_STDS}
    kept = next((model.weights[f"{name}.correction.touches"][:, :2] for name in model.corrections), NONE_KEPT)
    for name, record in definition.heads.items():
        if record.correction is not None or record.task.is_probability or record.task.unit not in stds:
            continue
        values = (kept[:, [int(record.task.unit == "N")]] - record.offset) / record.scale
        correction = physical(record.offset, record.scale, stds[record.task.unit])
        touches = np.hstack([kept, values])
        model = with_correction(model, name, correction, touches=0, sessions=0, kept=touches)
    return model


def with_residuals(model: Model) -> Model:
    """Return a model whose outputs have the variables of residual trees too."""
    heads = {
        name: dataclasses.replace(record, correction=dataclasses.replace(record.correction, residual=True))
        if record.correction
        else record
        for name, record in model.definition.heads.items()
    }
    return dataclasses.replace(model, definition=dataclasses.replace(model.definition, heads=heads))


def with_prior(model: Model, name: str, dataset: Dataset, outputs: Outputs, touch: Indices) -> Model:
    """Return a model with the prior of a head's correction; each session has one build and one object."""
    definition = model.definition
    known = labelled_errors(definition, name, dataset, outputs)
    session = dataset.session[known.rows].astype(np.int64)
    correction = prior(known.variables, known.error, known.std, session, touch[known.rows])
    kept = _kept_touches(dataset, known, touch[known.rows])
    return with_correction(model, name, correction, touches=0, sessions=len(np.unique(session)), kept=kept)


def with_correction(
    model: Model, name: str, correction: Correction, *, touches: int, sessions: int, kept: Audio
) -> Model:
    """Return a model with a head's correction.

    `touches` is the number of known touches and `sessions` the number of sessions behind the correction.
    `kept` holds representative touches, see `Definition.shapes`.
    """
    record = model.definition.heads[name]
    variables = record.correction.variables if record.correction else ()
    record = dataclasses.replace(
        record,
        correction=CorrectionRecord(
            variables=variables,
            residual=len(correction.forest) > 0,
            nodes=len(correction.forest),
            noise=correction.noise,
            sessions=sessions,
            touches=touches,
        ),
    )
    arrays = {
        "centre": correction.centre,
        "scale": correction.scale,
        "mean": correction.mean,
        "covariance": correction.covariance,
        "touches": kept,
    }
    if len(correction.forest):
        arrays["forest"] = correction.forest
    weights = {f"{name}.correction.{key}": array.astype(np.float32) for key, array in arrays.items()}
    definition = dataclasses.replace(model.definition, heads={**model.definition.heads, name: record})
    return dataclasses.replace(model, definition=definition, weights={**model.weights, **weights})


def _kept_touches(dataset: Dataset, known: LabelledErrors, touch: Indices) -> Audio:
    """Return position, force and variables of touches of all kinds, (`TOUCHES_KEPT`, 2 + v).

    The first is one in the middle, each next one that which is furthest from all before.
    """
    _, first = np.unique(touch, return_index=True)
    rows = known.rows[first]
    place = np.stack(
        [np.nan_to_num(dataset.label(name)[rows]) if name in dataset.labels else np.zeros(len(rows))
         for name in ("position", "force")], axis=1,
    )  # fmt: skip
    scaled = (place - place.mean(axis=0)) / np.maximum(place.std(axis=0), 1e-12)
    chosen = [int(np.linalg.norm(scaled, axis=1).argmin())]
    distance = np.full(len(rows), np.inf)
    for _ in range(TOUCHES_KEPT - 1):
        distance = np.minimum(distance, np.linalg.norm(scaled - scaled[chosen[-1]], axis=1))
        chosen.append(int(distance.argmax()))
    return np.hstack([place, known.variables[first]])[chosen].astype(np.float32)
