"""A training run from settings to a model, readable top to bottom."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from monochord.core.config import to_tree
from monochord.core.installing import installation
from monochord.core.ownership import sole_use
from monochord.core.types import Floats, Indices, Progress, Signal
from monochord.datasets.audit import audit
from monochord.datasets.hearing import heard
from monochord.datasets.split import Split
from monochord.datasets.store import Dataset, open_dataset
from monochord.metrics import detection_score, mean_absolute_error, regression_score
from monochord.perception.model.correction import Correction
from monochord.perception.model.definition import (
    ORDINARY,
    Calibration,
    Definition,
    FaultRecord,
    Method,
)
from monochord.perception.model.faults import FAULTS
from monochord.perception.model.files import INSIDE_A_RUN
from monochord.perception.model.model import Model
from monochord.perception.model.network import HeadOutput, probability, quantity
from monochord.perception.model.state import ModelState
from monochord.perception.model.stepping import model_input, read_all
from monochord.perception.training._torch import torch_library
from monochord.perception.training.calibrate import calibrate_probability, calibrate_quantity
from monochord.perception.training.checkpoint import Checkpoint
from monochord.perception.training.choice import (
    LearnedHeads,
    MethodChoice,
    choose,
    noisy_logits,
    regressions,
)
from monochord.perception.training.correct import (
    PackedOutputs,
    Replayed,
    counting,
    with_prior,
    with_variables,
)
from monochord.perception.training.examples import (
    TrainingData,
    chosen,
    each_noise,
    examples_of,
    noises_of,
    probes,
    quietest,
    read_split,
    scaled_heads,
    scaling,
    stream_of,
    touches_of,
    training_data,
)
from monochord.perception.training.loop import TrainingSetup, fit, training_checksum
from monochord.perception.training.run_folder import (
    BOARD,
    CHECKPOINT,
    board,
    claim,
    summary_writer,
    write_history,
    write_metrics,
)
from monochord.perception.training.settings import TrainingSettings
from monochord.perception.tuning.sessions import force_scales, length_scales, retuned_strings

HeadScores = dict[str, float]
NEVER = 1.0e6
"""Limit that no log odds of a fault exceed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingResult:
    """The result of a training run.

    `scores` holds each head's scores on validation, and `choices` its method, with the error of each method.
    `left_out` is the command that installs PyTorch if it is not installed, so that no network was trained.
    """

    out: Path
    model: Model
    scores: dict[str, HeadScores]
    epochs: int
    choices: dict[str, MethodChoice]
    left_out: str = ""


def train(
    settings: TrainingSettings,
    out: Path,
    progress: Progress = lambda *_: None,
    *,
    workers: int | None = None,
    cluster: str = "",
) -> TrainingResult:
    """Train a model in the folder `out`, or resume an interrupted run with the same settings.

    Parameters
    ----------
    settings
        Settings of the training run.
    out
        Folder of the run: a new folder, or a run with the same settings.
    progress
        Called with the progress.
    workers, cluster
        Number of processes that compute the features, or a cluster; see `rows.DatasetFeature`.

    Raises
    ------
    InputError
        If a setting, the dataset or the split cannot be used; if `out` is not such a run, or another process
        trains in it; or if TensorBoard with ``board = true`` is not installed, or PyTorch with no method but
        the network.

    Examples
    --------
    ``examples/train_a_model.py`` trains a model on two simulated sessions.
    """
    methods, left_out = _usable(settings.methods)
    if settings.board:
        summary_writer()
    dataset = open_dataset(settings.dataset)
    split = read_split(settings, dataset)
    audit(dataset, split).refuse_leaks()
    data = training_data(settings, dataset, split, workers=workers, cluster=cluster)
    for name in ("train", "validation"):
        chosen(dataset, split.parts[name], data.tasks, name)  # refuses before anything is written
    claim(out, settings.resolved())
    with sole_use(out, anywhere=True):
        data = dataclasses.replace(data, scratch=out)
        result = _trained(settings, methods, out, dataset, split, data, progress)
    return dataclasses.replace(result, left_out=left_out)


