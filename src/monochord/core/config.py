"""Configuration: TOML text and ``a.b=c`` overrides into frozen dataclasses, strictly.

An unknown key is an error with "did you mean"; a value of the wrong type is an error with its path. The
dataclass itself is the schema, and stands beside the code that it configures.
"""

import dataclasses
import errno
import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from enum import Enum
from pathlib import Path
from typing import Any, TypeAlias, TypeVar, get_args

import msgspec
import tomli_w

from monochord.core.errors import InputError, did_you_mean
from monochord.core.schema import choices_of, fields_of, inside, wording

T = TypeVar("T")
Tree: TypeAlias = dict[str, Any]
MAX_BYTES = 1 << 26
"""Of a file of text that is read whole."""
DEEPEST = 32
"""Names in an override, at most."""
LONGEST = 80
"""Characters of a value that an error message shows."""


def load_toml(path: Path) -> Tree:
    """Read a TOML file; raises `InputError` where it is absent or not TOML."""
    try:
        return tomllib.loads(_text(path))
    except OSError as error:
        raise InputError(f"configuration {path} ({error.strerror})", "a readable TOML file") from error
    except (ValueError, RecursionError) as error:  # TOML's own, bad UTF-8, a number of thousands of digits
        raise InputError(f"configuration {path} ({error})", "TOML text") from error


def load_json(path: Path, remedy: str = "") -> Any:
    """Read a JSON file; raises `InputError`, which ends with `remedy`, where it is absent or not JSON."""
    try:
        return json.loads(_text(path))
    except OSError as error:
        raise InputError(f"{path} ({error.strerror})", "a readable file", remedy) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} (damaged: {error})", "JSON text", remedy) from error


def table(tree: Mapping[str, Any], name: str) -> Tree:
    """Return the table `name` of a tree, an empty one where there is none.

    Raises
    ------
    InputError
        If something else than a table is there.

    >>> table({"window": {"hop": 0.01}}, "window"), table({}, "window")
    ({'hop': 0.01}, {})
    """
    found = tree.get(name, {})
    if not isinstance(found, dict):
        raise InputError(f"option '{name}' = {_shown(found)}", "a table")
    return found


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
        if not equals or not all(names) or len(names) > DEEPEST:
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
        A dataclass, perhaps with dataclasses, lists or tables inside.
    tree
        Plain values by field name, as TOML or JSON gives them; text is converted where a number is due.
    where
        Name of this part in error messages.

    Returns
    -------
    T
        The dataclass; what the tree leaves out has its default.

    Raises
    ------
    InputError
        Naming the option by its path: for a key that is unknown (with a suggestion), a value of the wrong
        type, a field without default that is left out, and a number that is NaN. What the dataclass itself
        refuses passes through as it raised it.
    """
    try:
        _refuse_unknown(cls, tree, where)
        return msgspec.convert(tree, cls, strict=False, dec_hook=_decode)
    except RecursionError as error:
        raise InputError(f"{where or cls.__name__} (nested too deep)", wording(cls)) from error
    except msgspec.ValidationError as error:
        own = error.__cause__
        if not isinstance(own, InputError):
            raise _explain(error, cls, tree, where) from error
    # What the dataclass refused came of nothing else: raised there, each error would be the other's cause.
    raise own


def to_tree(config: Any) -> Tree:
    """Return a dataclass as plain values that TOML can hold; fields that are None are left out."""
    return _plain(config)


def dump_toml(tree: Tree) -> str:
    r"""Return a tree of plain values as TOML text: the resolved copy that is saved beside a result.

    >>> dump_toml({"window": {"hop": 0.01}})
    '[window]\nhop = 0.01\n'
    """
    return tomli_w.dumps(_plain(tree))


def _text(path: Path) -> str:
    if path.stat().st_size > MAX_BYTES:
        raise OSError(errno.EFBIG, f"more than {MAX_BYTES} bytes", str(path))
    return path.read_text(encoding="utf-8")


def _decode(kind: type, value: Any) -> Any:
    if issubclass(kind, Path) and isinstance(value, str):
        return kind(value)
    message = f"cannot make {kind.__name__} of {value!r}"
    raise TypeError(message)


def _refuse_unknown(kind: Any, value: Any, where: str) -> None:
    """Refuse what msgspec lets pass: keys that no field has, at any depth, and numbers that are NaN."""
    is_path = kind is Path or Path in get_args(kind)  # whose name may be of any bytes
    for text in value if isinstance(value, Mapping) else [] if is_path else [value]:
        if isinstance(text, str) and not text.isascii() and not _is_unicode(text):
            raise InputError(f"option '{where}' = {text!a}", "text in UTF-8")
    is_number = kind is float or float in get_args(kind)
    if is_number and isinstance(value, (float, str)) and str(value).strip().lower() == "nan":
        raise InputError(f"option '{where}' = nan", wording(kind))
    if isinstance(value, Mapping):
        fields = fields_of(kind)
        for name in value:
            if fields is not None and name not in fields:
                given = f"option '{_place(where, name)}'"
                raise InputError(given, ", ".join(fields) or "none", did_you_mean(name, fields))
    for step, child in _children(value):
        _refuse_unknown(inside(kind, step), child, _place(where, step))


def _explain(error: msgspec.ValidationError, cls: type, tree: Mapping[str, Any], where: str) -> InputError:
    """Say in one line which option was given what, and what it may be, from msgspec's reason and path."""
    reason, _, path = str(error).partition(" - at `$")
    steps: list[str | int] = [
        int(index) if index.isdigit() else name or index
        for name, index in re.findall(r"\.(\w+)|\[([^]]*)\]", path)
    ]
    absent = re.match("Object missing required field `(.+?)`", reason)
    kind: Any = cls
    value: Any = tree
    for step in steps + ([absent[1]] if absent else []):
        key = _culprit(kind, value) if step == "..." else step
        kind, where, value = inside(kind, key), _place(where, key), dict(_children(value)).get(key)
    if absent:
        return InputError(f"option '{where}' (not given)", wording(kind))
    bound = re.match("Expected `(.+?)` ([<>].*|matching .*)", reason)
    allowed = f"{bound[1]} {bound[2]}" if bound else wording(kind)
    if not reason.startswith(("Expected", "Invalid", "cannot make", "Integer value out of range")):
        allowed = reason  # a ValueError of the dataclass's own
    remedy = did_you_mean(value, choices_of(kind)) if isinstance(value, str) else ""
    shown = _shown(value)
    return InputError(f"option '{where}' = {shown}" if where else shown, allowed, remedy)


def _shown(value: Any) -> str:
    """Return a value as an error message shows it: in one line, and not in thousands of digits."""
    try:
        text = repr(value)
    except ValueError:  # an integer of more digits than Python writes
        return "a number of thousands of digits"
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


def _is_unicode(text: str) -> bool:
    """Whether a text can be written as UTF-8; an argument that holds other bytes cannot."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _culprit(kind: Any, table: Mapping[str, Any]) -> str:
    """Return the key of the first entry that will not convert; msgspec does not name keys of a table."""
    for key, value in table.items():
        try:
            msgspec.convert(value, inside(kind, key), strict=False, dec_hook=_decode)
        except msgspec.ValidationError:
            return key
    return "..."


def _place(where: str, step: str | int) -> str:
    if isinstance(step, int):
        return f"{where}[{step}]"
    return f"{where}.{step}" if where else step


def _children(value: Any) -> Iterator[tuple[str | int, Any]]:
    if isinstance(value, Mapping):
        yield from value.items()
    elif isinstance(value, (list, tuple)):
        yield from enumerate(value)


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
