"""Configuration: TOML text and ``a.b=c`` overrides into frozen dataclasses, strictly.

An unknown key is an error with "did you mean"; a value of the wrong type is an error with its path. The
dataclass itself is the schema, and stands beside the code that it configures.
"""

import dataclasses
import tomllib
from collections.abc import Iterable, Mapping
from enum import Enum
from pathlib import Path
from typing import Any, TypeAlias, TypeVar, get_type_hints

import msgspec
import tomli_w

from monochord.errors import InputError, did_you_mean

T = TypeVar("T")
Tree: TypeAlias = dict[str, Any]


def load_toml(path: Path) -> Tree:
    """Read a TOML file; raises `InputError` where it is absent or not TOML."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"configuration {path} ({error.strerror})", "a readable TOML file") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"configuration {path} ({error})", "TOML text") from error


def override(tree: Tree, assignments: Iterable[str]) -> Tree:
    """Return `tree` with assignments such as ``window.hop=0.01`` laid over it.

    The right side is read as a TOML value where it is one and as plain text otherwise.

    >>> override({"window": {"hop": 0.01}}, ["window.hop=0.02", "source.path=take.wav"])
    {'window': {'hop': 0.02}, 'source': {'path': 'take.wav'}}
    """
    result = _copy(tree)
    for assignment in assignments:
        key, equals, text = assignment.partition("=")
        names = key.strip().split(".")
        if not equals or not all(names):
            raise InputError(f"override '{assignment}'", "NAME.NAME=VALUE", "write --set window.hop=0.02")
        node = result
        for name in names[:-1]:
            node = node.setdefault(name, {})
            if not isinstance(node, dict):
                raise InputError(f"override '{assignment}'", f"a table at '{name}'", "shorten the path")
        node[names[-1]] = _toml_value(text.strip())
    return result


def from_tree(cls: type[T], tree: Mapping[str, Any], where: str = "") -> T:
    """Build the dataclass `cls` from a tree of plain values, refusing unknown keys and wrong types.

    Parameters
    ----------
    cls
        A dataclass, perhaps with dataclasses inside.
    tree
        Plain values by field name, as TOML or JSON gives them; text is converted where a number is due.
    where
        Name of this part in error messages.
    """
    _refuse_unknown(cls, tree, where)
    try:
        return msgspec.convert(tree, cls, strict=False, dec_hook=_decode)
    except msgspec.ValidationError as error:
        message = str(error).replace("`", "").replace("$.", f"{where}." if where else "")
        raise InputError(f"{where or cls.__name__} options {dict(tree)}", message) from error


def to_tree(config: Any) -> Tree:
    """Return a dataclass as plain values that TOML can hold; fields that are None are left out."""
    return _plain(dataclasses.asdict(config))


def dump_toml(tree: Tree) -> str:
    """Return a tree of plain values as TOML text: the resolved copy that is saved beside a result."""
    return tomli_w.dumps(_plain(tree))


def _decode(kind: type, value: Any) -> Any:
    if issubclass(kind, Path) and isinstance(value, str):
        return kind(value)
    message = f"cannot make {kind.__name__} of {value!r}"
    raise NotImplementedError(message)


def _refuse_unknown(cls: type, tree: Mapping[str, Any], where: str) -> None:
    hints = get_type_hints(cls)
    fields = [f.name for f in dataclasses.fields(cls) if f.init]
    for name, value in tree.items():
        place = f"{where}.{name}" if where else name
        if name not in fields:
            raise InputError(f"option '{place}'", ", ".join(fields) or "none", did_you_mean(name, fields))
        if dataclasses.is_dataclass(hints[name]) and isinstance(value, Mapping):
            _refuse_unknown(hints[name], value, place)  # pyright: ignore[reportArgumentType]


def _toml_value(text: str) -> Any:
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _copy(value: Any) -> Any:
    return {k: _copy(v) for k, v in value.items()} if isinstance(value, dict) else value


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items() if v is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, Enum):
        return value.value
    return str(value) if isinstance(value, Path) else value