def _trained(
    settings: TrainingSettings,
    methods: Sequence[Method],
    out: Path,
    dataset: Dataset,
    split: Split,
    data: TrainingData,
    progress: Progress,
) -> TrainingResult:
    """Train by these methods in a claimed folder."""
    noises = noises_of(settings, dataset.manifest.sample_rate)
    learned = examples_of(data, split.train, "train", noises, progress)
    kinds = each_noise(settings, dataset.manifest.sample_rate)
    copies = examples_of(data, split.validation, "validation", tuple(kinds.values()), progress)
    judged = dataclasses.replace(copies, base=copies.base[:1])
    definition, scaler = scaled_heads(data.definition, learned), scaling(learned)
    definition = dataclasses.replace(definition, quietest=quietest(dataset, learned.rows))
    definition = with_variables(definition, settings.corrections)
    candidates: dict[Method, LearnedHeads] = {}
    state = Checkpoint.none(training_checksum(scaler, learned, judged))
    for number, method in enumerate(methods):
        progress("methods", number, len(methods))
        if method != "network":
            candidates[method] = regressions(method, definition, scaler, learned)
            continue
        setup = TrainingSetup(
            definition=definition,
            optimiser=settings.optimiser,
            seed=settings.seed,
        )
        with board(out / BOARD if settings.board else None) as show:

            def report(state: Checkpoint) -> None:
                write_history(out, state.history)
                show(state.history)
                progress("epochs", state.epoch, settings.optimiser.epochs)

            state, weights = fit(setup, scaler, learned, judged, out / CHECKPOINT, report)
            report(state)  # a kill between a checkpoint and its report would leave out its epoch
        candidates[method] = LearnedHeads(definition=definition, weights=weights)
    chosen_heads, choices = choose(candidates, scaler, copies, tuple(kinds))
    definition, weights = chosen_heads.definition, chosen_heads.weights
    if settings.faults:
        definition = dataclasses.replace(definition, faults=FaultRecord(limits=(NEVER,) * len(FAULTS)))
    model = Model(definition=definition, weights={**scaler, **probes(data), **weights})
    rows = stream_of(dataset, split.validation)
    noisy = noisy_logits(chosen_heads, scaler, copies)
    model, scores = calibrated(model, dataset, rows, progress, fault_share=settings.faults, noisy=noisy)
    model = model.save(out / INSIDE_A_RUN)
    write_metrics(
        out,
        {
            "simulated": model.definition.simulated,
            "part": "validation",
            "heads": scores,
            "methods": to_tree(choices),
            "calibration": {
                name: to_tree(record.calibration) for name, record in model.definition.heads.items()
            },
            "epochs": state.epoch,
            "best_epochs": state.at,
            "windows": {"train": len(learned.rows), "validation": len(judged.rows)},
            "dataset": model.definition.dataset,
            "data": state.data,
            "versions": model.definition.versions,
        },
    )
    return TrainingResult(out=out, model=model, scores=scores, epochs=state.epoch, choices=choices)


def _usable(methods: tuple[Method, ...]) -> tuple[tuple[Method, ...], str]:
    """Return the methods without the network if PyTorch is not installed, and then how to install it."""
    if "network" not in methods or find_spec("torch") is not None or methods == ("network",):
        if "network" in methods:
            torch_library()
        return methods, ""
    return tuple(method for method in methods if method != "network"), installation("train")


