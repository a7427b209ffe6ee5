"""Baselines: ridge regression and extra trees on the features of a model, fitted to its training windows.

A model has to earn its complexity: what a linear map or averaged decision trees reach on the same features
stands beside it in every table. Both see single windows, without the untouched reference, without noise
augmentation.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Floats, Indices, Signal, StringParams
from monochord.core.units import Samples
from monochord.evaluation.noise import Disturbance
from monochord.evaluation.replay import Progress, Selection, disturbed_audio, results_of
from monochord.evaluation.results import Results, join
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Extractor
from monochord.perception.tuning.sessions import force_scale, force_scales, own_strings

RIDGE = "ridge"
BASELINES = (RIDGE, "extra_trees")
PROBABILITIES = ("contact", "slip")
FORCE = "force"
QUANTITIES = ("position", FORCE)
MAX_TRAINING_WINDOWS = 20_000
"""Of more training windows this many are used, spread evenly."""
BATCH = 64
"""Windows whose features are computed at once."""
MAX_DEVIATION = 8.0
"""Bound on scaled features, in standard deviations of the training windows, as the model bounds its own: a
column that hardly varies in training would otherwise carry a linear map anywhere."""


FeatureRows: TypeAlias = tuple[Audio, Floats]
"""Features (k, columns) of windows, and the scale (k,) of their forces."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Baselines:
    """Fitted baselines: by name and label the regressor or classifier, on the rows of a feature.

    `design` is the string that they know; where a sensor is tuned otherwise, the feature is relative to its
    own string, as a model's, and forces are scaled as a model's are.
    """

    feature: Mapping[str, Any]
    fitted: Mapping[str, Mapping[str, Any]]
    design: StringParams | None = None

    def results(
        self,
        selection: Selection,
        noise: Disturbance | None = None,
        progress: Progress = lambda *_: None,
        features: FeatureRows | None = None,
    ) -> dict[str, Results]:
        """Return the results of every baseline on the selected windows, in noise where there is any.

        `features` are those of the windows, where they are computed already.
        """
        if features is None:
            features = features_of(selection, self.feature, self.design, noise, progress)
        usable = selection.dataset.usable[selection.rows]
        return {
            name: results_of(selection, _columns(models, *features, usable), name=name, disturbance=noise)
            for name, models in self.fitted.items()
        }


def features_of(
    selection: Selection,
    feature: Mapping[str, Any],
    design: StringParams | None,
    noise: Disturbance | None = None,
    progress: Progress = lambda *_: None,
) -> FeatureRows:
    """Return the features (k, columns) of the selected windows, in noise, and the scale (k,) of their forces.

    Parameters
    ----------
    selection
        The windows, with the string of their sensor.
    feature
        A feature by its name and options.
    design
        The string that features are relative to, as in `Baselines`.
    noise
        What is added to the sound.
    progress
        Called before each session.
    """
    dataset, size = selection.dataset, selection.dataset.manifest.window
    parts: list[Audio] = []
    scale = np.ones(len(selection.rows))
    for done, session in enumerate(selection.sessions):
        progress(f"{dataset.manifest.parts[session].name}, baselines", done, len(selection.sessions))
        signal, own = selection.signal_of(session), dataset.session[selection.rows] == session
        if design is not None and signal.string is not None and signal.string != design:
            scale[own] = force_scale(signal.string, design)
            signal = replace(signal, design=design)
        extractor = prepared(feature, signal, size)
        audio = disturbed_audio(dataset, session, noise)
        starts = dataset.start[selection.rows[own]]
        for at in range(0, len(starts), BATCH):
            windows = [audio[:, start : start + size] for start in starts[at : at + BATCH].tolist()]
            parts.append(extractor(np.array(windows, np.float32)))
    return np.concatenate(parts), scale


