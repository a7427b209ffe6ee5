"""The joint loss: what it values, and what it leaves alone."""

import math

import pytest

from monochord.perception.heads.base import Task
from monochord.perception.training.loss import head_loss, joint_loss

torch = pytest.importorskip("torch")
CHANCE = Task(label="slip", loss="logistic")
PLAIN, GAUSS, LAPLACE = (Task(label="force", unit="N", loss=loss) for loss in ("square", "gauss", "laplace"))
ALL = torch.ones(4)


def test_a_chance_has_the_logistic_loss() -> None:
    answer, label = torch.tensor([[0.0], [2.0], [-1.0], [0.5]]), torch.tensor([1.0, 1.0, 0.0, 0.0])
    by_hand = [
        math.log1p(math.exp(-sign * each)) for each, sign in ((0.0, 1), (2.0, 1), (-1.0, -1), (0.5, -1))
    ]
    assert float(head_loss(CHANCE, answer, label, ALL)) == pytest.approx(sum(by_hand) / 4)


def test_an_amount_has_the_mean_square() -> None:
    answer, label = torch.tensor([[1.0], [2.0], [3.0], [9.0]]), torch.tensor([1.0, 1.0, 5.0, 0.0])
    mask = torch.tensor([1.0, 1.0, 1.0, 0.0])
    assert float(head_loss(PLAIN, answer, label, mask)) == pytest.approx(5.0 / 3.0)


@pytest.mark.parametrize("task", [CHANCE, PLAIN, GAUSS, LAPLACE])
def test_windows_that_do_not_count_have_no_gradient(task: Task) -> None:
    answer = torch.randn(4, task.outputs, generator=torch.Generator().manual_seed(0)).requires_grad_()
    mask = torch.tensor([1.0, 0.0, 1.0, 0.0])
    head_loss(task, answer, torch.ones(4), mask).backward()
    assert not answer.grad[mask == 0.0].any()
    assert answer.grad[mask == 1.0].any(dim=1).all()


@pytest.mark.parametrize("task", [CHANCE, PLAIN, GAUSS, LAPLACE])
def test_a_batch_without_a_window_that_counts_loses_nothing(task: Task) -> None:
    loss = head_loss(task, torch.ones(4, task.outputs), torch.ones(4), torch.zeros(4))
    assert float(loss) == 0.0


@pytest.mark.parametrize(("task", "best"), [(GAUSS, 0.5), (LAPLACE, 0.5)])
def test_the_spread_that_is_learned_is_that_of_the_errors(task: Task, best: float) -> None:
    answer = torch.zeros(4, 2)
    answer[:, 1] = math.log(best)
    answer.requires_grad_()
    label = torch.tensor([0.5, -0.5, 0.5, -0.5])
    head_loss(task, answer, label, ALL).backward()
    assert float(answer.grad[:, 1].abs().max()) == pytest.approx(0.0, abs=1e-6)


def test_the_joint_loss_is_the_weighed_sum() -> None:
    tasks = {"slip": Task(label="slip", loss="logistic", weight=0.5), "force": PLAIN}
    answers = {"slip": torch.ones(4, 1), "force": torch.ones(4, 1)}
    labels, masks = dict.fromkeys(tasks, torch.zeros(4)), dict.fromkeys(tasks, ALL)
    alone = {name: float(head_loss(tasks[name], answers[name], labels[name], ALL)) for name in tasks}
    assert float(joint_loss(tasks, answers, labels, masks)) == pytest.approx(
        0.5 * alone["slip"] + alone["force"]
    )
