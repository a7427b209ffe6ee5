"""Configuration: TOML text and ``a.b=c`` overrides, strictly converted to frozen dataclasses.

Each configuration has a dataclass as its schema, beside the code that it configures. An unknown key is an
error with "did you mean"; a value of the wrong type is an error that names the option by its path.
"""

import dataclasses
import errno
import json
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from enum import Enum
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeAlias, TypeVar, Union, get_args, get_origin, get_type_hints

import msgspec
import tomli_w

from monochord.core.errors import InputError, did_you_mean
from monochord.core.files import refuse_endless
from monochord.core.units import FINITE, unit_of

T = TypeVar("T")
Tree: TypeAlias = dict[str, Any]
MAX_BYTES = 1 << 26
"""Size of the largest text file that is read, in bytes."""
MAX_DEPTH = 32
"""Most names in the path of an override."""
MAX_SHOWN = 80
"""Most characters of a value quoted in an error message."""


def load_toml(path: Path) -> Tree:
    """Read a TOML file; raises `InputError` if it is missing or not TOML."""
    refuse_endless(path)
    try:
        return tomllib.loads(_text(path))
    except OSError as error:
        raise InputError(f"configuration {path} ({error.strerror})", "a readable TOML file") from error
    except (ValueError, RecursionError) as error:  # TOML's own, bad UTF-8, a number of thousands of digits
        raise InputError(f"configuration {path} ({error})", "TOML text") from error


def load_json(path: Path, remedy: str = "") -> Any:
    """Read a JSON file; raises `InputError`, ending with `remedy`, if it is missing or not JSON."""
    refuse_endless(path)
    try:
        return json.loads(_text(path))
    except OSError as error:
        raise InputError(f"{path} ({error.strerror})", "a readable file", remedy) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} (damaged: {error})", "JSON text", remedy) from error


def table(tree: Mapping[str, Any], name: str) -> Tree:
    """Return the table `name` of a tree, or an empty one.

    Raises
    ------
    InputError
        If `name` is not a table.

    >>> table({"window": {"hop": 0.01}}, "window"), table({}, "window")
    ({'hop': 0.01}, {})
    """
    value = tree.get(name, {})
    if not isinstance(value, dict):
        raise _refusal(name, value, "a table")
    return value


def override(tree: Tree, assignments: Iterable[str]) -> Tree:
    """Return `tree` with overrides such as ``window.hop=0.01`` applied.

    The right side is parsed as a TOML value, or taken as plain text where that fails.

    >>> override({"window": {"hop": 0.01}}, ["window.hop=0.02", "source.path=take.wav"])
    {'window': {'hop': 0.02}, 'source': {'path': 'take.wav'}}
    """
    result = _copy(tree)
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        names = key.strip().split(".")
        if not equals or not all(names) or len(names) > MAX_DEPTH:
            raise InputError(f"override '{assignment}'", "NAME.NAME=VALUE", "write --set window.hop=0.02")
        node = result
        for name in names[:-1]:
            node = node.setdefault(name, {})
            if not isinstance(node, dict):
                raise InputError(f"override '{assignment}'", f"a table at '{name}'", "shorten the path")
        node[names[-1]] = _toml_value(text.strip())
    return result


def from_tree(cls: type[T], tree: Mapping[str, Any], where: str = "") -> T:
    """Build the dataclass `cls` from a tree of plain values; unknown keys and wrong types raise.

    Parameters
    ----------
    cls
        A dataclass, possibly with nested dataclasses, lists or tables.
    tree
        Plain values by field name, as from TOML or JSON; text is converted where a field is a number.
    where
        Path of this part in error messages.

    Returns
    -------
    T
        The dataclass, with defaults for values missing from the tree.

    Raises
    ------
    InputError
        If a key is unknown (with a suggestion), a value has the wrong type, a field without default is
        missing, or a number is NaN; the error names the option by its path. An `InputError` of the dataclass
        itself passes through.
    """
    try:
        return _converted(cls, tree, where)
    except RecursionError as error:
        raise InputError(f"{where or cls.__name__} (nested too deep)", describe_type(cls)) from error


def to_tree(config: Any) -> Tree:
    """Return a dataclass as plain values for TOML, without fields that are None."""
    return _plain(config)


