"""What a type annotation allows, in the words of a person who fills in an option.

A dataclass is the schema of its own configuration; these functions read one for error messages.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from enum import Enum
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

_WORDS: dict[Any, str] = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "text",
    Path: "a path",
    NoneType: "nothing",
}


def fields_of(kind: Any) -> dict[str, Any] | None:
    """Return the types of a dataclass's fields by name, or None for what is not a dataclass.

    A union counts as the one dataclass in it: ``Window | None`` has the fields of ``Window``.
    """
    if _is_union(kind):
        found = [fields for part in get_args(kind) if (fields := fields_of(part)) is not None]
        return found[0] if len(found) == 1 else None
    if not (isinstance(kind, type) and dataclasses.is_dataclass(kind)):
        return None
    hints = get_type_hints(kind)
    return {field.name: hints[field.name] for field in dataclasses.fields(kind) if field.init}


def choices_of(kind: Any) -> list[str]:
    """Return the values that a ``Literal`` or an enumeration allows; empty for any other type.

    >>> choices_of(Literal["near", "far"] | None)
    ['near', 'far']
    """
    if _is_union(kind):
        return [choice for part in get_args(kind) for choice in choices_of(part)]
    if get_origin(kind) is Literal:
        return [str(choice) for choice in get_args(kind)]
    if isinstance(kind, type) and issubclass(kind, Enum):
        return [str(member.value) for member in kind]
    return []


def inside(kind: Any, step: str | int) -> Any:
    """Return the type that stands at a field name, key or index inside `kind`; Any where that is unknown.

    >>> inside(dict[str, float], "hop"), inside(tuple[int, str], 1)
    (<class 'float'>, <class 'str'>)
    """
    parts = get_args(kind)
    if _is_union(kind):
        return next((found for part in parts if (found := inside(part, step)) is not Any), Any)
    fields = fields_of(kind)
    if fields is not None:
        return fields.get(str(step), Any)
    if _is(kind, Mapping) and len(parts) == 2:
        return parts[1]
    if _is(kind, Sequence) and isinstance(step, int):
        return dict(enumerate(parts)).get(0 if _is_uniform(parts) else step, Any)
    return Any


def wording(kind: Any) -> str:
    """Return a type in a person's words.

    >>> wording(float | None), wording(tuple[float, float]), wording(Literal["near", "far"])
    ('a number or nothing', 'a list of 2: a number, a number', 'near, far')
    """
    parts, fields = get_args(kind), fields_of(kind)
    if _is_union(kind):
        return " or ".join(wording(part) for part in parts)
    if choices := choices_of(kind):
        return ", ".join(choices)
    if fields is not None:
        return f"a table of {', '.join(fields)}" if fields else "an empty table"
    if _is(kind, Mapping):
        return "a table"
    if _is(kind, Sequence) and parts:
        inner = [wording(part) for part in parts]
        return (
            f"a list, each {inner[0]}"
            if _is_uniform(parts)
            else f"a list of {len(parts)}: {', '.join(inner)}"
        )
    return _WORDS.get(kind, "a value of its type")


def _is_union(kind: Any) -> bool:
    return get_origin(kind) in (Union, UnionType)


def _is(kind: Any, family: type) -> bool:
    origin = get_origin(kind) or kind
    return isinstance(origin, type) and origin is not str and issubclass(origin, family)


def _is_uniform(parts: tuple[Any, ...]) -> bool:
    return parts[1:] in ((), (...,))
