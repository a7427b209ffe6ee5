"""Converts values to the types that annotations state: of options, of arguments, of a dataclass's fields.

An annotation is the one place that says what a value may be: its type, its unit and its range. Configuration
(`monochord.core.config`), arguments and fields (`monochord.core.ranges`) are all converted here.
"""

import dataclasses
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from enum import Enum
from functools import cache
from math import isnan
from numbers import Integral, Real
from pathlib import Path, PurePath
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import msgspec

from monochord.core.errors import InputError, did_you_mean
from monochord.core.files import refuse_impossible
from monochord.core.units import FINITE, NAN, unit_of

MAX_ITEMS = 1 << 20
"""Most items of a list that is converted."""
MAX_WHOLE = 1 << 63
"""Whole numbers are smaller: 64 bits, as arrays and files have them."""
MAX_SHOWN = 80
"""Most characters of a value quoted in an error message."""


def converted(kind: Any, value: Any, where: str) -> Any:
    """Return a value as its annotation `kind` states it; `where` names it in errors.

    A value that fits is returned unchanged. Numbers of other libraries (NumPy's scalars, arrays without
    dimensions) become Python's; one text stands for a list of texts, a table for a dataclass, and a path for
    text. Arrays become arrays of the annotated numbers. Raises `InputError` for a value of another type,
    outside its range, or NaN.

    >>> converted(int, 2.0, "bins"), converted(tuple[str, ...], "drive=1", "settings")
    (2, ('drive=1',))
    """
    try:
        return _converted(kind, value, where)
    except RecursionError as error:
        raise InputError(f"{where or _name(kind)} (nested too deep)", describe_type(kind)) from error


def describe_type(kind: Any) -> str:
    """Return the values that a type annotation allows, in plain words.

    >>> from monochord.core.units import Seconds
    >>> describe_type(float | None), describe_type(tuple[float, float]), describe_type(Literal["near", "far"])
    ('a number or nothing', 'a list of 2: a number, a number', 'near, far')
    >>> describe_type(Annotated[Seconds, msgspec.Meta(ge=0.0, le=60.0)])
    'a number from 0 to 60 s'
    """
    unit = unit_of(kind)
    kind, metadata = bare_type(kind)
    parts, fields = get_args(kind), fields_of(kind)
    if isinstance(kind, TypeVar):
        return describe_type(_of_variable(kind))
    if array_type(kind) is not None:
        words = "an array of numbers"
    elif is_union(kind):
        words = " or ".join(map(describe_type, parts))
    elif choices := _choices(kind):
        words = ", ".join(choices)
    elif fields is not None:
        words = f"a table of {', '.join(fields)}" if fields else "an empty table"
    elif _is(kind, Mapping):
        words = "a table"
    elif _is(kind, Iterable) and parts:
        inner = list(map(describe_type, parts))
        uniform = parts[1:] in ((), (...,))
        words = f"a list, each {inner[0]}" if uniform else f"a list of {len(parts)}: {', '.join(inner)}"
    else:
        words = _WORDS.get(kind) or _name(kind)
    meta = next((each for each in metadata if isinstance(each, msgspec.Meta)), msgspec.Meta())
    return _bounded(words, meta, unit)


_WORDS: dict[Any, str] = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "text",
    Path: "a path",
    NoneType: "nothing",
    ...: "more",
}


def _name(kind: Any) -> str:
    """Return a class in words."""
    name = getattr(get_origin(kind) or kind, "__name__", "") or "value of its type"
    return "a function" if name == "Callable" else f"a{'n' * (name[0] in 'AEIOU')} {name}"


def _bounded(words: str, meta: msgspec.Meta, unit: str) -> str:
    """Return the allowed range of a number in words; the largest and smallest float read "finite"."""
    if meta.le == FINITE:
        words = words.replace("a number", "a finite number")
    elif meta.ge is not None and meta.le is not None:
        return f"{words} from {_number(meta.ge)} to {_number(meta.le)}{unit}"
    limits = {"of {} or more": meta.ge, "above {}": meta.gt, "of {} at most": meta.le, "below {}": meta.lt}
    stated = {text: limit for text, limit in limits.items() if limit is not None and abs(limit) < FINITE}
    if stated:
        return f"{words} {' and '.join(text.format(_number(each) + unit) for text, each in stated.items())}"
    return f"{words} in{unit}" if unit else words