def dump_toml(tree: Tree) -> str:
    r"""Return a tree of plain values as TOML text, as saved beside a result.

    >>> dump_toml({"window": {"hop": 0.01}})
    '[window]\nhop = 0.01\n'
    """
    return tomli_w.dumps(_plain(tree))


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """One value of a configuration: its path, allowed values, and default (None if it has none)."""

    name: str
    allowed: str
    default: Any
    required: bool


def settings_of(cls: type, where: str = "") -> list[Setting]:
    """Return every value of the configuration dataclass `cls`, in order, by dotted path.

    A table of options with names unknown to the class counts as one value.

    Examples
    --------
    >>> from monochord.live import WindowSettings
    >>> [setting.name for setting in settings_of(WindowSettings, "window")]
    ['window.length', 'window.hop']
    """
    settings: list[Setting] = []
    types = _fields(cls) or {}
    for field in dataclasses.fields(cls):
        if not field.init:
            continue
        name, kind = _joined(where, field.name), types[field.name]
        if _fields(kind) is not None:
            settings += settings_of(kind, name)
            continue
        has_factory = field.default_factory is not dataclasses.MISSING
        default = field.default_factory() if has_factory else field.default  # pyright: ignore[reportCallIssue]
        required = default is dataclasses.MISSING
        plain = None if required else _plain(default)
        settings.append(Setting(name=name, allowed=describe_type(kind), default=plain, required=required))
    return settings


def describe_type(kind: Any) -> str:
    """Return the values that a type annotation allows, in plain words.

    >>> from monochord.core.units import Seconds
    >>> describe_type(float | None), describe_type(tuple[float, float]), describe_type(Literal["near", "far"])
    ('a number or nothing', 'a list of 2: a number, a number', 'near, far')
    >>> describe_type(Annotated[Seconds, msgspec.Meta(ge=0.0, le=60.0)])
    'a number from 0 to 60 s'
    """
    unit = unit_of(kind)
    kind, metadata = _bare(kind)
    parts, fields = get_args(kind), _fields(kind)
    if _is_union(kind):
        words = " or ".join(map(describe_type, parts))
    elif choices := _choices(kind):
        words = ", ".join(choices)
    elif fields is not None:
        words = f"a table of {', '.join(fields)}" if fields else "an empty table"
    elif _is(kind, Mapping):
        words = "a table"
    elif _is(kind, Sequence) and parts:
        inner = list(map(describe_type, parts))
        uniform = parts[1:] in ((), (...,))
        words = f"a list, each {inner[0]}" if uniform else f"a list of {len(parts)}: {', '.join(inner)}"
    else:
        words = _WORDS.get(kind, "a value of its type")
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


def _converted(kind: Any, value: Any, where: str) -> Any:
    """Return a plain value converted to the type `kind`; `where` is its path.

    Tables and lists are walked here, to track the paths of their elements; msgspec converts everything else,
    and raises for any other shape.
    """
    bare, _ = _bare(kind)
    parts, fields = get_args(bare), _fields(bare)
    if _is_union(bare):
        fitting = [part for part in parts if _fits(part, value)]
        return _converted(fitting[0], value, where) if len(fitting) == 1 else _leaf(kind, value, where)
    if fields is not None:
        return _built(bare, fields, value, where)
    if bare is Any or bare is object:
        return _checked_text(value, where)
    if _is(bare, Mapping) and isinstance(value, Mapping):
        key, inner = parts if len(parts) == 2 else (str, Any)
        return {
            _leaf(key, name, where): _converted(inner, each, _joined(where, name))
            for name, each in value.items()
        }
    if _is(bare, Sequence) and isinstance(value, (list, tuple)):
        uniform = parts[1:] in ((), (...,))
        inner_types = [parts[0] if parts else Any] * len(value) if uniform else parts
        if len(inner_types) == len(value):
            pairs = enumerate(zip(inner_types, value, strict=True))
            items = [_converted(inner, each, f"{where}[{index}]") for index, (inner, each) in pairs]
            return tuple(items) if _is(bare, tuple) else items
    return _leaf(kind, value, where)


def _fits(kind: Any, value: Any) -> bool:
    """Return whether type and value are both tables, or both lists."""
    bare, _ = _bare(kind)
    if isinstance(value, Mapping):
        return _fields(bare) is not None or _is(bare, Mapping)
    return isinstance(value, (list, tuple)) and _is(bare, Sequence)


