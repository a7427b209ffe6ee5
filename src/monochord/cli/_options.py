"""Options that several verbs share, and the settings tree that they fill."""

import dataclasses
import math
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import click
from click.core import ParameterSource

from monochord.capture.sources import SOURCES
from monochord.core.config import Tree
from monochord.core.config import table as table_of
from monochord.core.errors import InputError, did_you_mean
from monochord.core.registry import Registry
from monochord.core.units import Metres
from monochord.live import Session, Settings, Summary
from monochord.live.calibration import medians

F = TypeVar("F", bound=Callable[..., Any])
FILES, SESSIONS = "wav", "session"  # the sources that read recordings
USUAL_ESTIMATOR = "closed-form"
WIDEST: Metres = 1.0
"""Radius of the largest object that touches a string."""


def amount(text: str) -> float:
    """Return a finite number above zero; anything else is a usage error."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 < number < math.inf:
        raise click.BadParameter(f"'{text}': allowed is a number above 0")
    return number


def radius(text: str) -> float:
    """Return the radius of what touches a string, in metres; anything else is a usage error."""
    number = amount(text)
    if number > WIDEST:
        raise click.BadParameter(f"'{text}': allowed is up to {WIDEST:g} m")
    return number


def refuse_without(options: str, effect: str, *names: str) -> None:
    """Refuse parameters of the command at hand that were given on the command line and have no effect.

    `options` are the options in words and `effect` says when they have one: both for the line.
    """
    context = click.get_current_context()
    if any(context.get_parameter_source(name) is ParameterSource.COMMANDLINE for name in names):
        raise InputError(options, effect, "leave it out")


def take(text: str) -> tuple[str, float]:
    """Return path and touch position of FILE:POSITION; anything else is a usage error."""
    path, colon, number = text.rpartition(":")
    try:
        position = float(number)
    except ValueError:
        position = math.nan
    if not (colon and path and 0.0 <= position < math.inf):
        raise click.BadParameter(f"'{text}': allowed is FILE:POSITION, the position in metres from the nut")
    return path, position


def string_options(command: F) -> F:
    """Add what a person knows of the string: a preset, or length and open note; takes of known position."""
    for option in (
        click.option(
            "--calibrate",
            type=take,
            multiple=True,
            metavar="FILE:POSITION",
            help="A take touched at POSITION metres; repeatable.",
        ),
        click.option("--string", metavar="PRESET", help="A string of the catalogue, or FILE.toml."),
        click.option("--open-frequency", type=amount, metavar="HZ", help="Frequency of the open string."),
        click.option("--length", type=amount, metavar="METRES", help="Length of the string, nut to bridge."),
        click.option("--estimator", metavar="NAME", help=f"What estimates.  [default: {USUAL_ESTIMATOR}]"),
    ):
        command = option(command)
    return command


def window_options(command: F) -> F:
    """Add the window's length and hop."""
    for option in (
        click.option("--hop", type=amount, metavar="S", help="Distance of windows.  [default: 0.01]"),
        click.option("--window", type=amount, metavar="S", help="Length of a window.  [default: 0.1]"),
    ):
        command = option(command)
    return command


def refuse_string_twice(string: str | None, length: float | None, open_frequency: float | None) -> None:
    """Refuse a preset beside both numbers that stand in its place."""
    if string and length is not None and open_frequency is not None:
        given = f"--string {string} beside --length and --open-frequency"
        raise InputError(given, "a preset, or both numbers", "leave one or the other out")


def put(tree: Tree, table: str, **values: Any) -> None:
    """Lay the options that were given (those that are not None) into a table of the tree."""
    given = {name: value for name, value in values.items() if value is not None}
    if given:
        tree[table] = {**table_of(tree, table), **given}


def first_field(registry: Registry[Any], name: str) -> str:
    """Return the name of the field that says what a plug-in opens."""
    return dataclasses.fields(registry.load(name))[0].name


def recording(path: str) -> Tree:
    """Return the source table that reads a recording."""
    name = SESSIONS if Path(path).suffix.lower() == ".mcap" else FILES
    return {"name": name, first_field(SOURCES, name): path}


def calibrated(tree: Tree, takes: Iterable[tuple[str, float]]) -> Tree:
    """Return the tree with what the takes tell (frequency, position, inharmonicity) as calibration."""
    told: list[list[float]] = []
    for path, position in takes:
        settings = Settings.read({**tree, "source": recording(path), "sinks": {}, "seconds": math.inf})
        try:
            heard = medians(settings.session())
            note = [heard["frequency"], position]
            told.append([*note, heard["inharmonicity"]] if "inharmonicity" in heard else note)
        except InputError as error:
            if Path(path).name in error.given:
                raise
            raise InputError(f"{path}, {error.given}", error.allowed, error.remedy) from error
    if not told:
        return tree
    estimator = dict(tree.get("estimator", {}))
    return {**tree, "estimator": {**estimator, "calibration": [*estimator.get("calibration", []), *told]}}


def refuse_unwritable(path: Path, suffixes: Iterable[str]) -> None:
    """Refuse a file to write whose name has another suffix, or whose folder is not there."""
    known = list(suffixes)
    if path.suffix.lower() not in known:
        allowed = f"a name that ends in {', '.join(known)}"
        raise InputError(f"file '{path}'", allowed, did_you_mean(path.suffix, known))
    if not path.parent.is_dir():
        raise InputError(f"file '{path}'", "a file in a folder that exists", f"make '{path.parent}' first")


def refuse_short(given: str, session: Session, summary: Summary) -> None:
    """Raise `InputError` where a source ended before its first whole window."""
    if not (summary.windows or summary.skipped or summary.interrupted):
        allowed = f"{min(session.window.length, session.seconds):g} s or more"
        raise InputError(f"{given} (shorter than a window)", allowed, "use a shorter --window")
