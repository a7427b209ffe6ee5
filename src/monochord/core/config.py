"""Configuration: TOML text and ``a.b=c`` overrides, strictly converted to frozen dataclasses.

Each configuration has a dataclass as its schema, beside the code that it configures. An unknown key is an
error with "did you mean"; a value of the wrong type is an error that names the option by its path.
"""

import dataclasses
import errno
import json
import tomllib
from collections.abc import Generator, Iterable, Mapping
from contextlib import contextmanager
from enum import Enum
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import tomli_w

from monochord.core.conversion import converted, describe_type, fields_of, joined, refusal
from monochord.core.errors import InputError
from monochord.core.files import refuse_endless, refuse_impossible

T = TypeVar("T")
Tree: TypeAlias = dict[str, Any]
MAX_BYTES = 1 << 26
"""Size of the largest text file that is read, in bytes."""
MAX_DEPTH = 32
"""Most names in the path of an override."""
MAX_NESTING = 64
"""Deepest nesting of tables and lists in a file."""


def load_toml(path: Path) -> Tree:
    """Read a TOML file; raises `InputError` if it is missing or not TOML."""
    refuse_endless(path)
    try:
        return flat_enough(tomllib.loads(_text(path)))
    except OSError as error:
        raise InputError(f"configuration {path} ({error.strerror})", "a readable TOML file") from error
    except (ValueError, RecursionError) as error:  # TOML's own, bad UTF-8, a number of thousands of digits
        raise InputError(f"configuration {path} ({error})", "TOML text") from error


def load_json(path: Path, remedy: str = "") -> Any:
    """Read a JSON file; raises `InputError`, ending with `remedy`, if it is missing or not JSON."""
    refuse_endless(path)
    with json_named(path, remedy):
        return flat_enough(json.loads(_text(path)))


@contextmanager
def json_named(path: Path, remedy: str) -> Generator[None]:
    """Raise an error of reading JSON as `InputError` that names the file."""
    try:
        yield
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path} ({error.strerror})", "a readable file", remedy) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} (damaged: {error})", "JSON text", remedy) from error


def table(tree: Mapping[str, Any], name: str) -> Tree:
    """Return the table `name` of a tree, or an empty one; raises `InputError` for another value.

    >>> table({"window": {"hop": 0.01}}, "window"), table({}, "window")
    ({'hop': 0.01}, {})
    """
    value = tree.get(name, {})
    if not isinstance(value, dict):
        raise refusal(name, value, "a table")
    return value


def override(tree: Tree, assignments: Iterable[str]) -> Tree:
    """Return `tree` with overrides such as ``window.hop=0.01`` applied.

    The right side is parsed as a TOML value, or taken as plain text where that fails.

    >>> override({"window": {"hop": 0.01}}, ["window.hop=0.02", "source.path=take.wav"])
    {'window': {'hop': 0.02}, 'source': {'path': 'take.wav'}}
    """
    try:
        result = _copy(tree)
    except RecursionError as error:
        raise InputError("settings (nested too deep)", f"{MAX_NESTING} levels at most") from error
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
    """Build the dataclass `cls` from plain values by field name, as from TOML; text may give a number.

    `where` is the path of this part in messages. Raises `InputError` where a key is unknown (with a
    suggestion), a value has the wrong type, a field without default is missing, or a number is NaN; the error
    names the option by its path. An `InputError` of the dataclass itself passes through.
    """
    return converted(cls, tree, where)


def to_tree(value: Any) -> Any:
    """Return a dataclass, or what it holds, as plain values for TOML, without fields that are None."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return to_tree({field.name: getattr(value, field.name) for field in dataclasses.fields(value)})
    if isinstance(value, Mapping):
        return {str(k): to_tree(v) for k, v in value.items() if v is not None}
    if isinstance(value, (list, tuple)):
        return [to_tree(v) for v in value]
    if isinstance(value, Enum):
        return value.value
    return str(value) if isinstance(value, Path) else value


def dump_toml(tree: Tree) -> str:
    r"""Return a tree of plain values as TOML text, as saved beside a result.

    >>> dump_toml({"window": {"hop": 0.01}})
    '[window]\nhop = 0.01\n'
    """
    return tomli_w.dumps(to_tree(tree))


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

    >>> from monochord.live import WindowSettings
    >>> [setting.name for setting in settings_of(WindowSettings, "window")]
    ['window.length', 'window.hop']
    """
    settings: list[Setting] = []
    types = fields_of(cls) or {}
    for field in dataclasses.fields(cls):
        if not field.init:
            continue
        name, kind = joined(where, field.name), types[field.name]
        if fields_of(kind) is not None:
            settings += settings_of(kind, name)
            continue
        has_factory = field.default_factory is not dataclasses.MISSING
        default = field.default_factory() if has_factory else field.default  # pyright: ignore[reportCallIssue]
        required = default is dataclasses.MISSING
        plain = None if required else to_tree(default)
        settings.append(Setting(name=name, allowed=describe_type(kind), default=plain, required=required))
    return settings


def flat_enough(tree: Any) -> Any:
    """Return a tree of plain values; raises `ValueError` where it is nested deeper than `MAX_NESTING`."""
    level: list[Any] = [tree]
    for _ in range(MAX_NESTING):
        level = [
            each
            for node in level
            if isinstance(node, (dict, list))
            for each in (node.values() if isinstance(node, dict) else node)
        ]
    if level:
        raise ValueError(f"nested more than {MAX_NESTING} times")
    return tree


def _text(path: Path) -> str:
    """Return the text of a file, without the byte order mark with which some editors begin it."""
    refuse_impossible(path, "configuration")
    if path.stat().st_size > MAX_BYTES:
        raise OSError(errno.EFBIG, f"more than {MAX_BYTES} bytes", str(path))
    return path.read_text(encoding="utf-8-sig")


def _toml_value(text: str) -> Any:
    try:
        tree = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return tree["value"] if len(tree) == 1 else text


def _copy(value: Any) -> Any:
    return {k: _copy(v) for k, v in value.items()} if isinstance(value, dict) else value
