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
from monochord.perception.training.linear import LinearPath, folds_of, solve
from monochord.perception.training.settings import OptimiserSettings

SPREAD_POWER = 0.5
"""Power of the spread by which a window's likelihood is weighted; with 0 hard windows stay unlearned."""
SHRINKAGE = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Shares of the hidden layers' correction that are tried; 0 is the linear path alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingSetup:
    """All that training depends on, beside its examples."""

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
    """Train all heads together until none becomes better on validation.

    The linear paths are solved first; hidden layers learn what these leave over. What an epoch draws depends
    on the seed and its number alone, and the state is written to `file` after each: a run that was killed
    goes on from there and ends with the same weights.

    Parameters
    ----------
    setup
        Network, optimiser and seed.
    scaler
        The arrays ``scaler.*`` and ``context.*`` of the model.
    train, validation
        Examples to learn from, and those by which training ends.
    file
        For the checkpoint.
    report
        Called with each checkpoint.

    Returns
    -------
    Checkpoint
        The state after the last epoch.
    dict
        The weights of all heads, each of its best epoch.

    Raises
    ------
    InputError
        If `file` is damaged, or the checkpoint of a training on other data.
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
    torch, tasks, options = torch_library(), _tasks(setup.definition), setup.optimiser
    learned, judged = (_Tensors(setup.definition, scaler, each) for each in (train, validation))
    paths = learned.solve_linear(train)
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
        raise InputError(given, "one of these", "name another --out, or remove that run")
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
            loss = learned.loss(tasks, weights, batch, copies[batch], shown[batch])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            total += float(loss.detach()) * len(batch) / learned.count
        scores = _scores(setup.definition, judged, weights)
        state = _next(state, weights, optimiser, {"loss": total, **scores}, scores)
        state.write(file)
        report(state)
    return state, _weights(setup.definition, state, judged, paths)


def _tasks(definition: Definition) -> dict[str, Task]:
    return {name: record.task for name, record in definition.heads.items()}


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
    """Refuse a checkpoint whose arrays are not those of this network, and of its optimiser in this order."""
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
            raise InputError(f"checkpoint {file} of another network", "one of these settings", REMEDY)


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


def _scores(definition: Definition, examples: "_Tensors", weights: Mapping[str, Any]) -> dict[str, float]:
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
    definition: Definition, state: Checkpoint, judged: "_Tensors", paths: Mapping[str, LinearPath]
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
            array[0] *= share * path.residual
            weights[f"{last}.{kind}"] = array
        if task.outputs > 1:
            weights[f"{last}.bias"][1] += np.log(path.residual)
        weights[f"{name}.linear.weight"] = path.weight[None].astype(np.float32)
        weights[f"{name}.linear.bias"] = np.array([path.bias], np.float32)
    return weights


class _Tensors:
    """Examples as tensors, scaled as a model scales, beside the estimates of the linear paths."""

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
        self.columns = {
            name: torch.tensor(definition.columns_of(name)) if record.task.columns else None
            for name, record in definition.heads.items()
        }
        self.tasks = _tasks(definition)
        self.copies, self.count = examples.base.shape[:2]
        self.labels: dict[str, Any] = {}
        self.masks: dict[str, Any] = {}
        self._linear: dict[str, tuple[Any, Any]] = {}
        self._residual: dict[str, float] = {}
        for name, record in definition.heads.items():
            label = (examples.labels[name] - record.offset) / record.scale
            self.labels[name] = torch.from_numpy(label.astype(np.float32))
            self.masks[name] = torch.from_numpy(examples.masks[name].astype(np.float32))

    def residual(self, name: str) -> float:
        """Return the unit of a head's target, in standard deviations of its label."""
        return self._residual.get(name, 1.0)

    def solve_linear(self, examples: Examples) -> dict[str, LinearPath]:
        """Return the linear paths of the heads that have one, of the windows that count for them."""
        paths: dict[str, LinearPath] = {}
        for name, task in self.tasks.items():
            if not task.linear:
                continue
            mask = examples.masks[name]
            fold = folds_of(examples.session, examples.touch)
            rows = [
                self._inputs(name, task, copy, slice(None), None).numpy()[mask] for copy in range(self.copies)
            ]
            path = solve(rows, self.labels[name].numpy().astype(np.float64)[mask], fold[mask])
            paths[name] = LinearPath(
                weight=path.weight,
                bias=path.bias,
                folds=path.folds,
                fold=np.minimum(fold, len(path.folds) - 1),
                residual=path.residual,
                penalty=path.penalty,
            )
        return paths

    def add_linear(self, paths: Mapping[str, LinearPath], *, out_of_fold: bool) -> None:
        """Compute what each linear path adds for features and for the reference, (copies, n) each."""
        torch = torch_library()
        for name, path in paths.items():
            solutions = list(path.folds) if out_of_fold else [(path.weight, path.bias)]
            fold = torch.from_numpy(path.fold if out_of_fold else np.zeros(self.count, np.int64))
            matrix = torch.from_numpy(np.stack([weight for weight, _ in solutions]).astype(np.float32))
            bias = torch.tensor([bias for _, bias in solutions], dtype=torch.float32)[fold]
            columns = self.columns[name]
            width = self.base.shape[-1] if columns is None else len(columns)
            at = torch.arange(self.count)
            parts: list[Any] = []
            for copy in range(self.copies):
                base = self.base[copy] if columns is None else self.base[copy][:, columns]
                parts.append((base @ matrix[:, :width].T)[at, fold] + bias)
            context = torch.zeros(self.copies, self.count)
            if self.tasks[name].context and self.context is not None:
                context = torch.stack([(each @ matrix[:, width:].T)[at, fold] for each in self.context])
            self._linear[name] = torch.stack(parts), context
            self._residual[name] = path.residual

    def loss(
        self, tasks: Mapping[str, Task], weights: Mapping[str, Any], batch: Any, copies: Any, shown: Any
    ) -> Any:
        """Return the joint loss of windows, of the copies named, with the reference where `shown`."""
        outputs = {
            name: forward(name, task, weights, self._inputs(name, task, copies, batch, shown))
            for name, task in tasks.items()
        }
        targets = {name: self._target(name, copies, batch, shown) for name in tasks}
        return joint_loss(tasks, outputs, targets, {name: self.masks[name][batch] for name in tasks})

    def whole_copy(self, name: str, task: Task, weights: Mapping[str, Any], copy: int) -> tuple[Any, Any]:
        """Return outputs (n, k) and targets (n,) of a head for all windows of a copy, without gradients."""
        with torch_library().no_grad():
            output = forward(name, task, weights, self._inputs(name, task, copy, slice(None), None))
            return output, self._target(name, copy, slice(None), None)

    def _target(self, name: str, copies: Any, batch: Any, shown: Any) -> Any:
        """Return the target of a head's layers: the label, or what its linear path leaves over."""
        label = self.labels[name][batch]
        if name not in self._linear:
            return label
        base, context = (part[copies, batch] for part in self._linear[name])
        return (label - base - (context if shown is None else context * shown)) / self._residual[name]

    def _inputs(self, name: str, task: Task, copies: Any, batch: Any, shown: Any) -> Any:
        base, columns = self.base[copies, batch], self.columns[name]
        row = base if columns is None else base[:, columns]
        if task.context and self.context is not None:
            context = self.context[copies, batch]
            row = torch_library().cat([row, context if shown is None else context * shown[:, None]], dim=1)
        return row


