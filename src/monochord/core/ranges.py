"""Ranges of numbers, declared in an annotation, and the check of arguments and fields against annotations.

A range is `msgspec.Meta` beside the type: ``hop: Annotated[Seconds, Meta(ge=1e-3, le=60.0)]``, or a name of
this module: ``rate: Positive[Hertz]``. `monochord.core.config.from_tree` rejects values outside it from a
file or ``--set``. A `Checked` dataclass and a `checked` function also do when used from Python.
"""

import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import fields
from enum import Enum
from functools import cache, wraps
from math import inf, isnan
from pathlib import Path
from types import MappingProxyType, NoneType, SimpleNamespace
from typing import (
    Annotated,
    Any,
    Literal,
    ParamSpec,
    TypeAlias,
    TypeVar,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

from msgspec import Meta

from monochord.core.conversion import MAX_WHOLE, array_type, bare_type, converted, is_union, union_parts
from monochord.core.errors import InputError
from monochord.core.units import FINITE, NAN

P = ParamSpec("P")
R = TypeVar("R")
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
SampleRate: TypeAlias = Annotated[int, "Hz", Meta(ge=1, le=10_000_000)]
"""A sample rate in whole Hz."""
Seed: TypeAlias = Annotated[int, Meta(ge=0, le=2**63 - 1)]
"""A random seed."""
Pair: TypeAlias = tuple[T, T]
"""Two values of a kind, such as a minimum and a maximum: ``Pair[Positive[Newtons]]``."""


class Checked:
    """Base of a dataclass whose fields are converted to their annotations, or refused; see `converted`.

    A dataclass with further checks calls ``Checked.__post_init__(self)`` first.

    >>> from monochord.core.types import Contact
    >>> Contact(position=0.08, force=-1)
    Traceback (most recent call last):
    monochord.core.errors.InputError: option 'Contact.force' = -1: expected a finite number of 0 N or more
    """

    __slots__ = ()

    def __post_init__(self) -> None:
        for name, (kind, fits) in _fields(type(self)).items():
            value = getattr(self, name)
            if not fits(value):
                object.__setattr__(self, name, converted(kind, value, f"{type(self).__name__}.{name}"))


def checked(function: Callable[P, R]) -> Callable[P, R]:
    """Return a function whose arguments are converted to their annotations, or refused; see `converted`.

    Defaults pass as they are. Python's own error remains for a missing argument and an unknown name.

    >>> from monochord.core.units import Metres
    >>> @checked
    ... def half(length: Positive[Metres]) -> Metres:
    ...     return length / 2.0
    >>> half(0.5), half(1)
    (0.25, 0.5)
    >>> half(-1.0)
    Traceback (most recent call last):
    monochord.core.errors.InputError: option 'length' = -1.0: expected a finite number above 0 m
    """
    plan: list[_Arguments] = []  # made at the first call: annotations may name what is imported later

    call = cast("Callable[..., R]", function)

    @wraps(function)
    def with_checked(*args: P.args, **named: P.kwargs) -> R:
        if not plan:
            plan.append(_Arguments(function))
        return call(*plan[0].positional(args), **plan[0].named(named))

    return with_checked


Part: TypeAlias = tuple[Any, Callable[[Any], bool]]
"""An annotation, and the quick test of whether a value fits it."""


class _Arguments:
    """The annotations of a function's arguments."""

    def __init__(self, function: Callable[..., Any]) -> None:
        parts = _parts(inspect.unwrap(function))
        known = inspect.signature(function).parameters.values()
        self._by_name = {
            each.name: parts[each.name]
            for each in known
            if each.name in parts and each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)
        }
        by_place = [each for each in known if each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)]
        self._by_place = [(each.name, *parts.get(each.name, _ANYTHING)) for each in by_place]
        self._rest = [
            (each.name, *parts.get(each.name, _ANYTHING))
            for each in known
            if each.kind == each.VAR_POSITIONAL
        ]

    def positional(self, values: tuple[Any, ...]) -> list[Any]:
        """Return the positional arguments converted."""
        missing = len(values) - len(self._by_place)
        places = self._by_place + (self._rest or [("", *_ANYTHING)]) * missing
        return [
            value if fits(value) else converted(kind, value, name)
            for value, (name, kind, fits) in zip(values, places, strict=False)
        ]

    def named(self, values: dict[str, Any]) -> dict[str, Any]:
        """Return the arguments by name converted; names that are not annotated pass."""
        for name, value in values.items():
            kind, fits = self._by_name.get(name, _ANYTHING)
            if not fits(value):
                values[name] = converted(kind, value, name)
        return values


@cache
def _fields(cls: type) -> dict[str, Part]:
    """Return the annotations of a dataclass's fields, by name."""
    try:
        parts = _parts(cls)
    except NameError:  # of a type that is imported for type checkers alone: `from_tree` refuses the class too
        return {}
    return {field.name: parts[field.name] for field in fields(cls) if field.init}


def _parts(owner: Any) -> dict[str, Part]:
    """Return the annotations of a class's fields or a function's arguments, by name."""
    if not isinstance(owner, type):  # what a function returns may be imported for type checkers alone
        kinds = {name: kind for name, kind in owner.__annotations__.items() if name != "return"}
        owner = SimpleNamespace(__annotations__=kinds, __globals__=owner.__globals__)
    hints = get_type_hints(owner, getattr(owner, "__globals__", None), include_extras=True)
    return {name: (kind, fitting(kind)) for name, kind in hints.items()}


