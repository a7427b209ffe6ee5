"""A training run from settings to a model, readable top to bottom."""

import dataclasses
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from monochord.core.config import to_tree
from monochord.core.types import Floats, Signal
from monochord.datasets.store import Dataset, Indices, open_dataset
from monochord.perception.model.definition import Calibration, Definition
from monochord.perception.model.estimates import amount, probability
from monochord.perception.model.files import INSIDE_A_RUN, save
from monochord.perception.model.model import Model
from monochord.perception.model.network import Answer
from monochord.perception.training._torch import torch_library
from monochord.perception.training.board import board, summary_writer
from monochord.perception.training.calibrate import calibrated_amount, calibrated_chance
from monochord.perception.training.checkpoint import Checkpoint
from monochord.perception.training.examples import chosen, masks_of
from monochord.perception.training.loop import Plan, fit
from monochord.perception.training.prepare import (
    Material,
    examples_of,
    material,
    noises_of,
    probes,
    quietest,
    read_split,
    scaled_heads,
    scaling,
    stream_of,
    with_objects,
)
from monochord.perception.training.replay import replay
from monochord.perception.training.rows import Told
from monochord.perception.training.run_folder import BOARD, CHECKPOINT, claim, write_history, write_metrics
from monochord.perception.training.scores import Numbers, amount_scores, chance_scores
from monochord.perception.training.settings import Settings


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """What a run ended with: `scores` are those of each head on validation."""

    out: Path
    model: Model
    scores: dict[str, Numbers]
    epochs: int


def train(settings: Settings, out: Path, told: Told = lambda *_: None) -> Result:
    """Train a model into the folder `out`, or go on where a run of the same settings was cut off.

    Parameters
    ----------
    settings
        What is to be learned, and from what.
    out
        Folder of the run; new, or one with the same settings.
    told
        Is told of the progress.

    Raises
    ------
    InputError
        If a setting, the dataset or the split cannot be used, `out` holds something else, or torch is not
        installed, or TensorBoard where it is asked for.

    Examples
    --------
    ``examples/train_a_model.py`` does so with two simulated sessions.
    """
    torch_library()
    if settings.board:
        summary_writer()
    dataset = open_dataset(settings.dataset)
    split = read_split(settings, dataset)
    source = material(settings, dataset, split)
    for name in ("train", "validation"):
        chosen(dataset, split.parts[name], source.tasks, name)  # refuses before anything is written
    claim(out, settings.resolved())
    noises = noises_of(settings, dataset.manifest.sample_rate)
    seen = with_objects(source, examples_of(source, split.train, "train", noises, told), settings)
    judged = with_objects(source, examples_of(source, split.validation, "validation", told=told), settings)
    definition, scaler = scaled_heads(source.definition, seen), scaling(seen)
    definition = dataclasses.replace(definition, quietest=quietest(dataset, seen.rows))
    plan = Plan(
        definition=definition, optimiser=settings.optimiser, drop=settings.context.drop, seed=settings.seed
    )

    with board(out / BOARD if settings.board else None) as show:

        def shown(state: Checkpoint) -> None:
            write_history(out, state.history)
            show(state.history)
            told("epochs", state.epoch, settings.optimiser.epochs)

        state = fit(plan, scaler, seen, judged, out / CHECKPOINT, shown)
        shown(state)  # a kill between a checkpoint and this would leave out its epoch
    learned = Model(definition=definition, weights={**scaler, **probes(source), **state.best})
    stream = stream_of(dataset, split.validation)
    model, scores = calibrated(learned, source, stream, told)
    model = save(model, out / INSIDE_A_RUN)
    write_metrics(
        out,
        {
            "simulated": model.definition.simulated,
            "part": "validation",
            "heads": scores,
            "calibration": {
                name: to_tree(record.calibration) for name, record in model.definition.heads.items()
            },
            "epochs": state.epoch,
            "best_epochs": state.at,
            "windows": {"train": len(seen.rows), "validation": len(judged.rows)},
            "dataset": model.definition.dataset,
            "data": state.data,
            "versions": model.definition.versions,
        },
    )
    return Result(out=out, model=model, scores=scores, epochs=state.epoch)


def calibrated(
    learned: Model, source: Material, stream: Indices, told: Told = lambda *_: None
) -> tuple[Model, dict[str, Numbers]]:
    """Return a model whose doubt comes true on a stream of windows (n,), and its scores there.

    The windows are heard one by one, as live. Contact is calibrated first, since its probability says which
    windows become the reference that other heads see.
    """
    dataset = source.dataset
    gate = learned.definition.gate
    answers = _answers(learned, dataset, stream, told)
    learned = _with(learned, gate, _calibration(learned.definition, gate, dataset, answers))
    answers = _answers(learned, dataset, stream, told)
    scores: dict[str, Numbers] = {}
    for name in learned.definition.heads:
        if name != gate:
            learned = _with(learned, name, _calibration(learned.definition, name, dataset, answers))
        scores[name] = _score(learned.definition, name, dataset, answers)
    return learned, scores


def _answers(learned: Model, dataset: Dataset, stream: Indices, told: Told) -> dict[int, dict[str, Answer]]:
    manifest = dataset.manifest
    signal = Signal(sample_rate=manifest.sample_rate, channels=manifest.channels)
    found: dict[int, dict[str, Answer]] = {}
    for done, (row, answers) in enumerate(replay(learned.prepare(signal), dataset, stream), start=1):
        if answers:
            found[row] = answers
        if done % 256 == 0 or done == len(stream):
            told("validation, heard one by one", done, len(stream))
    return found


def _with(learned: Model, name: str, calibration: Calibration) -> Model:
    told = learned.definition
    heads = {**told.heads, name: dataclasses.replace(told.heads[name], calibration=calibration)}
    return dataclasses.replace(learned, definition=dataclasses.replace(told, heads=heads))


def _counting(
    definition: Definition, name: str, dataset: Dataset, answers: dict[int, dict[str, Answer]]
) -> Indices:
    """Return the windows that count for a head and were answered."""
    rows = np.array(sorted(answers), np.int64)
    task = definition.heads[name].task
    return rows[masks_of(dataset, {name: task})[name][rows]]


def _calibration(
    definition: Definition, name: str, dataset: Dataset, answers: dict[int, dict[str, Answer]]
) -> Calibration:
    record, rows = definition.heads[name], _counting(definition, name, dataset, answers)
    reference, session = dataset.label(record.task.label)[rows], dataset.session[rows].astype(np.int64)
    if record.task.is_chance:
        logit = np.array([answers[row][name].value for row in rows.tolist()])
        return calibrated_chance(reference == 1.0, logit, session)
    value, std = _amounts(definition, name, rows, answers)
    return calibrated_amount(value - reference, std, session)


def _score(
    definition: Definition, name: str, dataset: Dataset, answers: dict[int, dict[str, Answer]]
) -> Numbers:
    record, rows = definition.heads[name], _counting(definition, name, dataset, answers)
    reference = dataset.label(record.task.label)[rows]
    if record.task.is_chance:
        chances = np.array([probability(answers[row][name], record) for row in rows.tolist()])
        return chance_scores(reference == 1.0, chances)
    return amount_scores(reference, _amounts(definition, name, rows, answers)[0], record.offset)


def _amounts(
    definition: Definition, name: str, rows: Indices, answers: dict[int, dict[str, Answer]]
) -> tuple[Floats, Floats]:
    found = [amount(answers[row][name], definition.heads[name]) for row in rows.tolist()]
    value, std = np.array(found).T
    return value, std