def _number(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:g}"


def _converted(kind: Any, value: Any, where: str) -> Any:  # noqa: PLR0911  (one for each kind)
    """Return a value converted to the type `kind`; `where` is its path.

    Tables and lists are walked here, to track the paths of their elements; msgspec converts single values.
    """
    bare = bare_type(kind)[0]
    if isinstance(bare, TypeVar):
        return _converted(_of_variable(bare), value, where)
    parts, origin = get_args(bare), get_origin(bare) or bare
    if (number := array_type(bare)) is not None:
        return _array(number, value, where)
    if bare in (Any, object):
        return _checked_text(value, where)
    if is_union(bare):
        return _one_of(kind, parts, value, where)
    if is_simple(bare):
        return _leaf(kind, value, where)
    if origin in _TABLES and isinstance(value, Mapping):
        return _mapping(parts, cast("Mapping[Any, Any]", value), where)
    if origin in _LISTS:
        return _sequence(kind, value, where)
    if callable(value) if origin is Callable else isinstance(value, origin):
        return value
    if isinstance(value, Mapping) and (fields := fields_of(bare)) is not None:
        return _built(bare, fields, cast("Mapping[str, Any]", value), where)
    raise refusal(where, value, describe_type(kind))


_TABLES = (dict, Mapping)
_LISTS = (list, tuple, Sequence, Iterable)


def _of_variable(variable: Any) -> Any:
    """Return the types that a type variable stands for."""
    return Union[variable.__constraints__] if variable.__constraints__ else variable.__bound__ or Any  # noqa: UP007


def _one_of(kind: Any, parts: tuple[Any, ...], value: Any, where: str) -> Any:
    """Return a value as the part of a union whose instance it is, or else whose shape it has."""
    parts = union_parts(parts)
    fitting = [part for part in parts if _is_instance(value, part)]
    fitting = fitting or [part for part in parts if _has_shape(value, part)]
    if fitting:
        return _converted(fitting[0], value, where)
    simple = tuple(part for part in parts if is_simple(part))
    if not simple:
        raise refusal(where, value, describe_type(kind))
    try:
        return _leaf(kind if simple == parts else Union[simple], value, where)  # noqa: UP007
    except InputError as error:
        raise InputError(error.given, describe_type(kind), error.remedy) from error


def union_parts(parts: Iterable[Any]) -> tuple[Any, ...]:
    """Return the parts of a union, those of type variables and unions in it included."""
    flat: list[Any] = []
    for part in parts:
        kind = _of_variable(part) if isinstance(part, TypeVar) else part
        flat += union_parts(get_args(kind)) if is_union(kind) else [kind]
    return tuple(flat)


def _is_instance(value: Any, kind: Any) -> bool:
    """Return whether a value is an object of a class, which no conversion changes, or an array."""
    bare = bare_type(kind)[0]
    origin = get_origin(bare) or bare
    if array_type(bare) is not None:
        return getattr(value, "ndim", 0) > 0
    if is_simple(bare) or origin in (*_TABLES, *_LISTS):
        return False
    return callable(value) if origin is Callable else isinstance(value, origin)


def _has_shape(value: Any, kind: Any) -> bool:
    """Return whether type and value are both tables, or both lists."""
    bare = bare_type(kind)[0]
    origin = get_origin(bare) or bare
    if isinstance(value, Mapping):
        return origin in _TABLES or fields_of(bare) is not None
    if array_type(bare) is not None:
        return isinstance(value, (list, tuple))
    is_list = isinstance(value, Iterable if origin is Iterable else Sequence)
    return origin in _LISTS and is_list and not isinstance(value, (str, bytes, bytearray))


def is_simple(kind: Any) -> bool:
    """Return whether a type is that of a single value: a number, text, truth value, path, choice or None."""
    bare = bare_type(kind)[0]
    if bare in (bool, int, float, str, None, NoneType) or get_origin(bare) is Literal:
        return True
    return isinstance(bare, type) and issubclass(bare, (PurePath, Enum))


