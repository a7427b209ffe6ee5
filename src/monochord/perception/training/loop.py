"""The training loop, readable top to bottom."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import cos, pi
from pathlib import Path
from typing import Any

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.perception.heads.base import Task
from monochord.perception.model.definition import Definition
from monochord.perception.training._torch import torch_library
from monochord.perception.training.checkpoint import REMEDY, Checkpoint, Line
from monochord.perception.training.examples import Examples
from monochord.perception.training.network import TrainingTensors, arrays, head_loss, heads_module
from monochord.perception.training.settings import OptimiserSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingSetup:
    """Everything that determines a training, apart from its examples."""

    definition: Definition
    optimiser: OptimiserSettings
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

    Returned are the state after the last epoch, and the weights of each head from its best epoch. The random
    numbers of an epoch depend on the seed and the epoch only. Each epoch writes a checkpoint to `file`, from
    which an interrupted run continues to the same weights, and calls `report` with it. `scaler` are the
    arrays ``scaler.*`` of the model. Raises `InputError` if `file` is damaged, or is a checkpoint of a
    training on other data.
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
    heads, data = heads_module(setup.definition, setup.seed), training_checksum(scaler, train, validation)
    state = Checkpoint.read(file) or Checkpoint(
        epoch=0, data=data, weights=arrays(heads), moments={}, best=arrays(heads), score={}, at={}
    )
    if state.data != data:
        given = f"checkpoint {file} of other windows or another feature"
        raise InputError(given, "a checkpoint of this training", "name another --out, or remove that run")
    optimiser = _restored(heads, learned.tasks, options, state, file)

    def rate(epoch: int) -> float:
        return 0.5 + 0.5 * cos(pi * epoch / options.epochs)

    schedule = torch.optim.lr_scheduler.LambdaLR(optimiser, rate, last_epoch=state.epoch - 1)
    while state.epoch < options.epochs and not _is_over(state, options):
        torch.manual_seed(setup.seed * 1_000_003 + state.epoch + 1)
        copies = torch.randint(learned.copies, (learned.count,))
        total = 0.0
        heads.train()
        for batch in torch.randperm(learned.count).split(options.batch):
            loss = learned.loss(heads, batch, copies[batch])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            total += float(loss.detach()) * len(batch) / learned.count
        schedule.step()
        scores = _scores(setup.definition, judged, heads.eval())
        state = _next(state, heads, optimiser, {"loss": total, **scores}, scores)
        state.write(file)
        report(state)
    return state, state.best


def training_checksum(scaler: Mapping[str, Audio], train: Examples, validation: Examples) -> str:
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


def _restored(
    heads: Any, tasks: Mapping[str, Task], options: OptimiserSettings, state: Checkpoint, file: Path
) -> Any:
    """Restore the heads from a checkpoint, and return the optimiser; weights of hidden layers decay."""
    torch, weights = torch_library(), dict(heads.named_parameters())
    decayed = [key for key in weights if key.endswith("weight") and tasks[key.partition(".")[0]].hidden]
    order = [*decayed, *(key for key in weights if key not in decayed)]
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
            given = f"checkpoint {file} of another network"
            raise InputError(given, "a checkpoint of these settings", REMEDY)
    groups = [
        {"params": [weights[key] for key in keys], "weight_decay": decay, "initial_lr": options.rate}
        for keys, decay in ((decayed, options.decay), (order[len(decayed) :], 0.0))
    ]
    optimiser = torch.optim.AdamW(groups, lr=options.rate)
    heads.load_state_dict({name: torch.from_numpy(array) for name, array in state.weights.items()})
    entries: dict[int, dict[str, Any]] = {}
    for key, array in state.moments.items():
        number, _, kind = key.partition("/")
        entries.setdefault(int(number), {})[kind] = torch.from_numpy(array.copy())
    if entries:
        optimiser.load_state_dict({**optimiser.state_dict(), "state": entries})
    return optimiser


def _next(
    state: Checkpoint, heads: Any, optimiser: Any, line: Line, scores: Mapping[str, float]
) -> Checkpoint:
    """Return the checkpoint after one more epoch, in which a head that became better has new best weights."""
    now, epoch = arrays(heads), state.epoch + 1
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


def _scores(definition: Definition, examples: TrainingTensors, heads: Any) -> dict[str, float]:
    """Return the error of each head over all copies: log loss of a probability, MAE of a quantity.

    Of a head that refines a position, it is the loss: a wrong position says little of the error of others.
    """
    sums, counts = dict.fromkeys(definition.heads, 0.0), dict.fromkeys(definition.heads, 0.0)
    for name, output, target, mask in examples.outputs(heads):
        record, count = definition.heads[name], float(mask.sum())
        if record.task.is_probability or record.task.refines:
            sums[name] += count * float(head_loss(record.task, output, target, mask))
        else:
            sums[name] += record.scale * float(((output[:, 0] - target).abs() * mask).sum())
        counts[name] += count
    return {name: sums[name] / counts[name] for name in definition.heads}
