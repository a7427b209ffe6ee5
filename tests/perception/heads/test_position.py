"""The head `position`."""

import pytest

from monochord.core.errors import InputError
from monochord.perception.heads.position import Position


def test_it_has_three_hidden_layers_and_states_its_doubt() -> None:
    task = Position().task()
    assert (task.label, len(task.hidden), task.outputs) == ("position", 3, 2)
    assert task.touched
    assert task.context


def test_as_in_the_paper_it_states_one_error_for_all() -> None:
    assert Position(loss="square").task().outputs == 1


def test_a_limit_below_zero_is_refused() -> None:
    with pytest.raises(InputError, match="limit -1 of a standard error: allowed is a number above 0"):
        Position(limit=-1.0).task()
