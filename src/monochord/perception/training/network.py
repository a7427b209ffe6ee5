"""The trainable part in PyTorch: examples as tensors, the heads' layers, and the joint loss."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np

from monochord.core.types import Audio
from monochord.perception.heads.base import REFINED_SCALE, RIGHT_WITHIN, Task
from monochord.perception.model.definition import Definition
from monochord.perception.training._torch import torch_library
from monochord.perception.training.examples import Examples, inputs_of, targets_of

MAX_REFINED_LOSS = 20.0
"""Largest loss of a window from the error of a refined position."""
SPREAD_POWER = 0.5
"""Power of the spread that weights a window's likelihood; with 0, difficult windows are not learned."""


class TrainingTensors:
    """Examples as scaled tensors, made batch by batch: `copies` copies of `count` windows."""

    def __init__(self, definition: Definition, scaler: Mapping[str, Audio], examples: Examples) -> None:
        torch = torch_library()
        self.copies, self.count = examples.base.shape[:2]
        self.tasks = {name: record.task for name, record in definition.heads.items()}
        self._examples, self._definition, self._scaler = examples, definition, scaler
        self._columns = {name: torch.tensor(definition.columns_of(name)) for name in self.tasks}
        self._targets: dict[str, Any] = {}
        self.masks: dict[str, Any] = {}
        for name in self.tasks:
            target = targets_of(definition, name, examples)
            self._targets[name] = torch.from_numpy(target.astype(np.float32))
            self.masks[name] = torch.from_numpy(examples.masks[name].astype(np.float32))

    def loss(self, heads: Any, batch: Any, copies: Any) -> Any:
        """Return the joint loss of the windows `batch` (n,) in the given copies (n,).

        It is lambda_c L_c + 1[c=1] (lambda_s L_s + lambda_x L_x + lambda_F L_F), with the tasks' weights.
        """
        some = self._examples.at(copies.numpy(), batch.numpy())
        rows = torch_library().from_numpy(inputs_of(self._definition, self._scaler, some)[0])
        return sum(
            task.weight
            * head_loss(
                task,
                forward(task, heads[name], rows[:, self._columns[name]]),
                self._targets[name][copies, batch],
                self.masks[name][batch],
            )
            for name, task in self.tasks.items()
        )

    def outputs(self, heads: Any) -> Iterator[tuple[str, Any, Any, Any]]:
        """Yield each head with its outputs (n, k), targets (n,) and mask (n,), for all windows of all copies.

        Windows come block by block, copy by copy, without gradients.
        """
        torch = torch_library()
        for at, block in self._examples.blocks():
            for copy, inputs in enumerate(inputs_of(self._definition, self._scaler, block)):
                rows = torch.from_numpy(inputs)
                for name, task in self.tasks.items():
                    with torch.no_grad():
                        output = forward(task, heads[name], rows[:, self._columns[name]])
                    yield name, output, self._targets[name][copy, at], self.masks[name][at]


def heads_module(definition: Definition, seed: int) -> Any:
    """Return the layers of all heads as a torch module, whose state has the names of `Definition.shapes`.

    Hidden layers are uniform (He et al., 2015). Last layers are zero, so a head initially estimates the mean
    label.
    """
    torch = torch_library()
    torch.manual_seed(seed)
    heads: dict[str, Any] = {}
    for name, record in definition.heads.items():
        units = (len(definition.columns_of(name)), *record.task.hidden, record.task.outputs)
        layers = [torch.nn.Linear(*pair) for pair in pairwise(units)]
        for layer in layers[:-1]:
            torch.nn.init.kaiming_uniform_(layer.weight, nonlinearity="relu")
            torch.nn.init.zeros_(layer.bias)
        torch.nn.init.zeros_(layers[-1].weight)
        torch.nn.init.zeros_(layers[-1].bias)
        heads[name] = torch.nn.ModuleList(layers)
    return torch.nn.ModuleDict(heads)


def forward(task: Task, layers: Any, rows: Any) -> Any:
    """Return the outputs (n, k) of a head's layers for rows (n, inputs).

    In training, the task's input noise (`blur`) and dropout (`drop`) apply. Input noise penalises steep
    dependence on the inputs (Bishop, Training with noise is equivalent to Tikhonov regularization, 1995); for
    dropout see Srivastava et al., Dropout (2014).
    """
    torch = torch_library()
    functional, training = torch.nn.functional, layers.training
    if training and task.blur:
        rows = rows + task.blur * torch.randn_like(rows)
    for layer in layers[:-1]:
        rows = functional.dropout(functional.relu(layer(rows)), task.drop, training)
    return layers[-1](rows)


def arrays(heads: Any) -> dict[str, Audio]:
    """Return copies of a module's weights as arrays."""
    return {name: tensor.numpy().copy() for name, tensor in heads.state_dict().items()}


def head_loss(task: Task, output: Any, target: Any, mask: Any) -> Any:
    """Return the mean loss of a head over the windows that count for it; 0 if no window counts.

    A probability has the logistic loss. A quantity with a common standard error has the mean square. A
    quantity with a learned spread has the negative log-likelihood of normal or Laplace errors. There, each
    window is weighted by its spread to the power `SPREAD_POWER`, without a gradient; otherwise windows with a
    large spread would hardly be learned.

    A head that refines a position learns its error where the position is right within `RIGHT_WITHIN`: a wrong
    one tells nothing of the error of right ones.

    `output` (..., n, outputs) is a logit, or a scaled quantity and the logarithm of its spread; `target` (n,)
    is 0 or 1, or the quantity in the same scale. `mask` (n,) is 1 for the windows that count, else 0.

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
        if task.refines:
            right = (target.abs() < RIGHT_WITHIN / REFINED_SCALE).float()
            each = (each * right).clamp(max=MAX_REFINED_LOSS)
    return (each * mask).sum() / mask.sum().clamp(min=1.0)  # of all members, which share no weights