def calibrated(
    model: Model,
    dataset: Dataset,
    rows: Indices,
    progress: Progress = lambda *_: None,
    *,
    fault_share: float = 0.0,
    noisy: Mapping[str, tuple[Floats, Floats, Indices]] | None = None,
) -> tuple[Model, dict[str, HeadScores]]:
    """Return a model with its uncertainty calibrated on a stream of windows (n,), and its scores on them.

    The share `fault_share` of these windows, all ordinary, may be reported as faults. `noisy` has labels,
    logits and sessions of further, noisy windows, which the certainty of each probability covers as well.

    The model reads the windows one by one, as in the live loop, and once: no scale changes an output, nor
    which windows are touched. Forces are scaled to the design's tension. The prior of a correction comes from
    the errors after calibration.
    """
    gate = model.definition.gate
    dataset, touch = with_design_forces(model, dataset), touches_of(dataset)
    replayed = read_in_turn(model, dataset, rows, progress)
    outputs = replayed.outputs
    model = _with(model, gate, _calibration(model.definition, gate, dataset, outputs, touch, noisy))
    if fault_share:
        odds = np.stack(list(replayed.odds.values()))
        limits = _fault_limits(odds, fault_share)
        record = FaultRecord(
            limits=tuple(limits.tolist()), measured={ORDINARY: float(np.mean((odds > limits).any(axis=1)))}
        )
        model = dataclasses.replace(model, definition=dataclasses.replace(model.definition, faults=record))
    scores: dict[str, HeadScores] = {}
    for name in model.definition.heads:
        if name != gate:
            model = _with(model, name, _calibration(model.definition, name, dataset, outputs, touch, noisy))
        if model.definition.heads[name].correction:
            model = with_prior(model, name, dataset, outputs, touch)
        scores[name] = _score(model, name, dataset, outputs)
    return model, scores


def with_design_forces(model: Model, dataset: Dataset) -> Dataset:
    """Return a dataset with forces and positions converted to the design's string.

    See `force_scales` and `length_scales`.
    """
    design = model.definition.string
    if design is None:
        return dataset
    scales = {"force": force_scales(dataset, design), "position": length_scales(dataset, design)}
    scaled = {name: dataset.labels[name] / scale for name, scale in scales.items() if name in dataset.labels}
    return dataclasses.replace(dataset, labels={**dataset.labels, **scaled})


def probability_scores(reference: NDArray[np.bool_], estimate: Floats) -> HeadScores:
    """Return accuracy, area under the ROC curve, and the accuracy of always guessing the majority class.

    >>> scores = probability_scores(np.array([True, False, False]), np.array([0.9, 0.2, 0.6]))
    >>> {name: round(value, 3) for name, value in scores.items()}
    {'windows': 3, 'accuracy': 0.667, 'auc': 1.0, 'baseline_accuracy': 0.667}
    """
    score = detection_score(reference, estimate)
    return {
        "windows": score.windows,
        "accuracy": _number(score.accuracy),
        "auc": _number(score.area),
        "baseline_accuracy": _number(score.baseline),
    }


def quantity_scores(reference: Floats, estimate: Floats, std: Floats, mean: float) -> HeadScores:
    """Return errors, correlation and stated standard error, and the error of always guessing `mean`.

    `mean` is the mean label of the training.

    >>> quantity_scores(np.array([1.0, 2.0]), np.array([1.0, 2.5]), np.ones(2), 1.5)["baseline_mae"]
    0.5
    """
    score = regression_score(reference, estimate, std, limit=0.0)
    return {
        "windows": score.windows,
        "mae": _number(score.mae),
        "median_error": _number(score.median),
        "r": _number(score.r),
        "std": float(np.median(std)),
        "baseline_mae": mean_absolute_error(reference, np.full(len(reference), mean)),
    }


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def read_in_turn(
    model: Model, dataset: Dataset, rows: Indices, progress: Progress = lambda *_: None
) -> Replayed:
    """Return a model's outputs for the usable windows in `rows` (n,), computed window by window.

    `rows` are in order of session and time. Each session is a separate stream, and features are relative to
    its own string. A model with a memory hears the windows between two rows as well; see `heard`.

    Raises
    ------
    InputError
        If sample rate, channels or window length differ from the model's training.
    """
    manifest = dataset.manifest
    model.check(Signal(sample_rate=manifest.sample_rate, channels=manifest.channels), manifest.window)
    design = model.definition.string
    strings = retuned_strings(dataset, design) if design is not None else {}
    every, odds, done = PackedOutputs(), dict[int, Floats](), 0
    for session, own in groupby(map(int, rows), key=lambda row: int(dataset.session[row])):
        tuned, state = (model.tuned(strings[session]) if session in strings else model), ModelState()
        for row, window in heard(dataset, own, model.tick):
            (reading,) = read_all([model_input(tuned.prepared, state, window)])
            state = reading.state
            if window.start != dataset.start[row]:
                continue
            if reading.outputs:
                every.append(row, reading.outputs)
                if reading.odds is not None:
                    odds[row] = reading.odds
            done += 1
            if done % 256 == 0 or done == len(rows):
                progress("validation, window by window", done, len(rows))
    return Replayed(outputs=every, odds=odds)