def _built(cls: Any, fields: Mapping[str, Any], value: Any, where: str) -> Any:
    """Return the dataclass `cls` with the entries of a table as its fields."""
    if not isinstance(value, Mapping):
        raise _refusal(where, value, describe_type(cls))
    unknown = next((name for name in value if name not in fields), None)
    if unknown is not None:
        given = f"option '{_joined(where, unknown)}'"
        raise InputError(given, ", ".join(fields) or "none", did_you_mean(unknown, fields))
    arguments = {name: _converted(fields[name], each, _joined(where, name)) for name, each in value.items()}
    for field in dataclasses.fields(cls):
        required = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        if field.init and required and field.name not in arguments:
            given = f"option '{_joined(where, field.name)}' (missing)"
            raise InputError(given, describe_type(fields[field.name]))
    try:
        return cls(**arguments)
    except InputError:
        raise
    except ValueError as error:  # raised by the dataclass's own check
        raise _refusal(where, value, str(error)) from error


def _leaf(kind: Any, value: Any, where: str) -> Any:
    """Return a single value as a number, text, truth value, path, choice or None."""
    members = [_bare(part)[0] for part in (get_args(kind) if _is_union(kind) else [kind])]
    if Path not in members:  # whose name may be of any bytes
        _checked_text(value, where)
    if float in members and isinstance(value, (float, str)) and str(value).strip().lower() == "nan":
        raise _refusal(where, "nan", describe_type(kind), quoted=False)
    try:
        return msgspec.convert(value, kind, strict=False, dec_hook=_path)
    except msgspec.ValidationError as error:
        choices = [choice for member in members for choice in _choices(member)]
        remedy = did_you_mean(value, choices) if isinstance(value, str) else ""
        raise _refusal(where, value, describe_type(kind), remedy) from error


def _path(kind: type, value: Any) -> Any:
    if isinstance(value, kind):  # an object that is built already
        return value
    if issubclass(kind, Path) and isinstance(value, str):
        return kind(value)
    raise TypeError(f"{value!r} is not a {kind.__name__}")


def _checked_text(value: Any, where: str) -> Any:
    """Return a value of any shape; raises `InputError` for text in it that cannot be encoded in UTF-8."""
    if isinstance(value, str) and not value.isascii():
        try:
            value.encode()
        except UnicodeEncodeError as error:  # an argument's bytes that were no UTF-8
            raise InputError(f"option '{where}' = {value!a}", "text in UTF-8") from error
    elif isinstance(value, Mapping):
        for name, each in value.items():
            _checked_text(name, where)
            _checked_text(each, _joined(where, str(name)))
    elif isinstance(value, (list, tuple)):
        for index, each in enumerate(value):
            _checked_text(each, f"{where}[{index}]")
    return value


def _refusal(where: str, value: Any, allowed: str, remedy: str = "", *, quoted: bool = True) -> InputError:
    """Return the error for an invalid value of an option; its line quotes no more than needed."""
    try:
        text = repr(value) if quoted else str(value)
    except ValueError:  # an integer of more digits than Python writes
        text = "a number of thousands of digits"
    text = text if len(text) <= MAX_SHOWN else f"{text[:MAX_SHOWN]}..."
    return InputError(f"option '{where}' = {text}" if where else text, allowed, remedy)


@cache
def _fields(kind: Any) -> dict[str, Any] | None:
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


def _bare(kind: Any) -> tuple[Any, tuple[Any, ...]]:
    """Return a type without ``Annotated``, and its annotations."""
    return (kind.__origin__, kind.__metadata__) if get_origin(kind) is Annotated else (kind, ())


def _is_union(kind: Any) -> bool:
    return get_origin(kind) in (Union, UnionType)


def _is(kind: Any, family: type) -> bool:
    origin = get_origin(kind) or kind
    return isinstance(origin, type) and origin is not str and issubclass(origin, family)


def _joined(where: str, step: str) -> str:
    return f"{where}.{step}" if where else step


def _text(path: Path) -> str:
    if path.stat().st_size > MAX_BYTES:
        raise OSError(errno.EFBIG, f"more than {MAX_BYTES} bytes", str(path))
    return path.read_text(encoding="utf-8")


def _toml_value(text: str) -> Any:
    try:
        tree = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return tree["value"] if len(tree) == 1 else text


def _copy(value: Any) -> Any:
    return {k: _copy(v) for k, v in value.items()} if isinstance(value, dict) else value


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _plain({field.name: getattr(value, field.name) for field in dataclasses.fields(value)})
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items() if v is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, Enum):
        return value.value
    return str(value) if isinstance(value, Path) else value