def fitting(kind: Any) -> Callable[[Any], bool]:
    """Return a quick test of whether a value needs no conversion to a type; it may miss some that do not.

    >>> [fitting(Positive[float])(value) for value in (1.0, -1.0, 1)]
    [True, False, False]
    """
    bare, metadata = bare_type(kind)
    origin, parts = get_origin(bare) or bare, get_args(bare)
    if (number := array_type(bare)) is not None:
        return _array(number)
    if isinstance(bare, TypeVar) or is_union(bare):
        parts = union_parts([bare])
        return _any([part for part in parts if part is not str] if Path in parts else parts)
    if bare in (int, float):
        return _number(bare, metadata)
    if origin in (dict, Mapping):
        return _table(parts)
    if origin in (list, tuple, Sequence):
        return _list(origin, parts)
    return _single(bare, origin, parts)


def _array(number: Any) -> Callable[[Any], bool]:
    """Return the test of an array of a type of number, of any ordered numbers for `Any`."""
    import numpy as np  # noqa: PLC0415  (an annotated array has loaded it)

    from monochord.core.shapes import NUMBERS  # noqa: PLC0415

    def fits(value: Any) -> bool:
        if not isinstance(value, np.ndarray) or value.ndim == 0:
            return False
        return value.dtype.kind in NUMBERS if number is Any else value.dtype == number

    return fits


def _single(bare: Any, origin: Any, parts: tuple[Any, ...]) -> Callable[[Any], bool]:
    """Return the test of a text, a truth value, a choice, or an object of a class."""
    if bare in _PLAIN:
        return _PLAIN[bare]
    if origin is Literal:
        return lambda value: type(value) is str and value in parts
    if origin is Callable:
        return callable
    if isinstance(origin, type) and origin not in (Path, Iterable) and not issubclass(origin, Enum):
        return lambda value: isinstance(value, origin)
    return _never


def _always(value: Any) -> bool:  # noqa: ARG001
    return True


def _never(value: Any) -> bool:  # noqa: ARG001
    return False


_PLAIN: Mapping[Any, Callable[[Any], bool]] = {
    Any: _always,
    object: _always,
    str: lambda value: type(value) is str and value.isascii(),
    bool: lambda value: type(value) is bool,
    None: lambda value: value is None,
    NoneType: lambda value: value is None,
}
_ANYTHING: Part = (Any, _always)


def _any(kinds: Sequence[Any]) -> Callable[[Any], bool]:
    tests = [fitting(kind) for kind in kinds if kind not in (None, NoneType)]
    or_none = len(tests) < len(kinds)
    if len(tests) == 1:
        (test,) = tests
        return (lambda value: value is None or test(value)) if or_none else test
    return lambda value: (or_none and value is None) or any(test(value) for test in tests)


def _number(kind: type, metadata: tuple[Any, ...]) -> Callable[[Any], bool]:
    """Return the test of a number in a range; NaN is in none, unless the annotation says so."""
    metas = [each for each in metadata if isinstance(each, Meta)]
    widest = (-MAX_WHOLE, MAX_WHOLE - 1) if kind is int else (-inf, inf)
    low = max([widest[0], *(meta.ge for meta in metas if meta.ge is not None)])
    high = min([widest[1], *(meta.le for meta in metas if meta.le is not None)])
    above = [meta.gt for meta in metas if meta.gt is not None]
    below = [meta.lt for meta in metas if meta.lt is not None]
    if NAN in metadata:
        return lambda value: type(value) is kind and (low <= value <= high or isnan(value))
    if above or below:
        return lambda value: (
            type(value) is kind
            and low <= value <= high
            and all(value > limit for limit in above)
            and all(value < limit for limit in below)
        )
    return lambda value: type(value) is kind and low <= value <= high


def _table(parts: tuple[Any, ...]) -> Callable[[Any], bool]:
    key, inner = (fitting(each) for each in (parts if len(parts) == 2 else (str, Any)))
    kinds = (dict, MappingProxyType)
    return lambda value: (
        type(value) in kinds and (not value or (all(map(key, value)) and all(map(inner, value.values()))))
    )


def _list(origin: type, parts: tuple[Any, ...]) -> Callable[[Any], bool]:
    kinds = (origin,) if origin in (list, tuple) else (list, tuple)
    if parts[1:] in ((), (...,)):
        inner = fitting(parts[0] if parts else Any)
        return lambda value: type(value) in kinds and (not value or all(map(inner, value)))
    tests = [fitting(each) for each in parts]

    def fits(value: Any) -> bool:
        if type(value) not in kinds or len(value) != len(tests):
            return False
        return all(test(each) for test, each in zip(tests, value, strict=True))

    return fits


def refuse_unordered(where: str, **pairs: tuple[float, float] | None) -> None:
    """Raise `InputError` if the first number of a pair exceeds the second; `where` names their owner.

    >>> refuse_unordered("touch", forces=(2.0, 0.1))
    Traceback (most recent call last):
    monochord.core.errors.InputError: touch: forces 2 to 0.1: expected the smaller first
    """
    for name, pair in pairs.items():
        if pair is not None and not pair[0] <= pair[1]:
            raise InputError(f"{where}: {name} {pair[0]:g} to {pair[1]:g}", "the smaller first")
