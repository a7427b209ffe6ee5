"""The training loop, readable top to bottom."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.perception.model.definition import Definition
from monochord.perception.training._torch import torch_library
from monochord.perception.training.checkpoint import REMEDY, Checkpoint, Line
from monochord.perception.training.examples import Examples
from monochord.perception.training.linear import LinearPath
from monochord.perception.training.network import TrainingTensors, arrays, head_loss, initial
from monochord.perception.training.settings import OptimiserSettings

SHRINKAGE = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Candidate shares of the hidden layers' contribution; 0 is the linear path alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingSetup:
    """Everything that determines a training, apart from its examples."""

    definition: Definition
    optimiser: OptimiserSettings
    drop: float
    seed: int


def fit(
    setup: TrainingSetup,
    scaler: Mapping[str, Audio],
    train: Examples,
    validation: Examples,
    file: Path,
    report: Callable[[Checkpoint], None] = lambda _: None,
) -> tuple[Checkpoint, dict[str, Audio]]:
    """Train all heads jointly until no head improves on validation.

    The linear paths are solved first, and the hidden layers learn their residuals. The random numbers of an
    epoch depend on the seed and the epoch only. Each epoch writes a checkpoint to `file`, from which an
    interrupted run continues to the same weights.

    Parameters
    ----------
    setup
        Network, optimiser and seed.
    scaler
        The arrays ``scaler.*`` and ``context.*`` of the model.
    train, validation
        Examples to learn from, and examples that decide when training ends.
    file
        The checkpoint file.
    report
        Called with each checkpoint.

    Returns
    -------
    Checkpoint
        The state after the last epoch.
    dict
        The weights of all heads, each from its best epoch.

    Raises
    ------
    InputError
        If `file` is damaged, or is a checkpoint of a training on other data.
    """
    torch = torch_library()
    threads = torch.get_num_threads()
    torch.set_num_threads(setup.optimiser.threads)
    try:
        return _fit(setup, scaler, train, validation, file, report)
    finally:
        torch.set_num_threads(threads)


def _fit(
    setup: TrainingSetup,
    scaler: Mapping[str, Audio],
    train: Examples,
    validation: Examples,
    file: Path,
    report: Callable[[Checkpoint], None],
) -> tuple[Checkpoint, dict[str, Audio]]:
    torch, options = torch_library(), setup.optimiser
    learned, judged = (TrainingTensors(setup.definition, scaler, each) for each in (train, validation))
    tasks, paths = learned.tasks, learned.solve_linear(train)
    for tensors, is_training in ((learned, True), (judged, False)):
        tensors.add_linear(paths, out_of_fold=is_training)
    weights = initial(setup.definition, setup.seed)
    decayed = [key for key in weights if key.endswith("weight") and tasks[key.partition(".")[0]].hidden]
    others = [key for key in weights if key not in decayed]
    groups: list[dict[str, Any]] = [
        {"params": [weights[key] for key in decayed]},
        {"params": [weights[key] for key in others], "weight_decay": 0.0},
    ]
    optimiser = torch.optim.AdamW(groups, lr=options.rate, weight_decay=options.decay)
    data = _checksum(scaler, train, validation)
    state = Checkpoint.read(file) or Checkpoint(
        epoch=0, data=data, weights=arrays(weights), moments={}, best=arrays(weights), score={}, at={}
    )
    if state.data != data:
        given = f"checkpoint {file} of other windows or another feature"
        raise InputError(given, "a checkpoint of this training", "name another --out, or remove that run")
    _refuse_other(file, state, weights, [*decayed, *others])
    _restore(weights, optimiser, state)
    while state.epoch < options.epochs and not _is_over(state, options):
        epoch = state.epoch
        for group in optimiser.param_groups:
            group["lr"] = 0.5 * options.rate * (1.0 + np.cos(np.pi * epoch / options.epochs))
        generator = torch.Generator().manual_seed(setup.seed * 1_000_003 + epoch + 1)
        order = torch.randperm(learned.count, generator=generator)
        copies = torch.randint(learned.copies, (learned.count,), generator=generator)
        shown = torch.rand(learned.count, generator=generator) >= setup.drop
        total = 0.0
        for first in range(0, learned.count, options.batch):
            batch = order[first : first + options.batch]
            loss = learned.loss(tasks, weights, batch, copies[batch], shown[batch], generator)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            total += float(loss.detach()) * len(batch) / learned.count
        scores = _scores(setup.definition, judged, weights)
        state = _next(state, weights, optimiser, {"loss": total, **scores}, scores)
        state.write(file)
        report(state)
    return state, _weights(setup.definition, state, judged, paths)


def _checksum(scaler: Mapping[str, Audio], train: Examples, validation: Examples) -> str:
    """Return the sha256 that identifies a training: windows, labels, and how features are scaled."""
    digest = hashlib.sha256()
    for examples in (train, validation):
        digest.update(np.ascontiguousarray(examples.rows, np.int64).tobytes())
        for name in sorted(examples.labels):
            digest.update(np.ascontiguousarray(examples.labels[name], np.float64).tobytes())
    for name in sorted(scaler):
        digest.update(np.ascontiguousarray(scaler[name]).tobytes())
    return digest.hexdigest()


def _is_over(state: Checkpoint, options: OptimiserSettings) -> bool:
    return bool(state.at) and state.epoch - max(state.at.values()) >= options.patience


def _refuse_other(file: Path, state: Checkpoint, weights: Mapping[str, Any], order: list[str]) -> None:
    """Refuse a checkpoint whose arrays do not match this network and its optimiser's order."""
    expected = {name: tuple(tensor.shape) for name, tensor in weights.items()}
    moments = {
        f"{number}/{kind}": () if kind == "step" else expected[name]
        for number, name in enumerate(order)
        for kind in ("step", "exp_avg", "exp_avg_sq")
    }
    for stored, shapes in ((state.weights, expected), (state.best, expected), (state.moments, moments)):
        if {name: array.shape for name, array in stored.items()} != shapes and (
            stored or stored is not state.moments
        ):
            raise InputError(
                f"checkpoint {file} of another network", "a checkpoint of these settings", REMEDY
            )