def fit_baselines(
    training: Selection, feature: Mapping[str, Any], names: Sequence[str] = BASELINES
) -> Baselines:
    """Return the baselines fitted to usable training windows, on a feature of this name and these options.

    Raises
    ------
    InputError
        If the feature refuses the signal.

    Examples
    --------
    ``monochord evaluate`` fits them to the training windows of a model.
    """
    step = -(-len(training.rows) // MAX_TRAINING_WINDOWS)
    fitted = _fitted(training, training.rows[::step], feature, names)
    return Baselines(feature=feature, fitted=fitted, design=training.string)


def prepared(feature: Mapping[str, Any], signal: Signal, size: Samples) -> Extractor:
    """Return a feature, by its name and options, for a signal and windows of `size` frames."""
    options = dict(feature)
    return FEATURES.build(options.pop("name"), options).prepare(signal, size)


def training_features(training: Selection, rows: Indices, feature: Mapping[str, Any]) -> Audio:
    """Return the features (k, columns) of rows in rising order, relative to the string of each session."""
    dataset, design, size = training.dataset, training.string, training.dataset.manifest.window
    strings = own_strings(dataset, design) if design is not None else {}
    usual = prepared(feature, training.signal, size)
    parts: list[Audio] = []
    for session in np.unique(dataset.session[rows]).tolist():
        extractor, own = usual, rows[dataset.session[rows] == session]
        if session in strings:
            signal = replace(training.signal, string=strings[session], design=design)
            extractor = prepared(feature, signal, size)
        parts += [extractor(dataset.batch(own[at : at + BATCH])) for at in range(0, len(own), BATCH)]
    return np.concatenate(parts)


def baseline_results(
    selection: Selection,
    training: Selection,
    feature: Mapping[str, Any],
    noises: Sequence[Disturbance] = (),
    progress: Progress = lambda *_: None,
) -> dict[str, Results]:
    """Return the results of every baseline, as recorded and in each noise.

    Parameters
    ----------
    selection
        Windows that are evaluated.
    training
        Usable windows that the baselines are fitted to.
    feature
        Name and options of the feature.
    noises
        Noise that is added to the evaluated sessions, each in a pass of its own.
    progress
        Called for every session.

    Raises
    ------
    InputError
        If the feature refuses the signal.

    Examples
    --------
    ``monochord evaluate`` prints them below the estimator.
    """
    baselines = fit_baselines(training, feature)
    quiet = selection.quiet_part
    conditions: list[tuple[Selection, Disturbance | None]] = [(selection, None)]
    conditions += [(quiet, noise) for noise in noises if quiet]
    parts = [baselines.results(chosen, noise, progress) for chosen, noise in conditions]
    return {name: join([part[name] for part in parts]) for name in BASELINES}


def _fitted(
    training: Selection, rows: Indices, feature: Mapping[str, Any], names: Sequence[str]
) -> dict[str, dict[str, Any]]:
    """Return by baseline the fitted regressor or classifier of each label that the training windows have."""
    dataset, design = training.dataset, training.string
    features = training_features(training, rows, feature).astype(np.float64)
    touched = dataset.label("contact")[rows] == 1.0
    fitted: dict[str, dict[str, Any]] = {baseline: {} for baseline in names}
    for name in (*PROBABILITIES, *QUANTITIES):
        if name not in dataset.labels:
            continue
        label = dataset.label(name)[rows]
        if name == FORCE and design is not None:
            label = label / force_scales(dataset, design)[rows]
        counts = np.isfinite(label) & (touched | (name == "contact"))
        if np.unique(label[counts]).size < 2:
            continue
        for baseline, models in fitted.items():
            models[name] = _fit(baseline, name, features[counts], label[counts])
    return fitted


def _fit(baseline: str, name: str, features: Floats, label: Floats) -> Any:
    from sklearn.ensemble import ExtraTreesClassifier, ExtraTreesRegressor  # noqa: PLC0415
    from sklearn.exceptions import ConvergenceWarning  # noqa: PLC0415
    from sklearn.linear_model import LogisticRegression, RidgeCV  # noqa: PLC0415
    from sklearn.pipeline import make_pipeline  # noqa: PLC0415
    from sklearn.preprocessing import FunctionTransformer, StandardScaler  # noqa: PLC0415

    if baseline == "extra_trees":
        kind: Any = ExtraTreesClassifier if name in PROBABILITIES else ExtraTreesRegressor
        return kind(50, max_features=0.1, min_samples_leaf=2, random_state=0).fit(features, label)
    linear = LogisticRegression(max_iter=300) if name in PROBABILITIES else RidgeCV(np.logspace(-3.0, 3.0, 7))
    bound = FunctionTransformer(np.clip, kw_args={"a_min": -MAX_DEVIATION, "a_max": MAX_DEVIATION})
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)
        return make_pipeline(StandardScaler(), bound, linear).fit(features, label)


def _columns(
    models: Mapping[str, Any], rows: Audio, scale: Floats, usable: NDArray[np.bool_]
) -> dict[str, Any]:
    """Return the columns of `replay.columns` for n windows; those that are not usable have no estimate."""
    features = rows.astype(np.float64)
    value = {
        name: model.predict_proba(features)[:, 1] if name in PROBABILITIES else model.predict(features)
        for name, model in models.items()
    }
    if FORCE in value:
        value[FORCE] = scale * value[FORCE]
    return {
        "value": {name: np.where(usable, column, np.nan) for name, column in value.items()},
        "std": {name: np.full(len(rows), np.nan) for name in value},
        "why": {name: (~usable).astype(np.int16) for name in value},
        "reasons": ("", "gap"),
    }