def _mapping(parts: tuple[Any, ...], table: Mapping[Any, Any], where: str) -> Any:
    """Return a table with its entries converted; one that fits is returned unchanged."""
    key, inner = parts if len(parts) == 2 else (str, Any)
    entries = {
        _leaf(key, name, where): _converted(inner, each, joined(where, str(name)))
        for name, each in table.items()
    }
    fits = all(entries.get(name, entries) is each for name, each in table.items())
    return table if fits and not isinstance(table, dict) else entries


def _sequence(kind: Any, value: Any, where: str) -> Any:
    """Return a list or tuple with its elements converted, or an iterable of any other kind."""
    bare = bare_type(kind)[0]
    parts, origin = get_args(bare), get_origin(bare) or bare
    inner = parts[0] if parts else Any
    if isinstance(value, (str, PurePath)) and is_simple(inner):
        value = (value,)
    elif getattr(value, "ndim", 0) > 0:
        value = cast("Any", value).tolist()
    if isinstance(value, (str, bytes, bytearray, Mapping)) or not _can_be_iterated(value):
        raise refusal(where, value, describe_type(kind))
    if not isinstance(value, Sequence):
        if origin is not Iterable:
            raise refusal(where, value, describe_type(kind))
        return _each(inner, cast("Iterable[Any]", value), where)
    if len(value) > MAX_ITEMS:
        raise refusal(where, value, f"{MAX_ITEMS} items at most")
    if parts[1:] in ((), (...,)):
        items = list(_each(inner, cast("Sequence[Any]", value), where))
    elif len(parts) == len(value):
        items = [_converted(part, value[k], f"{where}[{k}]") for k, part in enumerate(parts)]
    else:
        raise refusal(where, value, describe_type(kind))
    return items if origin is list or (isinstance(value, list) and origin is not tuple) else tuple(items)


def _can_be_iterated(value: Any) -> bool:
    return isinstance(value, Iterable) and getattr(value, "ndim", 1) > 0


def _each(kind: Any, values: Iterable[Any], where: str) -> Generator[Any]:
    for index, each in enumerate(values):
        yield _converted(kind, each, f"{where}[{index}]")


def _array(number: Any, value: Any, where: str) -> Any:
    from monochord.core.shapes import numbers  # noqa: PLC0415  (loads NumPy, which an annotated array has)

    return numbers(value, number, f"option '{where}'")


def array_type(kind: Any) -> Any:
    """Return the type of number of an annotated array, `Any` for any number; None for another annotation."""
    if is_union(kind):  # ArrayLike is a union with this protocol of NumPy
        names = {getattr(get_origin(part), "__name__", "") for part in get_args(kind)}
        return Any if "_SupportsArray" in names else None
    if getattr(get_origin(kind), "__name__", "") != "ndarray":
        return None
    number = (get_args(get_args(kind)[1]) or (Any,))[0]
    return number if isinstance(number, type) else Any


def _built(cls: Any, fields: Mapping[str, Any], value: Mapping[str, Any], where: str) -> Any:
    """Return the dataclass `cls` with the entries of a table as its fields."""
    unknown = next((name for name in value if name not in fields), None)
    if unknown is not None:
        given = f"option '{joined(where, str(unknown))}'"
        raise InputError(given, ", ".join(fields) or "none", did_you_mean(str(unknown), fields))
    arguments = {name: _converted(fields[name], each, joined(where, name)) for name, each in value.items()}
    for field in dataclasses.fields(cls):
        required = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        if field.init and required and field.name not in arguments:
            given = f"option '{joined(where, field.name)}' (missing)"
            raise InputError(given, describe_type(fields[field.name]))
    try:
        return cls(**arguments)
    except InputError:
        raise
    except ValueError as error:  # raised by the dataclass's own check
        raise refusal(where, value, str(error)) from error


