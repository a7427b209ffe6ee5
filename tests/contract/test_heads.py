"""The contract of every head: a task that training and prediction can carry out."""

import math

import pytest

from monochord.core.config import from_tree, to_tree
from monochord.core.errors import InputError
from monochord.perception.heads import HEADS
from monochord.perception.heads.base import CONTACT, Loss, Task

TASKS = {name: HEADS.build(name).task() for name in HEADS.names()}
each_task = pytest.mark.parametrize("task", TASKS.values(), ids=TASKS)


def test_exactly_one_head_tells_whether_something_touches() -> None:
    assert [name for name, task in TASKS.items() if task.label == CONTACT] == ["contact"]


@each_task
def test_what_tells_of_touching_needs_no_touch(task: Task) -> None:
    assert (task.label == CONTACT) == (not task.touched)


@each_task
def test_a_probability_has_no_unit_and_one_output(task: Task) -> None:
    assert task.is_probability == (task.loss == "logistic")
    if task.is_probability:
        assert (task.unit, task.outputs) == ("", 1)
    else:
        assert task.unit
        assert 0.0 < task.limit < math.inf


@each_task
def test_it_survives_being_written_down(task: Task) -> None:
    assert from_tree(Task, to_tree(task)) == task


@pytest.mark.parametrize("name", TASKS)
@pytest.mark.parametrize("options", [{"hidden": [0]}, {"hidden": [99999]}, {"weight": 0.0}, {"weight": -1.0}])
def test_options_that_make_no_sense_are_refused(name: str, options: dict[str, object]) -> None:
    with pytest.raises(InputError, match=next(iter(options))):
        HEADS.build(name, options).task()


@pytest.mark.parametrize("name", ["position", "force"])
def test_a_quantity_may_have_one_standard_error_for_all(name: str) -> None:
    assert HEADS.build(name, {"loss": "square"}).task().outputs == 1
    with pytest.raises(InputError, match=r"limit' = -1"):
        HEADS.build(name, {"limit": -1.0}).task()


@pytest.mark.parametrize("loss", ["logistic", "square"])
def test_a_position_is_refined_with_a_learned_standard_error_alone(loss: Loss) -> None:
    assert Task(label="position", unit="m", loss="laplace", refines="position").outputs == 2
    with pytest.raises(InputError, match="refines"):
        Task(label="position", unit="m", loss=loss, refines="position")
