"""The contract of every head: a task that training and prediction can carry out."""

import math

import pytest

from monochord.core.config import from_tree, to_tree
from monochord.core.errors import InputError
from monochord.perception.heads import HEADS
from monochord.perception.heads.base import CONTACT, Task

TASKS = {name: HEADS.build(name).task() for name in HEADS.names()}
each_task = pytest.mark.parametrize("task", TASKS.values(), ids=TASKS)


def test_exactly_one_head_tells_whether_something_touches() -> None:
    assert [name for name, task in TASKS.items() if task.label == CONTACT] == ["contact"]


@each_task
def test_what_tells_of_touching_needs_no_touch_and_no_reference(task: Task) -> None:
    assert (task.label == CONTACT) == (not task.touched)
    if task.label == CONTACT:
        assert not task.context


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
def test_options_that_make_no_sense_are_refused_in_a_line(name: str, options: dict[str, object]) -> None:
    with pytest.raises(InputError, match=r": allowed is "):
        HEADS.build(name, options).task()


def test_contact_and_slip_are_linear_and_position_and_force_are_not() -> None:
    layers = {name: (len(task.hidden), task.linear, task.outputs) for name, task in TASKS.items()}
    expected = {
        "contact": (0, False, 1),
        "slip": (0, False, 1),
        "position": (3, True, 2),
        "force": (3, True, 2),
    }
    assert layers == expected


@pytest.mark.parametrize("name", ["position", "force"])
def test_a_quantity_may_have_one_standard_error_for_all(name: str) -> None:
    assert HEADS.build(name, {"loss": "square"}).task().outputs == 1
    with pytest.raises(InputError, match="limit -1: allowed is a number above 0"):
        HEADS.build(name, {"limit": -1.0}).task()


def test_a_linear_path_of_a_probability_is_refused() -> None:
    with pytest.raises(InputError, match="a linear path with the logistic loss"):
        Task(label="slip", loss="logistic", linear=True)


@pytest.mark.parametrize("option", ["blur", "drop"])
def test_inputs_that_a_linear_path_sees_are_not_blurred(option: str) -> None:
    assert HEADS.build("force", {option: 0.1, "linear": False}).task().linear is False
    with pytest.raises(InputError, match=r"blur or drop beside a linear path: .* set linear = false"):
        HEADS.build("force", {option: 0.1, "linear": True}).task()
