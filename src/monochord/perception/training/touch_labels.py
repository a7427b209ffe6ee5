"""Plausibility checks on labels of known touches, before a model learns from them or is judged by them."""

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats, Indices
from monochord.core.units import Metres
from monochord.datasets.store import Dataset
from monochord.perception.model.model import Model
from monochord.perception.training.correct import Outputs, labelled_errors
from monochord.physics.known_touches import TouchEstimates, why_impossible

MAX_ODD_ERROR: Metres = 0.005
"""Median position error above which the labels may have been measured from the string's other end."""
OTHER_END = 0.2
"""Labels are from the other end if mirroring them reduces the median error to less than this share."""


def refuse_impossible(
    model: Model, dataset: Dataset, touch: Indices, numbers: Indices, outputs: Outputs | None = None
) -> None:
    """Refuse labels that are impossible on the model's string, with `physics.known_touches.why_impossible`.

    `touch` (n,) numbers the touch of each window; those in `numbers` are checked. With the model's `outputs`
    for the windows, before it learns from them, labels that contradict the model are refused as well, and
    positions from the string's other end.
    """
    string = model.definition.string
    labels = {name: _of_touches(_label(dataset, name), touch, numbers) for name in ("position", "force")}
    estimated = None
    if outputs is not None:
        position, position_std = _estimated(model, dataset, "position", outputs)
        values = (position, position_std, _estimated(model, dataset, "force", outputs)[0])
        estimated = TouchEstimates(*(_of_touches(each, touch, numbers) for each in values))
        if string is not None:
            _refuse_other_end(labels["position"], estimated.position, string.length)
    wrong = why_impossible(labels["position"], labels["force"], string, estimated)
    if wrong is not None:
        given = wrong.given if wrong.touch is None else f"known touch {wrong.touch + 1}, {wrong.given}"
        raise InputError(given, wrong.expected, wrong.remedy)


def _label(dataset: Dataset, name: str) -> Floats:
    return dataset.label(name) if name in dataset.labels else np.full(len(dataset), np.nan)


def _estimated(model: Model, dataset: Dataset, label: str, outputs: Outputs) -> tuple[Floats, Floats]:
    """Return estimates and their standard errors (n,) of windows with this label, NaN elsewhere."""
    estimate, std = np.full((2, len(dataset)), np.nan)
    for name, record in model.definition.heads.items():
        if record.task.label != label or record.task.is_probability:
            continue
        errors, correction = labelled_errors(model.definition, name, dataset, outputs), model.correction(name)
        error = errors.error
        if correction is not None and len(error):
            error = error - correction.error(errors.variables)[0]
        estimate[errors.rows] = dataset.label(label)[errors.rows] - record.scale * error
        std[errors.rows] = record.scale * errors.std
    return estimate, std


def _of_touches(values: Floats, touch: Indices, numbers: Indices) -> Floats:
    """Return the median (touches,) of values (n,) of windows over each touch; NaN where it has none."""
    of = [values[(touch == number) & np.isfinite(values)] for number in numbers.tolist()]
    return np.array([np.median(each) if each.size else np.nan for each in of])


def _refuse_other_end(position: Floats, estimate: Floats, length: Metres) -> None:
    """Refuse positions that are right from the string's other end, and wrong from pickup 1."""
    known = np.isfinite(position) & np.isfinite(estimate)
    if not known.any():
        return
    error, other = (
        float(np.median(np.abs(estimate - each)[known])) for each in (position, length - position)
    )
    if error > MAX_ODD_ERROR and other < OTHER_END * error:
        given = f"positions with an error of {1e3 * error:.0f} mm, or {1e3 * other:.1f} mm from the other end"
        raise InputError(
            given, "metres from pickup 1", "swap the microphones' cables, or measure from pickup 1"
        )
