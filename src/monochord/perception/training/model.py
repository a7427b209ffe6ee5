"""The heads as torch tensors, under the names that a model's weights have."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from monochord.core.types import Audio
from monochord.perception.heads.base import Task
from monochord.perception.model.definition import Definition
from monochord.perception.training._torch import torch_library


def initial(definition: Definition, seed: int) -> dict[str, Any]:
    """Return the weights (float32, with gradients) of all heads before training, drawn from `seed`.

    Hidden layers: He et al. (2015), uniform. Last layers begin at zero, so that a head begins with the mean
    label.
    """
    torch = torch_library()
    generator = torch.Generator().manual_seed(seed)
    found: dict[str, Any] = {}
    for name, record in definition.heads.items():
        last = len(record.task.hidden)
        for number in range(last + 1):
            for kind in ("weight", "bias"):
                key = f"{name}.{number}.{kind}"
                shape = definition.shapes()[key]
                tensor = torch.zeros(shape)
                if number < last and kind == "weight":
                    bound = float(np.sqrt(6.0 / shape[1]))
                    tensor.uniform_(-bound, bound, generator=generator)
                found[key] = tensor.requires_grad_()
    return found


def forward(name: str, task: Task, weights: Mapping[str, Any], rows: Any) -> Any:
    """Return the answers (n, outputs) of a head to rows (n, inputs)."""
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
