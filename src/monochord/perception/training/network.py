"""The trainable part in PyTorch: examples as tensors, the heads' layers, and the joint loss."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from monochord.core.types import Audio
from monochord.perception.heads.base import Task
from monochord.perception.model.definition import Definition
from monochord.perception.model.network import STD_OF_SPREAD, scaled
from monochord.perception.model.rise import rises
from monochord.perception.training._torch import torch_library
from monochord.perception.training.examples import Examples
from monochord.perception.training.linear import LinearPath, folds_of, solve

SPREAD_POWER = 0.5
"""Power of the spread that weights a window's likelihood; with 0, difficult windows are not learned."""


class TrainingTensors:
    """Examples as scaled tensors, with the estimates of the linear paths."""

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
        self.rise: Any = None
        if definition.rise_columns:
            self.rise = torch.from_numpy(rises(examples.base, examples.context, definition.rise_columns))
        self.columns = {
            name: torch.tensor(definition.columns_of(name)) if record.task.columns else None
            for name, record in definition.heads.items()
        }
        self.reference = {
            name: torch.tensor(definition.reference_of(name)) if record.task.reference else None
            for name, record in definition.heads.items()
        }
        self.tasks = {name: record.task for name, record in definition.heads.items()}
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
        """Return the scale of a head's target, in standard deviations of its label."""
        return self._residual.get(name, 1.0)

    def solve_linear(self, examples: Examples) -> dict[str, LinearPath]:
        """Return the linear paths by head, solved on the windows that count for each head."""
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
        """Compute each linear path's contributions (copies, n) from the features and from the reference."""
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
            for copy in range(self.copies):
                beside = self._beside(name, self.tasks[name], copy, slice(None))
                if beside is not None:
                    context[copy] = (beside @ matrix[:, width:].T)[at, fold]
            self._linear[name] = torch.stack(parts), context
            self._residual[name] = path.residual

    def loss(
        self,
        tasks: Mapping[str, Task],
        weights: Mapping[str, Any],
        batch: Any,
        copies: Any,
        shown: Any,
        generator: Any,
    ) -> Any:
        """Return the joint loss of the windows `batch` in the given copies.

        `shown` says which windows have the reference as an input. Input noise and dropout use the generator.
        """
        outputs = {
            name: forward(name, task, weights, self._inputs(name, task, copies, batch, shown), generator)
            for name, task in tasks.items()
        }
        targets = {name: self._target(name, copies, batch, shown) for name in tasks}
        return joint_loss(tasks, outputs, targets, {name: self.masks[name][batch] for name in tasks})

    def whole_copy(self, name: str, task: Task, weights: Mapping[str, Any], copy: int) -> tuple[Any, Any]:
        """Return a head's outputs (n, k) and targets (n,) for all windows of a copy, without gradients."""
        with torch_library().no_grad():
            output = forward(name, task, weights, self._inputs(name, task, copy, slice(None), None))
            return _together(task, output), self._target(name, copy, slice(None), None)

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
        beside = self._beside(name, task, copies, batch)
        if beside is not None:
            row = torch_library().cat([row, beside if shown is None else beside * shown[:, None]], dim=1)
        return row

    def _beside(self, name: str, task: Task, copies: Any, batch: Any) -> Any:
        """Return a head's inputs besides the feature: reference and rise; None if it has neither."""
        parts: list[Any] = []
        if task.context and self.context is not None:
            context, columns = self.context[copies, batch], self.reference[name]
            parts.append(context if columns is None else context[:, columns])
        if task.rise:
            parts.append(self.rise[copies, batch])
        return torch_library().cat(parts, dim=1) if parts else None


def initial(definition: Definition, seed: int) -> dict[str, Any]:
    """Return the initial weights of all heads' layers (float32, with gradients) for a random seed.

    Hidden layers are uniform (He et al., 2015). Last layers are zero, so a head initially estimates the mean
    label, or its linear path.
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
                    bound = float(np.sqrt(6.0 / shapes[key][-1]))
                    tensor.uniform_(-bound, bound, generator=generator)
                weights[key] = tensor.requires_grad_()
    return weights


def forward(name: str, task: Task, weights: Mapping[str, Any], rows: Any, generator: Any = None) -> Any:
    """Return the outputs (n, k) of a head's layers for rows (n, inputs), or (m, n, k) of its m members.

    With a generator, as in training, the task's input noise (`blur`) and dropout (`drop`) apply. Input noise
    penalises steep dependence on the inputs (Bishop, Training with noise is equivalent to Tikhonov
    regularization, 1995); for dropout see Srivastava et al., Dropout (2014).
    """
    torch = torch_library()
    functional = torch.nn.functional
    if generator is not None and task.blur:
        rows = rows + task.blur * torch.randn(rows.shape, generator=generator)
    for number in range(len(task.hidden)):
        rows = functional.relu(_linear(rows, weights, f"{name}.{number}"))
        if generator is not None and task.drop:
            kept = torch.rand(rows.shape, generator=generator) >= task.drop
            rows = rows * kept / (1.0 - task.drop)
    return _linear(rows, weights, f"{name}.{len(task.hidden)}")


def _linear(rows: Any, weights: Mapping[str, Any], layer: str) -> Any:
    weight, bias = weights[f"{layer}.weight"], weights[f"{layer}.bias"]
    if weight.ndim == 2:
        return torch_library().nn.functional.linear(rows, weight, bias)
    return rows @ weight.transpose(1, 2) + bias[:, None]


def _together(task: Task, output: Any) -> Any:
    """Return the outputs (n, k) of all members as one, as the model does."""
    if task.members == 1:
        return output
    torch = torch_library()
    mean = output.mean(dim=0)
    if task.outputs > 1:
        apart = output[..., 0].var(dim=0, unbiased=False) / STD_OF_SPREAD[task.loss] ** 2
        mean[:, 1] = 0.5 * torch.log(torch.exp(2.0 * output[..., 1]).mean(dim=0) + apart)
    return mean


def arrays(weights: Mapping[str, Any]) -> dict[str, Audio]:
    """Return copies of tensors as arrays."""
    return {name: tensor.detach().numpy().copy() for name, tensor in weights.items()}


def head_loss(task: Task, output: Any, target: Any, mask: Any) -> Any:
    """Return the mean loss of a head over the windows that count for it; 0 if no window counts.

    A probability has the logistic loss. A quantity with a common standard error has the mean square. A
    quantity with a learned spread has the negative log-likelihood of normal or Laplace errors. There, each
    window is weighted by its spread to the power `SPREAD_POWER`, without a gradient; otherwise windows with a
    large spread would hardly be learned.

    Parameters
    ----------
    task
        Task of the head.
    output
        Tensor (..., n, outputs): a logit, or a scaled quantity and the logarithm of its spread.
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
    value = output[..., 0]
    target = target.expand_as(value)
    if task.loss == "logistic":
        each = torch.nn.functional.binary_cross_entropy_with_logits(value, target, reduction="none")
    elif task.loss == "square":
        each = (value - target) ** 2
    else:
        log_spread = output[..., 1].clamp(-8.0, 8.0)
        error = value - target
        if task.loss == "gauss":
            each = 0.5 * error**2 * torch.exp(-2.0 * log_spread) + log_spread
            each = each * torch.exp(2.0 * SPREAD_POWER * log_spread).detach()
        else:
            each = error.abs() * torch.exp(-log_spread) + log_spread
            each = each * torch.exp(SPREAD_POWER * log_spread).detach()
    return (each * mask).sum() / mask.sum().clamp(min=1.0)  # of all members, which share no weights


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
