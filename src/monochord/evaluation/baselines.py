"""Baselines: ridge regression and extra trees on a model's features, fitted to its training windows.

They show whether a model's complexity pays off: every table lists what a linear map and averaged decision
trees reach on the same features. Both see single windows, without the untouched reference and without noise
augmentation. The heads of a model may be learned by the same methods, from all that a head sees; see
`monochord.perception.training.choice`.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from monochord.core.reasons import Reason
from monochord.core.types import Audio, Floats, Progress, StringParams
from monochord.core.workers import ONE_PROCESS, Spread
from monochord.evaluation.noise import Disturbance
from monochord.evaluation.replay import (
    Condition,
    Selection,
    conditions_of,
    disturbed_audio,
    has_few_windows,
    jobs_of,
    results_of,
)
from monochord.evaluation.results import Results, join
from monochord.perception.features import FEATURES
from monochord.perception.heads.base import Task
from monochord.perception.model.definition import CLIP, Method
from monochord.perception.model.network import MAX_LOGIT, Scaling, network_inputs
from monochord.perception.training.examples import mean_and_scale, touches_of
from monochord.perception.training.regression import (
    FittedRegression,
    RegressionWindows,
    fit_regression,
    groups_of,
)
from monochord.perception.tuning.sessions import at_length_of, force_scale, retuned_strings

RIDGE: Method = "ridge"
BASELINES: tuple[Method, ...] = (RIDGE, "extra_trees")
PROBABILITIES = ("contact", "slip")
QUANTITIES = ("position", "force")
MAX_TRAINING_WINDOWS = 20_000
"""Most training windows used, spread evenly."""
BATCH = 64
"""Number of windows whose features are computed at once."""
FeatureRows: TypeAlias = tuple[Audio, Floats]
"""Features (k, columns) of windows, and the scales (k, 2) of their positions and forces."""
Strings: TypeAlias = Mapping[int, StringParams | None]
"""Strings by session number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Baselines:
    """Fitted baselines: by name and label what was learned from a feature's rows, scaled by `scaling`.

    `design` is the string of the training. For a sensor tuned differently, features are relative to its own
    string, and positions and forces are scaled, as in a model.
    """

    feature: Mapping[str, Any]
    scaling: Scaling
    fitted: Mapping[Method, Mapping[str, FittedRegression]]
    design: StringParams | None = None

    def results(
        self,
        selection: Selection,
        noise: Disturbance | None = None,
        progress: Progress = lambda *_: None,
        features: FeatureRows | None = None,
    ) -> dict[str, Results]:
        """Return the results of every baseline on the selected windows, with noise where requested.

        `features` are the windows' features, if already computed.
        """
        if features is None:
            features = features_of(selection, self.feature, self.design, noise, progress)
        usable, (rows, scale) = selection.dataset.usable[selection.rows], features
        inputs = _inputs(rows, self.scaling)
        return {
            name: results_of(selection, _columns(models, inputs, scale, usable), name=name, disturbance=noise)
            for name, models in self.fitted.items()
        }


def features_of(
    selection: Selection,
    feature: Mapping[str, Any],
    design: StringParams | None,
    noise: Disturbance | None = None,
    progress: Progress = lambda *_: None,
) -> FeatureRows:
    """Return the selected windows' features (k, columns), with noise, and the scales (k, 2) of their labels.

    Parameters
    ----------
    selection
        The windows, with the string of their sensor.
    feature
        The feature's name and options.
    design
        The string of the training, as in `Baselines`.
    noise
        The noise to add.
    progress
        Called before each session.
    """
    condition = Condition(selections=(selection,), disturbance=noise)
    spread = Spread(workers=1, progress=progress)
    ((_, features),) = _features_in([condition], feature, design, spread)
    return features


def _features_in(
    conditions: Sequence[Condition],
    feature: Mapping[str, Any],
    design: StringParams | None,
    spread: Spread,
    strings: Strings | None = None,
) -> Iterator[tuple[int, FeatureRows]]:
    """Yield each condition's number with its windows' features, as soon as they are computed.

    `strings` replace the strings of the selections' sessions.
    """
    jobs = {job: f"{name}, baselines" for job, name in jobs_of(conditions).items()}
    work = partial(_features_of_session, tuple(conditions), feature, design, strings)
    parts: list[dict[int, FeatureRows]] = [{} for _ in conditions]
    for (number, session), part in spread(jobs, work, few=has_few_windows(conditions)):
        parts[number][session] = part
        if len(parts[number]) == len(conditions[number].sessions):
            rows, scales = zip(
                *(parts[number].pop(each) for each in conditions[number].sessions), strict=True
            )
            yield number, (np.concatenate(rows), np.concatenate(scales))


