"""Ranges of numbers, declared in a field's annotation and checked however the dataclass is built.

A range is `msgspec.Meta` beside the type: ``hop: Annotated[Seconds, Meta(ge=1e-3, le=60.0)]``, or a name of
this module: ``rate: Positive[Hertz]``. `monochord.core.config.from_tree` rejects values outside it from a
file or ``--set``. A `Checked` dataclass also rejects them when built in Python.
"""

from collections.abc import Sequence
from dataclasses import fields
from functools import cache
from types import UnionType
from typing import Annotated, Any, TypeAlias, TypeVar, Union, cast, get_args, get_origin, get_type_hints

from msgspec import Meta

from monochord.core.config import describe_type
from monochord.core.errors import InputError
from monochord.core.units import FINITE, unit_of

T = TypeVar("T")
Finite: TypeAlias = Annotated[T, Meta(ge=-FINITE, le=FINITE)]
"""A finite number with a unit: ``Finite[Metres]``."""
Positive: TypeAlias = Annotated[T, Meta(gt=0.0, le=FINITE)]
"""A finite number above 0 with a unit: ``Positive[Hertz]``."""
NonNegative: TypeAlias = Annotated[T, Meta(ge=0.0, le=FINITE)]
"""A finite number of 0 or more with a unit: ``NonNegative[Seconds]``."""
Share: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]
"""A share or probability, 0 and 1 included."""
InnerShare: TypeAlias = Annotated[float, Meta(gt=0.0, lt=1.0)]
"""A share or probability, 0 and 1 excluded."""
PartialShare: TypeAlias = Annotated[float, Meta(ge=0.0, lt=1.0)]
"""A share below 1, 0 included."""
Count: TypeAlias = Annotated[int, Meta(ge=1)]
"""A whole number of 1 or more."""
Whole: TypeAlias = Annotated[int, Meta(ge=0)]
"""A whole number of 0 or more."""
Pair: TypeAlias = tuple[T, T]
"""Two values of a kind, such as a minimum and a maximum: ``Pair[Positive[Newtons]]``."""


class Checked:
    """Base of a dataclass that rejects numbers outside their annotated ranges; see `refuse_outside`.

    A dataclass with further checks calls ``Checked.__post_init__(self)`` first.

    >>> from monochord.live.health import HealthSettings
    >>> HealthSettings(look=-0.1)
    Traceback (most recent call last):
    monochord.core.errors.InputError: HealthSettings look -0.1 s: expected a finite number of 0 s or more
    """

    __slots__ = ()

    def __post_init__(self) -> None:
        refuse_outside(self)


def refuse_outside(part: Any) -> None:
    """Raise `InputError` where a number of a dataclass is NaN or outside its annotated range.

    Optional numbers and those in tuples are checked; None is always allowed.
    """
    for name, kind in _ranges(type(part)).items():
        _refuse(getattr(part, name), kind, f"{type(part).__name__} {name}")


@cache
def _ranges(cls: type) -> dict[str, Any]:
    """Return the annotations with a range, by field name."""
    try:
        hints = get_type_hints(cls, include_extras=True)
    except NameError:  # of a type that is imported for type checkers alone: `from_tree` refuses the class too
        return {}
    return {field.name: hints[field.name] for field in fields(cls) if _has_range(hints[field.name])}


def _has_range(kind: Any) -> bool:
    return bool(_metas(kind)) or any(map(_has_range, get_args(kind)))


def _metas(kind: Any) -> list[Meta]:
    return [each for each in getattr(kind, "__metadata__", ()) if isinstance(each, Meta)]


def _refuse(value: Any, kind: Any, where: str) -> None:
    """Raise `InputError` for a number outside the range of its type; `where` names the value."""
    if value is None:
        return
    parts = get_args(kind)
    if metas := _metas(kind):
        if not all(_within(value, meta) for meta in metas):
            given = value if isinstance(value, int) else f"{value:g}"
            raise InputError(f"{where} {given}{unit_of(kind)}", describe_type(kind))
    elif get_origin(kind) in (Union, UnionType):
        for part in parts:
            _refuse(value, part, where)
    elif isinstance(value, (tuple, list)):
        items = cast("Sequence[Any]", value)
        inner = parts[:1] * len(items) if parts[1:] in ((), (...,)) else parts
        for index, (each, part) in enumerate(zip(items, inner, strict=False)):
            _refuse(each, part, f"{where}[{index}]")


def _within(number: Any, meta: Meta) -> bool:
    """Return whether a number meets every limit of a range; NaN never does."""
    return (
        (meta.ge is None or number >= meta.ge)
        and (meta.gt is None or number > meta.gt)
        and (meta.le is None or number <= meta.le)
        and (meta.lt is None or number < meta.lt)
    )


def refuse_unordered(where: str, **pairs: tuple[float, float] | None) -> None:
    """Raise `InputError` if the first number of a pair exceeds the second; `where` names their owner.

    >>> refuse_unordered("touch", forces=(2.0, 0.1))
    Traceback (most recent call last):
    monochord.core.errors.InputError: touch: forces 2 to 0.1: expected the smaller first
    """
    for name, pair in pairs.items():
        if pair is not None and not pair[0] <= pair[1]:
            raise InputError(f"{where}: {name} {pair[0]:g} to {pair[1]:g}", "the smaller first")
