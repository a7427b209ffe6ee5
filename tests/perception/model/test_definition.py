"""What a model says of itself."""

import dataclasses

import pytest

from monochord.core.config import from_tree, to_tree
from monochord.core.errors import InputError
from monochord.perception.model import Definition, Model
from monochord.perception.model.definition import Calibration


def test_the_shapes_follow_from_columns_and_layers(drawn: Model) -> None:
    shapes = drawn.definition.shapes()
    assert shapes["scaler.mean"] == (50,)
    assert shapes["context.scale"] == (11,)
    assert shapes["contact.0.weight"] == (1, 50)
    assert shapes["slip.0.weight"] == (1, 61)
    assert (shapes["force.linear.weight"], shapes["force.linear.bias"]) == ((1, 61), (1,))
    assert "contact.linear.weight" not in shapes
    assert [shapes[f"position.{k}.weight"] for k in range(4)] == [(128, 61), (128, 128), (128, 128), (2, 128)]


def test_without_a_reference_heads_see_the_window_alone(drawn: Model) -> None:
    alone = dataclasses.replace(drawn.definition, reference=None)
    assert alone.widths == (50, 0)
    assert alone.inputs("force") == 50


def test_it_survives_being_written_down(drawn: Model) -> None:
    assert from_tree(Definition, to_tree(drawn.definition)) == drawn.definition


def test_one_head_must_estimate_contact(drawn: Model) -> None:
    heads = {name: record for name, record in drawn.definition.heads.items() if name != "contact"}
    with pytest.raises(
        InputError, match=r"^heads force, position, slip: allowed is one that learns the label"
    ):
        dataclasses.replace(drawn.definition, heads=heads)


def with_columns(drawn: Model, *columns: str) -> Definition:
    heads = dict(drawn.definition.heads)
    task = dataclasses.replace(heads["force"].task, columns=columns)
    heads["force"] = dataclasses.replace(heads["force"], task=task)
    return dataclasses.replace(drawn.definition, heads=heads)


def test_a_head_may_see_some_columns_only(drawn: Model) -> None:
    columns = drawn.definition.feature.columns
    definition = with_columns(drawn, columns[3], columns[7])
    assert definition.columns_of("force") == (3, 7)
    assert definition.columns_of("position") == tuple(range(50))
    assert definition.shapes()["force.0.weight"] == (128, 2 + 11)
    assert with_columns(drawn, "*").columns_of("force") == tuple(range(50))
    assert from_tree(Definition, to_tree(definition)) == definition


def test_columns_that_are_not_there_are_refused(drawn: Model) -> None:
    with pytest.raises(InputError, match="columns 'pitch' for the head 'force': allowed is those of bands"):
        with_columns(drawn, "pitch").shapes()


@pytest.mark.parametrize("name", ["windows", "touches", "sessions"])
def test_a_calibration_of_less_than_nothing_is_refused(name: str) -> None:
    with pytest.raises(InputError, match=f"^option '{name}' = -1: allowed is a whole number of 0 or more"):
        from_tree(Calibration, {name: -1})