def initial(definition: Definition, seed: int) -> dict[str, Any]:
    """Return the weights (float32, with gradients) of all heads' layers before training, drawn from `seed`.

    Hidden layers: He et al. (2015), uniform. Last layers begin at zero, so that a head begins with the mean
    label, or with its linear path.
    """
    torch = torch_library()
    generator = torch.Generator().manual_seed(seed)
    shapes = definition.shapes()
    weights: dict[str, Any] = {}
    for name, record in definition.heads.items():
        last = len(record.task.hidden)
        for number in range(last + 1):
            for kind in ("weight", "bias"):
                key = f"{name}.{number}.{kind}"
                tensor = torch.zeros(shapes[key])
                if number < last and kind == "weight":
                    bound = float(np.sqrt(6.0 / shapes[key][1]))
                    tensor.uniform_(-bound, bound, generator=generator)
                weights[key] = tensor.requires_grad_()
    return weights


def forward(name: str, task: Task, weights: Mapping[str, Any], rows: Any) -> Any:
    """Return the outputs (n, outputs) of a head's layers for rows (n, inputs)."""
    functional = torch_library().nn.functional
    for number in range(len(task.hidden)):
        rows = functional.relu(
            functional.linear(rows, weights[f"{name}.{number}.weight"], weights[f"{name}.{number}.bias"])
        )
    last = len(task.hidden)
    return functional.linear(rows, weights[f"{name}.{last}.weight"], weights[f"{name}.{last}.bias"])


def arrays(weights: Mapping[str, Any]) -> dict[str, Audio]:
    """Return tensors as arrays of their own."""
    return {name: tensor.detach().numpy().copy() for name, tensor in weights.items()}


def head_loss(task: Task, output: Any, target: Any, mask: Any) -> Any:
    """Return the mean loss of a head over the windows that count for it; 0 where none does.

    A probability has the logistic loss, a quantity with one standard error for all the mean square. Where the
    spread is learned, it is the negative log-likelihood of normal or Laplace errors, each window weighted by
    its spread to the power `SPREAD_POWER`, through which no gradient goes: otherwise windows that are thought
    to be hard are hardly learned from, and stay hard.

    Parameters
    ----------
    task
        Of the head.
    output
        Tensor (n, outputs): logit, or scaled quantity and the log of its spread.
    target
        Tensor (n,): 0 or 1, or the quantity in the same scale.
    mask
        Tensor (n,) of 0 and 1: the windows that count.

    References
    ----------
    Joint masked loss: Yi, Xing, Manchester and Fazeli, Sound of Touch. Weighted likelihood: Seitzer,
    Tavakoli, Antic and Martius, On the pitfalls of heteroscedastic uncertainty estimation (2022).
    """
    torch = torch_library()
    value = output[:, 0]
    if task.loss == "logistic":
        each = torch.nn.functional.binary_cross_entropy_with_logits(value, target, reduction="none")
    elif task.loss == "square":
        each = (value - target) ** 2
    else:
        log_spread = output[:, 1].clamp(-8.0, 8.0)
        error = value - target
        if task.loss == "gauss":
            each = 0.5 * error**2 * torch.exp(-2.0 * log_spread) + log_spread
            each = each * torch.exp(2.0 * SPREAD_POWER * log_spread).detach()
        else:
            each = error.abs() * torch.exp(-log_spread) + log_spread
            each = each * torch.exp(SPREAD_POWER * log_spread).detach()
    return (each * mask).sum() / mask.sum().clamp(min=1.0)


def joint_loss(
    tasks: Mapping[str, Task],
    outputs: Mapping[str, Any],
    targets: Mapping[str, Any],
    masks: Mapping[str, Any],
) -> Any:
    """Return lambda_c L_c + 1[c=1] (lambda_s L_s + lambda_x L_x + lambda_F L_F), weighted by the tasks."""
    parts = [
        task.weight * head_loss(task, outputs[name], targets[name], masks[name])
        for name, task in tasks.items()
    ]
    return torch_library().stack(parts).sum()
