"""The training loop, readable top to bottom."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.perception.heads.base import Task
from monochord.perception.model.definition import Definition
from monochord.perception.model.network import scaled
from monochord.perception.training._torch import torch_library
from monochord.perception.training.checkpoint import REMEDY, Checkpoint, Line
from monochord.perception.training.examples import Examples
from monochord.perception.training.loss import head_loss, joint_loss
from monochord.perception.training.model import arrays, forward, initial
from monochord.perception.training.settings import OptimiserSettings


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """All that training depends on, beside its examples."""

    definition: Definition
    optimiser: OptimiserSettings
    drop: float
    seed: int


def fit(
    plan: Plan,
    scaler: Mapping[str, Audio],
    train: Examples,
    validation: Examples,
    file: Path,
    told: Callable[[Checkpoint], None] = lambda _: None,
) -> Checkpoint:
    """Train all heads together until no one becomes better on validation, and return where that ended.

    What an epoch draws depends on the seed and its number alone, and where it stands is written to `file`
    after each: a run that was killed goes on from there and ends with the same weights.

    Parameters
    ----------
    plan
        Network, optimiser and seed.
    scaler
        The arrays ``scaler.*`` and ``context.*`` of the model.
    train, validation
        What is learned from, and what tells when to end.
    file
        For the checkpoint.
    told
        Is shown each.

    Raises
    ------
    InputError
        If `file` is damaged, or the checkpoint of a training on other data.
    """
    torch = torch_library()
    threads = torch.get_num_threads()
    torch.set_num_threads(plan.optimiser.threads)
    try:
        return _fit(plan, scaler, train, validation, file, told)
    finally:
        torch.set_num_threads(threads)


def _fit(
    plan: Plan,
    scaler: Mapping[str, Audio],
    train: Examples,
    validation: Examples,
    file: Path,
    told: Callable[[Checkpoint], None],
) -> Checkpoint:
    torch, tasks, options = torch_library(), _tasks(plan.definition), plan.optimiser
    seen, judged = (_Tensors(plan.definition, scaler, each) for each in (train, validation))
    weights = initial(plan.definition, plan.seed)
    decayed = [key for key in weights if key.endswith("weight") and tasks[key.partition(".")[0]].hidden]
    free = [key for key in weights if key not in decayed]
    groups: list[dict[str, Any]] = [
        {"params": [weights[key] for key in decayed]},
        {"params": [weights[key] for key in free], "weight_decay": 0.0},
    ]
    optimiser = torch.optim.AdamW(groups, lr=options.rate, weight_decay=options.decay)
    data = _checksum(scaler, train, validation)
    state = Checkpoint.read(file) or Checkpoint(
        epoch=0, data=data, weights=arrays(weights), moments={}, best=arrays(weights), score={}, at={}
    )
    if state.data != data:
        given = f"checkpoint {file} of other windows or another feature"
        raise InputError(given, "one of these", "name another --out, or remove that run")
    _refuse_other(file, state, weights, [*decayed, *free])
    _restore(weights, optimiser, state)
    while state.epoch < options.epochs and not _is_over(state, options):
        epoch = state.epoch
        for group in optimiser.param_groups:
            group["lr"] = 0.5 * options.rate * (1.0 + np.cos(np.pi * epoch / options.epochs))
        draw = torch.Generator().manual_seed(plan.seed * 1_000_003 + epoch + 1)
        order = torch.randperm(seen.count, generator=draw)
        copies = torch.randint(seen.copies, (seen.count,), generator=draw)
        shown = torch.rand(seen.count, generator=draw) >= plan.drop
        total = 0.0
        for first in range(0, seen.count, options.batch):
            some = order[first : first + options.batch]
            answers = seen.answers(tasks, weights, some, copies[some], shown[some])
            labels = {name: seen.labels[name][some] for name in tasks}
            masks = {name: seen.masks[name][some] for name in tasks}
            loss = joint_loss(tasks, answers, labels, masks)
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            total += float(loss.detach()) * len(some) / seen.count
        scores = _scores(plan.definition, judged, weights)
        state = _next(state, weights, optimiser, {"loss": total, **scores}, scores)
        state.write(file)
        told(state)
    return state


def _tasks(definition: Definition) -> dict[str, Task]:
    return {name: record.task for name, record in definition.heads.items()}


def _checksum(scaler: Mapping[str, Audio], train: Examples, validation: Examples) -> str:
    """Return the sha256 of what tells one training from another: windows, labels, and how features scale."""
    told = hashlib.sha256()
    for examples in (train, validation):
        told.update(np.ascontiguousarray(examples.rows, np.int64).tobytes())
        for name in sorted(examples.labels):
            told.update(np.ascontiguousarray(examples.labels[name], np.float64).tobytes())
    for name in sorted(scaler):
        told.update(np.ascontiguousarray(scaler[name]).tobytes())
    return told.hexdigest()


def _is_over(state: Checkpoint, options: OptimiserSettings) -> bool:
    return bool(state.at) and state.epoch - max(state.at.values()) >= options.patience


def _refuse_other(file: Path, state: Checkpoint, weights: Mapping[str, Any], order: list[str]) -> None:
    """Refuse a checkpoint whose arrays are not those of this network, and of its optimiser in this order."""
    due = {name: tuple(tensor.shape) for name, tensor in weights.items()}
    moments = {
        f"{number}/{kind}": () if kind == "step" else due[name]
        for number, name in enumerate(order)
        for kind in ("step", "exp_avg", "exp_avg_sq")
    }
    for held, shapes in ((state.weights, due), (state.best, due), (state.moments, moments)):
        if {name: array.shape for name, array in held.items()} != shapes and (
            held or held is not state.moments
        ):
            raise InputError(f"checkpoint {file} of another network", "one of these settings", REMEDY)


def _restore(weights: Mapping[str, Any], optimiser: Any, state: Checkpoint) -> None:
    torch = torch_library()
    with torch.no_grad():
        for name, tensor in weights.items():
            tensor.copy_(torch.from_numpy(state.weights[name]))
    kept: dict[int, dict[str, Any]] = {}
    for key, array in state.moments.items():
        number, _, kind = key.partition("/")
        kept.setdefault(int(number), {})[kind] = torch.from_numpy(array.copy())
    if kept:
        optimiser.load_state_dict({**optimiser.state_dict(), "state": kept})


def _next(
    state: Checkpoint, weights: Mapping[str, Any], optimiser: Any, line: Line, scores: Mapping[str, float]
) -> Checkpoint:
    """Return the checkpoint after one more epoch, in which a head that became better has new best weights."""
    now, epoch = arrays(weights), state.epoch + 1
    better = [name for name, score in scores.items() if score < state.score.get(name, np.inf)]
    best = {key: now[key] if key.partition(".")[0] in better else array for key, array in state.best.items()}
    moments = {
        f"{number}/{kind}": value.numpy().copy()
        for number, held in optimiser.state_dict()["state"].items()
        for kind, value in held.items()
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


def _scores(definition: Definition, examples: "_Tensors", weights: Mapping[str, Any]) -> dict[str, float]:
    """Return by head how far off it is on all copies: log loss of a chance, mean error of an amount."""
    torch, found = torch_library(), dict[str, float]()
    tasks = _tasks(definition)
    everything = torch.arange(examples.count)
    with torch.no_grad():
        shown = torch.ones(examples.count, dtype=torch.bool)
        for copy in range(examples.copies):
            which = torch.full((examples.count,), copy)
            answers = examples.answers(tasks, weights, everything, which, shown)
            for name, record in definition.heads.items():
                label, mask = examples.labels[name], examples.masks[name]
                if record.task.is_chance:
                    off = float(head_loss(record.task, answers[name], label, mask))
                else:
                    miss = (answers[name][:, 0] - label).abs()
                    off = float((miss * mask).sum() / mask.sum()) * record.scale
                found[name] = found.get(name, 0.0) + off / examples.copies
    return found


class _Tensors:
    """Examples as tensors, scaled as a model scales."""

    def __init__(self, definition: Definition, scaler: Mapping[str, Audio], examples: Examples) -> None:
        torch = torch_library()
        clip = definition.clip
        base = scaled(examples.base, scaler["scaler.mean"], scaler["scaler.scale"], clip)
        self.base = torch.from_numpy(base)
        self.context: Any = None
        if definition.widths[1]:
            context = scaled(examples.context, scaler["context.mean"], scaler["context.scale"], clip)
            context *= examples.context[..., -1:]
            self.context = torch.from_numpy(context)
        self.seen = {
            name: torch.tensor(definition.seen(name)) if record.task.columns else None
            for name, record in definition.heads.items()
        }
        self.copies, self.count = examples.base.shape[:2]
        self.labels: dict[str, Any] = {}
        self.masks: dict[str, Any] = {}
        for name, record in definition.heads.items():
            label = (examples.labels[name] - record.offset) / record.scale
            self.labels[name] = torch.from_numpy(label.astype(np.float32))
            self.masks[name] = torch.from_numpy(examples.masks[name].astype(np.float32))

    def answers(
        self, tasks: Mapping[str, Task], weights: Mapping[str, Any], some: Any, copies: Any, shown: Any
    ) -> dict[str, Any]:
        """Return what each head answers for windows, of the copies named, with the reference if shown."""
        base = self.base[copies, some]
        context = self.context[copies, some] * shown[:, None] if self.context is not None else None
        found: dict[str, Any] = {}
        for name, task in tasks.items():
            seen = self.seen[name]
            row = base if seen is None else base[:, seen]
            if task.context and context is not None:
                row = torch_library().cat([row, context], dim=1)
            found[name] = forward(name, task, weights, row)
        return found