def _fault_limits(odds: Floats, share: float) -> Floats:
    """Return the limits (faults,) of which ordinary windows exceed any in this share at most.

    `odds` (n, faults) are those of the windows. As many exceed one limit as another, unless it is 0: below it
    an ordinary window is the likelier one.
    """
    falling = np.maximum(-np.sort(-odds, axis=0), 0.0)
    few, many = 0, min(int(share * len(odds)), len(odds) - 1)
    while few < many:
        middle = (few + many + 1) // 2
        if np.mean((odds > falling[middle]).any(axis=1)) <= share:
            few = middle
        else:
            many = middle - 1
    return falling[few]


def _with(model: Model, name: str, calibration: Calibration) -> Model:
    definition = model.definition
    heads = {**definition.heads, name: dataclasses.replace(definition.heads[name], calibration=calibration)}
    return dataclasses.replace(model, definition=dataclasses.replace(definition, heads=heads))


def _calibration(
    definition: Definition,
    name: str,
    dataset: Dataset,
    outputs: Mapping[int, Mapping[str, HeadOutput]],
    touch: Indices,
    noisy: Mapping[str, tuple[Floats, Floats, Indices]] | None,
) -> Calibration:
    record, rows = definition.heads[name], counting(definition, name, dataset, outputs)
    reference, session = dataset.label(record.task.label)[rows], dataset.session[rows].astype(np.int64)
    if record.task.is_probability:
        logit = np.array([outputs[row][name].value for row in rows.tolist()])
        if noisy and name in noisy:
            labels, logits, sessions = noisy[name]
            reference, logit = np.concatenate((reference, labels)), np.concatenate((logit, logits))
            session = np.concatenate((session, sessions))
        return calibrate_probability(reference == 1.0, logit, session, windows=len(rows))
    if not len(rows):  # no position is certain
        return Calibration()
    value, std = _quantities(definition, name, rows, outputs)
    return calibrate_quantity(value - reference, std, session, touch[rows])


def _score(
    model: Model, name: str, dataset: Dataset, outputs: Mapping[int, Mapping[str, HeadOutput]]
) -> HeadScores:
    definition = model.definition
    record, rows = definition.heads[name], counting(definition, name, dataset, outputs)
    reference = dataset.label(record.task.label)[rows]
    if record.task.is_probability:
        estimate = np.array([probability(outputs[row][name], record) for row in rows.tolist()])
        return probability_scores(reference == 1.0, estimate)
    correction = model.correction(name)
    if not len(rows):
        return {"windows": 0}
    return quantity_scores(
        reference, *_quantities(definition, name, rows, outputs, correction), record.offset
    )


def _quantities(
    definition: Definition,
    name: str,
    rows: Indices,
    outputs: Mapping[int, Mapping[str, HeadOutput]],
    correction: Correction | None = None,
) -> tuple[Floats, Floats]:
    pairs = [quantity(outputs[row][name], definition.heads[name], correction) for row in rows.tolist()]
    value, std = np.array(pairs).T
    return value, std