def _leaf(kind: Any, value: Any, where: str) -> Any:
    """Return a single value as a number, text, truth value, path, choice or None."""
    members = [bare_type(part)[0] for part in (get_args(kind) if is_union(kind) else [kind])]
    value = _plain(value, members)
    if Path in members and isinstance(value, (str, PurePath)):  # whose name may be of any bytes
        refuse_impossible(str(value), f"option '{where}'")
        return value if str in members or isinstance(value, Path) else Path(value)
    _checked_text(value, where)
    others = tuple(member for member in members if member is not Path)  # which msgspec does not know
    if not others:
        raise refusal(where, value, describe_type(kind))
    try:
        result = msgspec.convert(value, Union[others] if Path in members else kind, strict=False)  # noqa: UP007
    except (msgspec.ValidationError, ValueError) as error:  # the latter of thousands of digits
        choices = [choice for member in members for choice in _choices(member)]
        remedy = did_you_mean(value, choices) if isinstance(value, str) else ""
        raise refusal(where, value, describe_type(kind), remedy) from error
    if isinstance(result, float) and isnan(result) and NAN not in bare_type(kind)[1]:
        raise refusal(where, "nan", describe_type(kind), quoted=False)
    if isinstance(result, int) and not -MAX_WHOLE <= result < MAX_WHOLE:
        raise refusal(where, value, describe_type(kind))
    return result


def _plain(value: Any, members: Sequence[Any]) -> Any:
    """Return a number of another library, or a path that stands for text, as Python's own; else the value."""
    if type(value) in (bool, int, float, str):
        return value
    if getattr(value, "ndim", None) == 0 and getattr(value, "dtype", None) is not None:
        if getattr(value.dtype, "kind", "f") not in "biufUO":
            return value
        value = value.item()
    try:
        if type(value) is not bool and isinstance(value, Integral):
            return int(value)
        if type(value) is not bool and isinstance(value, Real):
            return float(value)
    except (OverflowError, ValueError):
        return value
    return str(value) if isinstance(value, PurePath) and str in members and Path not in members else value


def _checked_text(value: Any, where: str) -> Any:
    """Return a value of any shape; raises `InputError` for text in it that is no text in UTF-8."""
    if isinstance(value, str):
        if not (value.isascii() or value.encode(errors="replace").decode() == value):
            # an argument's bytes that were no UTF-8, say
            raise InputError(f"option '{where}' = {_shown(ascii(value))}", "text in UTF-8")
    elif isinstance(value, Mapping):
        for name, each in value.items():
            _checked_text(name, where)
            _checked_text(each, joined(where, str(name)))
    elif isinstance(value, (list, tuple)):
        for index, each in enumerate(value):
            _checked_text(each, f"{where}[{index}]")
    return value


def refusal(where: str, value: Any, allowed: str, remedy: str = "", *, quoted: bool = True) -> InputError:
    """Return the error for an invalid value of an option; its line quotes no more than needed."""
    try:
        text = repr(value) if quoted else str(value)
    except Exception:  # noqa: BLE001  (an integer of too many digits, a list too deep, an object's own)
        text = "a number of thousands of digits" if isinstance(value, int) else f"a {type(value).__name__}"
    text = _shown(text)
    return InputError(f"option '{where}' = {text}" if where else text, allowed, remedy)


def _shown(text: str) -> str:
    """Return text short enough for an error, in UTF-8."""
    text = text.encode(errors="backslashreplace").decode()
    return text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}..."


@cache
def fields_of(kind: Any) -> dict[str, Any] | None:
    """Return the types of a dataclass's fields by name; None for other types."""
    if not (isinstance(kind, type) and dataclasses.is_dataclass(kind)):
        return None
    hints = get_type_hints(kind, include_extras=True)
    return {field.name: hints[field.name] for field in dataclasses.fields(kind) if field.init}


def _choices(kind: Any) -> list[str]:
    """Return the values that a ``Literal`` or an enumeration allows; empty for any other type."""
    if get_origin(kind) is Literal:
        return [str(choice) for choice in get_args(kind)]
    if isinstance(kind, type) and issubclass(kind, Enum):
        return [str(member.value) for member in kind]
    return []


def bare_type(kind: Any) -> tuple[Any, tuple[Any, ...]]:
    """Return a type without ``Annotated``, and its annotations."""
    return (kind.__origin__, kind.__metadata__) if get_origin(kind) is Annotated else (kind, ())


def is_union(kind: Any) -> bool:
    """Return whether a type is a union."""
    return get_origin(kind) in (Union, UnionType)


def _is(kind: Any, family: type) -> bool:
    origin = get_origin(kind) or kind
    return isinstance(origin, type) and origin is not str and issubclass(origin, family)


def joined(where: str, step: str) -> str:
    """Return the path of a part."""
    return f"{where}.{step}" if where else step
