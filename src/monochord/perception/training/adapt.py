"""Adapting a model to a build and its object by a few touches of known position and force."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Floats, Indices
from monochord.core.units import Metres, Newtons
from monochord.datasets.store import Dataset
from monochord.metrics import coverage
from monochord.perception.model.correction import Correction
from monochord.perception.model.model import Model
from monochord.perception.training.correct import KnownErrors, Outputs, known_errors, with_correction
from monochord.perception.training.examples import stream_of, touches_of
from monochord.perception.training.rows import Progress
from monochord.perception.training.train import as_of_the_design, outputs_of

MAX_FOLDS = 10
"""Folds of the cross-validation; with as many touches or fewer each touch is left out by itself."""
REMEDY = "train one with corrections, as the preset builds does"


@dataclass(frozen=True, slots=True, kw_only=True)
class HeadAdaptation:
    """What known touches did for a head, by cross-validation over touches, in the label's unit.

    `before` and `after` are mean absolute errors, the latter of touches left out. `std` is the median
    standard error stated for these, `coverage` the share of windows within one, `within_two` within two. A
    head whose touches did not help, as where modes are misread, is left as it was: `used` is false.
    """

    unit: str
    touches: int
    windows: int
    before: float
    after: float
    std: float
    coverage: float
    within_two: float
    used: bool

    def line(self, name: str) -> str:
        """Return it as a person reads it, for the head of this name."""
        factor, unit = (1e3, "mm") if self.unit == "m" else (1.0, self.unit)
        before, after, std = (f"{factor * value:.3g} {unit}" for value in (self.before, self.after, self.std))
        line = (
            f"  {name:<10} mean error {before} before, {after} with {self.touches} touches "
            f"({self.windows} windows), stated +-{std} (median), which covers {100 * self.coverage:.0f} %, "
            f"twice that {100 * self.within_two:.0f} %"
        )
        return line if self.used else f"{line}; left as it was, since they did not help"


@dataclass(frozen=True, slots=True, kw_only=True)
class Suggestion:
    """The touch that would lower the uncertainty of the others most, by the share `gain` on average."""

    position: Metres
    force: Newtons
    gain: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Adaptation:
    """A model adapted to known touches, what that did for each head, and which touch would help most next."""

    model: Model
    heads: dict[str, HeadAdaptation]
    next_touch: Suggestion | None

    def lines(self) -> list[str]:
        """Return the errors of touches that were left out, and the touch to make next, for a person."""
        lines = [head.line(name) for name, head in self.heads.items()]
        touch = self.next_touch
        if touch is not None:
            place = f"{1e3 * touch.position:.0f} mm with {touch.force:.1f} N"
            gain = f"to lower the variance by {100 * touch.gain:.0f} %"
            lines.append(f"the touch that would help most next: {place}, {gain}")
        return lines


def adapt(
    model: Model,
    dataset: Dataset,
    *,
    touches: int | None = None,
    outputs: Outputs | None = None,
    progress: Progress = lambda *_: None,
) -> Adaptation:
    """Return a model adapted to the sensor and the object of a dataset's sessions.

    As in training, features are relative to each session's own string, and forces as of the design's tension.

    Parameters
    ----------
    model
        Trained with corrections. What it was adapted to before stays known.
    dataset
        Windows with labels, of one build and one object.
    touches
        How many touches to use, the first in time; all by default.
    outputs
        Those of the model for the dataset's windows, where they are known already; see `train.outputs_of`.
    progress
        Called with the progress.

    Raises
    ------
    InputError
        If the model has no corrections, or the dataset fewer touches than `touches`, or none.
    """
    corrected = {name: own for name in model.definition.heads if (own := model.correction(name))}
    if not corrected:
        raise InputError("a model without corrections", "a model that can be adapted", REMEDY)
    dataset = as_of_the_design(model, dataset)
    if outputs is None:
        outputs = outputs_of(model, dataset, stream_of(dataset, np.arange(len(dataset))), progress)
    touch = touches_of(dataset)
    heads: dict[str, HeadAdaptation] = {}
    known: dict[str, Correction] = {}
    spreads: dict[str, float] = {}
    for name, correction in corrected.items():
        errors = known_errors(model.definition, name, dataset, outputs)
        own = touch[errors.rows]
        numbers = np.unique(own)
        if len(numbers) < (touches or 1):
            given = f"{len(numbers)} touches with a label of {name}"
            raise InputError(given, f"{touches or 1} or more", "record more touches")
        used = np.isin(own, numbers[:touches])
        errors, own = _part(errors, used), own[used]
        terms = correction.terms(errors.variables)
        heads[name] = _judged(model, name, correction, errors, terms, own)
        if heads[name].used:
            known[name] = correction.given(terms, errors.error, errors.std, own)
        else:
            known[name] = correction
        spreads[name] = float(np.median(errors.std))
        record = model.definition.heads[name].correction
        model = with_correction(
            model,
            name,
            known[name],
            touches=(record.touches if record else 0) + heads[name].used * heads[name].touches,
            sessions=record.sessions if record else 0,
            kept=model.weights[f"{name}.correction.touches"],
        )
    sessions = {part.name: part.checksum for part in dataset.manifest.parts}
    definition = dataclasses.replace(
        model.definition,
        sessions={**model.definition.sessions, **sessions},
        simulated=model.definition.simulated or dataset.manifest.simulated,
    )
    model = dataclasses.replace(model, definition=definition)
    return Adaptation(model=model, heads=heads, next_touch=_suggestion(model, known, spreads))


def _part(errors: KnownErrors, used: np.ndarray) -> KnownErrors:
    return KnownErrors(
        rows=errors.rows[used],
        error=errors.error[used],
        std=errors.std[used],
        variables=errors.variables[used],
    )


def _judged(
    model: Model, name: str, correction: Correction, errors: KnownErrors, terms: Floats, touch: Indices
) -> HeadAdaptation:
    """Return the errors of a head before, and of each touch after correction by the others."""
    record = model.definition.heads[name]
    numbers = np.unique(touch)
    folds = np.array_split(numbers, min(MAX_FOLDS, len(numbers)))
    left, std = np.empty(len(touch)), np.empty(len(touch))
    for fold in folds:
        out = np.isin(touch, fold)
        others = correction.given(terms[~out], errors.error[~out], errors.std[~out], touch[~out])
        expected, uncertain = others.error(terms[out])
        left[out] = errors.error[out] - expected
        std[out] = np.sqrt(correction.noise * errors.std[out] ** 2 + uncertain**2)
    zeros = np.zeros(len(left))
    before = record.scale * float(np.mean(np.abs(errors.error - correction.error(terms)[0])))
    after = record.scale * float(np.mean(np.abs(left)))
    return HeadAdaptation(
        unit=record.task.unit,
        touches=len(numbers),
        windows=len(touch),
        before=before,
        after=after,
        std=record.scale * float(np.median(std)),
        coverage=coverage(zeros, left, std, 1.0),
        within_two=coverage(zeros, left, std, 2.0),
        used=after < before,
    )


def _suggestion(model: Model, known: dict[str, Correction], spreads: dict[str, float]) -> Suggestion | None:
    """Return which of the touches that the model keeps would lower the variance of all others most."""
    gains: dict[str, Floats] = {}
    places: Floats = np.zeros((0, 2))
    for name, correction in known.items():
        kept = model.weights[f"{name}.correction.touches"].astype(np.float64)
        places, terms = kept[:, :2], correction.terms(kept[:, 2:])
        shared = terms @ correction.covariance @ terms.T
        variance = np.diag(shared)
        lowered = (shared**2 / (correction.noise * spreads[name] ** 2 + variance)).mean(axis=1)
        gains[name] = lowered / (correction.noise * spreads[name] ** 2 + variance.mean())
    total = np.mean(list(gains.values()), axis=0)
    best = int(total.argmax())
    position, force = places[best].tolist()
    return Suggestion(position=position, force=force, gain=float(total[best]))