def _features_of_session(
    conditions: tuple[Condition, ...],
    feature: Mapping[str, Any],
    design: StringParams | None,
    strings: Strings | None,
    job: tuple[int, int],
) -> FeatureRows:
    """Return the features of the selected windows of one session in one condition."""
    number, session = job
    (selection,), noise = conditions[number].selections, conditions[number].disturbance
    dataset, size = selection.dataset, selection.dataset.manifest.window
    starts = dataset.start[selection.rows_of(session)]
    signal, scale = selection.signal_of(session), np.ones((len(starts), 2))
    if strings is not None:
        signal = replace(signal, string=strings[session])
    if design is not None and signal.string is not None and signal.string != design:
        scale[:] = signal.string.length / design.length, force_scale(signal.string, design)
        signal = replace(signal, string=at_length_of(signal.string, design), design=design)
    options = dict(feature)
    extractor = FEATURES.build(options.pop("name"), options).prepare(signal, size)
    audio = disturbed_audio(dataset, session, noise)
    parts: list[Audio] = []
    for at in range(0, len(starts), BATCH):
        windows = [audio[:, start : start + size] for start in starts[at : at + BATCH].tolist()]
        parts.append(extractor(np.array(windows, np.float32)))
    return np.concatenate(parts), scale


def fit_baselines(
    training: Selection,
    feature: Mapping[str, Any],
    names: Sequence[Method] = BASELINES,
    spread: Spread = ONE_PROCESS,
) -> Baselines:
    """Fit the baselines to usable training windows, on a feature given by name and options.

    `spread` computes the features.

    Raises
    ------
    InputError
        If the feature rejects the signal.

    Examples
    --------
    ``monochord evaluate`` fits them to the training windows of a model.
    """
    step, design = -(-len(training.rows) // MAX_TRAINING_WINDOWS), training.string
    chosen = replace(training, rows=training.rows[::step])
    retuned = retuned_strings(chosen.dataset, design) if design is not None else {}
    strings = {session: retuned.get(session, design) for session in chosen.sessions}
    condition = Condition(selections=(chosen,))
    ((_, (features, scales)),) = _features_in([condition], feature, design, spread, strings)
    scaling = Scaling(*mean_and_scale([features]))
    fitted = _fitted(chosen, _inputs(features, scaling), scales, names)
    return Baselines(feature=feature, scaling=scaling, fitted=fitted, design=design)


def baseline_results(
    selection: Selection,
    training: Selection,
    feature: Mapping[str, Any],
    noises: Sequence[Disturbance] = (),
    spread: Spread = ONE_PROCESS,
) -> dict[str, Results]:
    """Return the results of every baseline, as recorded and with each noise, in a pass for each.

    `spread` reports the progress of the evaluated sessions; that of the training windows is silent.
    """
    baselines = fit_baselines(training, feature, spread=replace(spread, progress=lambda *_: None))
    conditions = conditions_of(selection, noises)
    computed = _features_in(conditions, feature, baselines.design, spread)
    parts: dict[int, dict[str, Results]] = {}
    for number, features in computed:
        (chosen,), noise = conditions[number].selections, conditions[number].disturbance
        parts[number] = baselines.results(chosen, noise, features=features)
    return {name: join([parts[at][name] for at in range(len(conditions))]) for name in BASELINES}


def _inputs(features: Audio, scaling: Scaling) -> Audio:
    return network_inputs(features, scaling, CLIP)


def _fitted(
    training: Selection, inputs: Audio, scales: Floats, names: Sequence[Method]
) -> dict[Method, dict[str, FittedRegression]]:
    """Return, by baseline, what was learned of each label in the training windows."""
    dataset, rows = training.dataset, training.rows
    touched = dataset.label("contact")[rows] == 1.0
    group = groups_of(dataset.session[rows].astype(np.int64), touches_of(dataset)[rows])
    fitted: dict[Method, dict[str, FittedRegression]] = {baseline: {} for baseline in names}
    for name in (*PROBABILITIES, *QUANTITIES):
        if name not in dataset.labels:
            continue
        label = dataset.label(name)[rows]
        if name in QUANTITIES:
            label = label / scales[:, QUANTITIES.index(name)]
        counts = np.isfinite(label) & (touched | (name == "contact"))
        if np.unique(label[counts]).size < 2:
            continue
        task = Task(label=name, loss="logistic" if name in PROBABILITIES else "square")
        for baseline, models in fitted.items():
            models[name] = fit_regression(
                baseline, task, RegressionWindows.of(inputs[counts], label[counts], group[counts])
            )
    return fitted


def _columns(
    models: Mapping[str, FittedRegression], inputs: Audio, scale: Floats, usable: NDArray[np.bool_]
) -> dict[str, Any]:
    """Return the columns of `replay.columns` for n windows; unusable windows have no estimate."""
    value = {name: model.first(inputs) for name, model in models.items()}
    for name in PROBABILITIES:
        if name in value:
            value[name] = 1.0 / (1.0 + np.exp(-np.clip(value[name], -MAX_LOGIT, MAX_LOGIT)))
    for number, name in enumerate(QUANTITIES):
        if name in value:
            value[name] = scale[:, number] * value[name]
    return {
        "value": {name: np.where(usable, column, np.nan) for name, column in value.items()},
        "std": {name: np.full(len(inputs), np.nan) for name in value},
        "reason_index": {name: (~usable).astype(np.int16) for name in value},
        "reasons": (Reason.NONE, Reason.GAP),
    }