def _restore(weights: Mapping[str, Any], optimiser: Any, state: Checkpoint) -> None:
    torch = torch_library()
    with torch.no_grad():
        for name, tensor in weights.items():
            tensor.copy_(torch.from_numpy(state.weights[name]))
    moments: dict[int, dict[str, Any]] = {}
    for key, array in state.moments.items():
        number, _, kind = key.partition("/")
        moments.setdefault(int(number), {})[kind] = torch.from_numpy(array.copy())
    if moments:
        optimiser.load_state_dict({**optimiser.state_dict(), "state": moments})


def _next(
    state: Checkpoint, weights: Mapping[str, Any], optimiser: Any, line: Line, scores: Mapping[str, float]
) -> Checkpoint:
    """Return the checkpoint after one more epoch, in which a head that became better has new best weights."""
    now, epoch = arrays(weights), state.epoch + 1
    better = [name for name, score in scores.items() if score < state.score.get(name, np.inf)]
    best = {key: now[key] if key.partition(".")[0] in better else array for key, array in state.best.items()}
    moments = {
        f"{number}/{kind}": value.numpy().copy()
        for number, entry in optimiser.state_dict()["state"].items()
        for kind, value in entry.items()
    }
    return Checkpoint(
        epoch=epoch,
        data=state.data,
        weights=now,
        moments=moments,
        best=best,
        score={**state.score, **{name: scores[name] for name in better}},
        at={**state.at, **dict.fromkeys(better, epoch)},
        history=[*state.history, {"epoch": epoch, **line}],
    )


def _scores(
    definition: Definition, examples: TrainingTensors, weights: Mapping[str, Any]
) -> dict[str, float]:
    """Return the error of each head over all copies: log loss of a probability, MAE of a quantity."""
    scores: dict[str, float] = {}
    for name, record in definition.heads.items():
        errors: list[float] = []
        for copy in range(examples.copies):
            output, target = examples.whole_copy(name, record.task, weights, copy)
            mask = examples.masks[name]
            if record.task.is_probability:
                errors.append(float(head_loss(record.task, output, target, mask)))
            else:
                miss = (output[:, 0] - target).abs() * examples.residual(name) * record.scale
                errors.append(float((miss * mask).sum() / mask.sum()))
        scores[name] = float(np.mean(errors))
    return scores


def _weights(
    definition: Definition, state: Checkpoint, judged: TrainingTensors, paths: Mapping[str, LinearPath]
) -> dict[str, Audio]:
    """Return the weights of all heads as the model adds them: linear path, and the correction in its unit.

    The correction of the hidden layers is shrunk to the share that is best on validation, so that a head is
    never worse there than its linear path.
    """
    torch = torch_library()
    weights = dict(state.best)
    tensors = {name: torch.from_numpy(array) for name, array in state.best.items()}
    for name, path in paths.items():
        task = definition.heads[name].task
        mask = judged.masks[name]
        errors = np.zeros(len(SHRINKAGE))
        for copy in range(judged.copies):
            output, target = judged.whole_copy(name, task, tensors, copy)
            errors += [float(((s * output[:, 0] - target).abs() * mask).sum()) for s in SHRINKAGE]
        share = SHRINKAGE[int(np.argmin(errors))]
        last = f"{name}.{len(task.hidden)}"
        for kind in ("weight", "bias"):
            array = weights[f"{last}.{kind}"].copy()
            at = (..., 0, slice(None)) if kind == "weight" else (..., 0)
            array[at] *= share * path.residual
            weights[f"{last}.{kind}"] = array
        if task.outputs > 1:
            weights[f"{last}.bias"][..., 1] += np.log(path.residual)
        weights[f"{name}.linear.weight"] = path.weight[None].astype(np.float32)
        weights[f"{name}.linear.bias"] = np.array([path.bias], np.float32)
    return weights
