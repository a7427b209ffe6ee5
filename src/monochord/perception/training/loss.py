"""The joint loss of all heads, masked: lambda_c L_c + 1[c=1] (lambda_s L_s + lambda_x L_x + lambda_F L_F)."""

from collections.abc import Mapping
from typing import Any

from monochord.perception.heads.base import Task
from monochord.perception.training._torch import torch_library

FAIRNESS = 0.5
"""Power of the spread that weighs a window's likelihood; 0 would leave hard windows unlearned."""


def head_loss(task: Task, answer: Any, label: Any, mask: Any) -> Any:
    """Return the mean loss of a head over the windows that count for it; 0 where none does.

    A chance has the logistic loss, an amount with one standard error for all the mean square. Where the
    spread is learned, it is the negative log-likelihood of normal or Laplace errors, each window weighed by
    its spread to the power `FAIRNESS`, through which no gradient goes: otherwise windows that are thought to
    be hard are hardly learned from, and stay hard.

    Parameters
    ----------
    task
        Of the head.
    answer
        Tensor (n, outputs): logit, or amount in its own scale and the log of its spread.
    label
        Tensor (n,): 0 or 1, or the amount in the same scale.
    mask
        Tensor (n,) of 0 and 1: the windows that count.

    References
    ----------
    Joint masked loss: Yi, Xing, Manchester and Fazeli, Sound of Touch. Weighed likelihood: Seitzer, Tavakoli,
    Antic and Martius, On the pitfalls of heteroscedastic uncertainty estimation (2022).
    """
    torch = torch_library()
    value = answer[:, 0]
    if task.loss == "logistic":
        each = torch.nn.functional.binary_cross_entropy_with_logits(value, label, reduction="none")
    elif task.loss == "square":
        each = (value - label) ** 2
    else:
        log_spread = answer[:, 1].clamp(-8.0, 8.0)
        off = value - label
        if task.loss == "gauss":
            each = 0.5 * off**2 * torch.exp(-2.0 * log_spread) + log_spread
            each = each * torch.exp(2.0 * FAIRNESS * log_spread).detach()
        else:
            each = off.abs() * torch.exp(-log_spread) + log_spread
            each = each * torch.exp(FAIRNESS * log_spread).detach()
    return (each * mask).sum() / mask.sum().clamp(min=1.0)


def joint_loss(
    tasks: Mapping[str, Task], answers: Mapping[str, Any], labels: Mapping[str, Any], masks: Mapping[str, Any]
) -> Any:
    """Return the sum of the heads' losses, each by its task's weight."""
    parts = [
        task.weight * head_loss(task, answers[name], labels[name], masks[name])
        for name, task in tasks.items()
    ]
    return torch_library().stack(parts).sum()
