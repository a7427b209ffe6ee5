"""Options of a command from the function that it calls: its signature, and "Parameters" in its docstring."""

import inspect
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, get_origin

import click

from monochord.core.conversion import bare_type, converted, describe_type, is_union
from monochord.core.errors import InputError
from monochord.core.lengths import LONGEST, metres_meant
from monochord.core.units import unit_of

F = TypeVar("F", bound=Callable[..., Any])


def options_of(function: Callable[..., Any], *names: str, **special: Any) -> Callable[[F], F]:
    """Add the options of these parameters of a function: ``--out`` for ``out``, and so on, in this order.

    Type, range, default and help are the function's, and a number's unit is the placeholder in the help. A
    truth value becomes a flag, and a sequence an option that can be repeated. `special` are keywords of
    `click.option` that differ on the command line; `flags` are its words where they are not the parameter's.
    """
    flags = special.pop("flags", ())

    def add(command: F) -> F:
        for name in reversed(names):
            stated = _stated(inspect.signature(function).parameters[name])
            option: dict[str, Any] = {**stated, "help": help_of(function, name), **special}
            if option.get("required"):
                del option["default"], option["show_default"]
            if limits := isinstance(number := option.get("type"), Number) and number.limits:
                option["help"] += f"  [{limits}]"
            if option.get("multiple"):
                option["help"] = f"{option['help'].removesuffix('.')}; repeatable."
            word = name.replace("_", "-")
            usual = f"--{word}/--no-{word}" if option.get("default") is True else f"--{word}"
            command = click.option(*(flags or [usual]), name, **option)(command)
        return command

    return add


def help_of(function: Callable[..., Any], name: str) -> str:
    """Return what a function's docstring says of a parameter, as help on the command line.

    >>> def play(seconds: float, loop: bool = False) -> None:
    ...     '''Play.
    ...
    ...     Parameters
    ...     ----------
    ...     seconds
    ...         Duration, in s; by default all.
    ...     loop
    ...         Whether to begin again after `seconds`.
    ...     '''
    >>> help_of(play, "seconds"), help_of(play, "loop")
    ('Duration.  [default: all]', 'Begin again after --seconds.')
    """
    section = (inspect.getdoc(function) or "").partition("Parameters\n----------\n")[2]
    said = re.search(rf"^(?:\w+, )*{name}(?:, \w+)*\n((?: .*\n?)+)", section, re.MULTILINE)
    text = " ".join(said[1].split()) if said else ""  # Python may have been told to leave docstrings out
    text = re.sub(r"^Whether to (\w)", lambda found: found[1].upper(), text)
    text = re.sub(r", in [\w/]+(?=[,;.])", "", text)
    text = re.sub(r'``"?(.*?)"?``', r"\1", text)
    for other in inspect.signature(function).parameters:
        text = text.replace(f"`{other}`", f"--{other.replace('_', '-')}")
    return re.sub(r"; by default (.*)\.$", r".  [default: \1]", text)


class Number(click.ParamType[Any]):
    """A number as an annotation states it; a length far too large for metres is refused."""

    name = "number"

    def __init__(self, kind: Any) -> None:
        self.kind = kind
        limits = re.search(r"from \S+ to \S{1,8}( \S+)?$", describe_type(kind))
        self.limits = limits[0] if limits else ""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number; raises a usage error for another one."""
        if unit_of(self.kind) == " m" and (meant := _metres_meant(value)):
            self.fail(f"'{value}': expected metres, {LONGEST:g} at most; {meant}", param, ctx)
        try:
            return converted(self.kind, value, "")
        except InputError as error:
            self.fail(f"'{value}': expected {error.allowed}", param, ctx)


def _metres_meant(value: Any) -> str:
    """Return the question for a number that is no length in m; empty for one that may be, or no number."""
    try:
        return metres_meant(float(value))
    except (TypeError, ValueError):
        return ""


def _stated(parameter: inspect.Parameter) -> dict[str, Any]:
    """Return the keywords of `click.option` that a parameter states."""
    kind = _without_none(parameter.annotation)
    default = None if parameter.default is inspect.Parameter.empty else parameter.default
    shown = {"default": default, "show_default": default not in (None, "", ()) and default is not False}
    bare, inner = bare_type(kind)[0], get_args(kind)
    if bare is bool:
        return {**shown, "is_flag": True}
    if get_origin(bare) is Literal:
        return {**shown, "type": click.Choice([*filter(None, inner)])}
    if bare in (int, float):
        unit = unit_of(kind).strip().upper()
        return {**shown, "type": Number(kind), "metavar": unit or "N"}
    if is_union(bare) and Path in inner:
        return {**shown, "type": click.Path(path_type=Path)}
    if get_origin(bare) in (None, tuple) or is_union(bare):
        return {**shown, "type": str}
    return {**shown, "multiple": True}


def _without_none(kind: Any) -> Any:
    """Return the type of a value that is given."""
    parts = [part for part in get_args(kind) if part is not type(None)] if is_union(kind) else []
    return parts[0] if len(parts) == 1 else kind
