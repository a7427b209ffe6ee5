from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, Literal

import pytest

from monochord.core.schema import choices_of, fields_of, inside, wording
from monochord.core.units import Metres


class Side(Enum):
    NEAR = "near"
    FAR = "far"


@dataclass(frozen=True)
class Touch:
    position: Metres
    force: "float"
    names: Mapping[str, Side]


@dataclass(frozen=True)
class Nothing:
    pass


def test_fields_are_named_with_their_types() -> None:
    expected = {"position": float, "force": float, "names": Mapping[str, Side]}
    assert fields_of(Touch) == expected
    assert fields_of(Touch | None) == expected
    assert fields_of(float | Touch) == expected


@pytest.mark.parametrize("kind", [int, Any, None, list[Touch], Touch | Nothing, Side])
def test_what_is_not_one_dataclass_has_no_fields(kind: Any) -> None:
    assert fields_of(kind) is None


@pytest.mark.parametrize("kind", [Side, Literal["near", "far"], Side | None])
def test_choices(kind: Any) -> None:
    assert choices_of(kind) == ["near", "far"]


@pytest.mark.parametrize(
    ("kind", "step", "expected"),
    [
        (Touch, "force", float),
        (Touch, "weight", Any),
        (Touch | None, "force", float),
        (dict[str, int], "any", int),
        (Mapping[str, Touch], "any", Touch),
        (list[int], 7, int),
        (Sequence[int], 7, int),
        (tuple[int, ...], 7, int),
        (tuple[int, str], 0, int),
        (tuple[int, str], 1, str),
        (tuple[int, str], 2, Any),
        (list, 0, Any),
        (str, 0, Any),
        (int, "real", Any),
        (Any, "x", Any),
    ],
)
def test_inside(kind: Any, step: str | int, expected: Any) -> None:
    assert inside(kind, step) == expected


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (bool, "true or false"),
        (Metres, "a number"),
        (str, "text"),
        (Path | None, "a path or nothing"),
        (Side, "near, far"),
        (Literal[1, 2], "1, 2"),
        (Touch, "a table of position, force, names"),
        (Nothing, "an empty table"),
        (dict[str, int], "a table"),
        (list[str], "a list, each text"),
        (tuple[Touch, ...], "a list, each a table of position, force, names"),
        (tuple[int, str], "a list of 2: a whole number, text"),
        (list[tuple[float, float]], "a list, each a list of 2: a number, a number"),
        (complex, "a value of its type"),
    ],
)
def test_wording(kind: Any, words: str) -> None:
    assert wording(kind) == words
