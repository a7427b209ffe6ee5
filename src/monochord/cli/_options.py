"""Options shared by several commands, and the settings tree that they fill."""

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import click
from click.core import ParameterSource
from click.shell_completion import CompletionItem

from monochord.capture.sources import SOURCES
from monochord.core.config import Tree, table
from monochord.core.errors import InputError, did_you_mean
from monochord.core.files import refuse_existing, similar_name
from monochord.core.lengths import LONGEST, metres_meant
from monochord.core.pitch_names import pitch
from monochord.core.registry import Registry
from monochord.core.units import Hertz, Metres
from monochord.live import LiveRun, Summary
from monochord.live.settings import DEFAULTS, RECORDINGS, put, recording_source
from monochord.perception.estimators import ESTIMATORS
from monochord.perception.model import folder_of, load
from monochord.perception.model.bundled import bundled_names
from monochord.physics.sensors import sensor_design, sensor_names
from monochord.physics.strings import string_names

F = TypeVar("F", bound=Callable[..., Any])
DEFAULT_SOURCE, DEFAULT_ESTIMATOR = (DEFAULTS[kind]["name"] for kind in ("source", "estimator"))
DEVICE_SOURCE = "soundcard"
"""Source opened by --device where no source is named."""
PORTS = "jack"
"""Source whose INPUT is port names, which have a colon."""
PRESETS: Mapping[str, Callable[[], list[str]]] = {"twin": sensor_names, "split_string": string_names}
"""Sources whose INPUT is a preset, with what lists their names."""
MAX_RADIUS: Metres = 1.0
"""Radius of the largest object that touches a string, in m."""


def amount(text: str) -> float:
    """Return a finite number above zero; raises a usage error otherwise."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 < number < math.inf:
        raise click.BadParameter(f"'{text}': expected a number above 0")
    return number


def metres(text: str) -> Metres:
    """Return a length in m above zero; raises a usage error otherwise, and for more than 5 m."""
    number = amount(text)
    if meant := metres_meant(number):
        raise click.BadParameter(f"'{text}': expected metres, {LONGEST:g} at most; {meant}")
    return number


def open_note(text: str) -> Hertz:
    """Return an open string's pitch in Hz, of a note's name or a number; raises a usage error otherwise."""
    try:
        return pitch(text)
    except InputError as error:
        raise click.BadParameter(str(error)) from error


def radius(text: str) -> Metres:
    """Return an object's radius at the contact, in m; raises a usage error otherwise."""
    number = metres(text)
    if number > MAX_RADIUS:
        raise click.BadParameter(f"'{text}': expected up to {MAX_RADIUS:g} m")
    return number


def labelled_take(text: str) -> tuple[str, float]:
    """Return path and touch position of FILE:POSITION; raises a usage error otherwise."""
    path, colon, number = text.rpartition(":")
    try:
        position = float(number)
    except ValueError:
        position = math.nan
    if not (colon and path and 0.0 <= position <= LONGEST):
        expected = "expected FILE:POSITION, the position in metres from the nut"
        meant = metres_meant(position)
        raise click.BadParameter(f"'{text}': {expected}{meant and f'; {meant}'}")
    return path, position


def completes(*names: Callable[[], Iterable[str]]) -> dict[str, Any]:
    """Return the parameter keyword that lets the shell complete names, and also files."""

    def complete(context: click.Context, parameter: click.Parameter, word: str) -> list[CompletionItem]:  # noqa: ARG001
        values = [name for group in names for name in group() if name.startswith(word)]
        return [*map(CompletionItem, values), CompletionItem(word, type="file")]

    return {"shell_complete": complete}


def set_option(listing: str) -> Callable[[F], F]:
    """Add ``--set NAME=VALUE``; `listing` is the command that lists the names."""
    return click.option(
        "--set",
        "assignments",
        multiple=True,
        metavar="NAME=VALUE",
        help=f"Override a setting; repeatable. List the names with '{listing}'.",
    )


def allow_host_option(command: F) -> F:
    """Add ``--allow-host``: further host names of the page."""
    return click.option(
        "--allow-host",
        multiple=True,
        metavar="NAME[:PORT]",
        help="Another host name of the page: a full DNS name, or the name of a proxy or container's host; "
        "repeatable.",
    )(command)


def _together(*options: Callable[[Any], Any]) -> Callable[[F], F]:
    """Return one decorator for several, of which the last comes first in the help."""

    def add(command: F) -> F:
        for option in options:
            command = option(command)
        return command

    return add


PAGE_OPTIONS = "port", "allow_host", "no_browser"
"""Parameters of `page_options` beside ``web``."""


def page_options(text: str) -> Callable[[F], F]:
    """Add ``--web``, with its help, and the options of the page's address."""
    return _together(
        click.option("--no-browser", is_flag=True, help="With --web: do not open a browser."),
        allow_host_option,
        click.option(
            "--port",
            type=click.IntRange(0, 65535),
            default=0,
            metavar="PORT",
            help="With --web: port of the page; 0 picks a free one.",
        ),
        click.option("--web", is_flag=True, help=text),
    )


source_options = _together(
    click.option("--rate", type=amount, metavar="HZ", help="Sample rate, if the source supports several."),
    click.option(
        "--device",
        metavar="NAME",
        help="Input device, or ports of --source jack, from 'monochord list devices'.",
    ),
    click.option(
        "--source",
        metavar="NAME",
        help=f"Audio source: 'monochord list sources'.  [default: by the file; else {DEFAULT_SOURCE}]",
        **completes(SOURCES.names),
    ),
)
"""The options that name and configure a source."""


string_options = _together(
    click.option(
        "--calibrate",
        type=labelled_take,
        multiple=True,
        metavar="FILE:POSITION",
        help="Recording of a touch at POSITION metres from the nut; repeatable.",
    ),
    click.option(
        "--string",
        metavar="PRESET",
        help="String: a name from 'monochord list strings', or FILE.toml.",
        **completes(string_names),
    ),
    click.option(
        "--open",
        "--open-frequency",
        "open_frequency",
        type=open_note,
        metavar="NOTE",
        help="Pitch of the open string: E2, F#3, Bb2, E4+12 (cents), or a number of Hz.",
    ),
    click.option("--length", type=metres, metavar="M", help="Length of the string, from nut to bridge."),
    click.option(
        "--estimator",
        metavar="NAME",
        help=f"Estimator, if there is no MODEL.  [default: {DEFAULT_ESTIMATOR}]",
        **completes(ESTIMATORS.names),
    ),
)
"""The options of a string: a preset, or length and open note; recordings of known position."""


def sensor_option(command: F) -> F:
    """Add the sensor option: a preset, or a file from ``monochord tune``."""
    return click.option(
        "--sensor",
        metavar="PRESET",
        help="Sensor: a name from 'monochord list sensors', or a file of 'monochord tune'.",
        **completes(sensor_names),
    )(command)


truncated_option = click.option(
    "--allow-truncated", is_flag=True, help="Read a truncated file up to its end."
)
"""Whether to read a sound file that was cut off."""

window_options = _together(
    click.option(
        "--hop", type=amount, metavar="S", help="Time from one window to the next.  [default: 0.01]"
    ),
    click.option(
        "--window",
        type=amount,
        metavar="S",
        help="Length of a window: one estimate is made per window.  [default: 0.1]",
    ),
)
"""The options of window length and hop."""


def _one_of_both(context: click.Context, parameter: click.Parameter, value: Any) -> Any:
    """Return the value of --workers or --cluster; raises a usage error for both."""
    given = {**context.params, parameter.name: value}
    workers, cluster = given.get("workers"), given.get("cluster")
    if workers and cluster:
        raise InputError(
            "--workers with --cluster", "only one of them", "omit --workers; a cluster has its own workers"
        )
    return value


worker_options = _together(
    click.option(
        "--cluster",
        default="",
        metavar="ADDRESS",
        callback=_one_of_both,
        help="Run on the dask cluster of this scheduler address.",
    ),
    click.option(
        "--workers",
        type=click.IntRange(min=1),
        metavar="N",
        callback=_one_of_both,
        help="Number of worker processes.  [default: one per core, if that is faster]",
    ),
)
"""The number of worker processes, or a cluster's address; they exclude each other."""


def refuse_without(options: str, effect: str, *names: str) -> None:
    """Refuse parameters given on the command line that have no effect in this command.

    `options` names the options and `effect` says when they have one, both for the error line.
    """
    context = click.get_current_context()
    if any(context.get_parameter_source(name) is ParameterSource.COMMANDLINE for name in names):
        raise InputError(options, effect, "leave it out")


STRING_OPTIONS = "estimator", "length", "open_frequency", "string", "sensor", "window", "hop"
"""Parameters of `string_options`, `sensor_option` and `window_options` that `put_estimator` takes."""


def model_and_input(inputs: tuple[str, ...]) -> tuple[str | None, str | None]:
    """Return the model and the input from the arguments ``[MODEL] [INPUT]``, None for a missing one.

    A model is a folder from ``monochord train``, or a bundled name.
    """
    models = [text for text in inputs if folder_of(Path(text))]
    others = [text for text in inputs if text not in models]
    if len(inputs) == 2 and not models:
        load(inputs[0])  # says why it is no model
    if len(models) > 1 or len(others) > 1:
        remedy = f"a MODEL is a folder from monochord train, or {', '.join(bundled_names())}"
        raise InputError(f"inputs {', '.join(inputs)}", "one MODEL at most, and one INPUT at most", remedy)
    return next(iter(models), None), next(iter(others), None)


def put_source(
    tree: Tree, options: dict[str, Any], opened: str | None = None, *, models: Iterable[str] = ()
) -> None:
    """Put the source into the tree: `opened` is INPUT, and `options` those of `source_options`.

    `models` holds model names, for which INPUT may have been meant.
    """
    before, device = table(tree, "source"), options["device"]
    if opened is not None:
        source = options["source"] or (DEVICE_SOURCE if device is not None else before.get("name"))
        _refuse_nothing(opened, models, source, names_input=device is None)
    if opened is not None and device is not None:
        raise InputError(f"{opened} with --device {device}", "only one of them")
    inferred = recording_source(opened) if opened is not None else None
    if device is not None and "name" not in before:
        inferred = DEVICE_SOURCE
    name = options["source"] or inferred or before.get("name", DEFAULT_SOURCE)
    # Another source than the file's does not take over the options of the file's.
    tree["source"] = {**(before if before.get("name") == name else {}), "name": name}
    opened = opened if opened is not None else device
    if opened is not None:
        put(tree, "source", **{first_field(SOURCES, name): opened})
    if options["rate"] is not None:
        if "sample_rate" not in fields_of(SOURCES, name):
            given = f"--rate {options['rate']:g} with the source {name}"
            raise InputError(
                given, "a source whose rate can be chosen", f"leave it out, or use {DEVICE_SOURCE}"
            )
        put(tree, "source", sample_rate=options["rate"])


def _refuse_nothing(opened: str, models: Iterable[str], source: str | None, *, names_input: bool) -> None:
    """Refuse an INPUT that is nothing which the source can read, as a mistyped model is.

    Without a source it is a recording, or a port name, which has a colon. `names_input` is false where
    --device names the source's input, so that this one was to be a model.
    """
    is_folder, names = Path(opened).is_dir(), list(models)
    if not is_folder and recording_source(opened):
        return
    is_path = opened.startswith(("./", "../", "/", "~"))
    if not is_folder and not is_path and names_input and _can_read(source, opened, names):
        return
    presets = PRESETS[source]() if source is not None and source in PRESETS else []
    kinds = [f"a model ({', '.join(names)}, or a folder from monochord train)"] if names else []
    kinds += ["a recording (.wav, .mp3, .mcap, ...)"] * (source is None or source in RECORDINGS.values())
    kinds += ["or ports such as system:capture_1"] * (source in (None, PORTS))
    kinds += [f"or a preset of the source {source} ({', '.join(presets)})"] if presets else []
    what = "a folder" if is_folder else "no such file or folder"
    what += " without a model" if is_folder and names else ""
    word = opened.replace("-", "_")
    remedy = f"--source {word}" if word in SOURCES.names() else similar_name(opened, [*names, *presets])
    if names and not is_folder and not remedy:
        remedy = f"monochord train --out {opened} makes a model"
    raise InputError(f"'{opened}' ({what})", ", ".join(kinds), remedy)


def _can_read(source: str | None, opened: str, models: Iterable[str]) -> bool:
    """Return whether a source may know an INPUT by this name, which is that of no file."""
    if source is None or source == PORTS:
        return ":" in opened
    if source in PRESETS:
        return opened in PRESETS[source]()
    return source not in RECORDINGS.values() and not did_you_mean(opened, models)


def fields_of(registry: Registry[Any], name: str) -> list[str]:
    """Return the names of a plug-in's options; the first one is its input."""
    return [field.name for field in dataclasses.fields(registry.load(name)) if field.init]


def first_field(registry: Registry[Any], name: str) -> str:
    """Return the name of the option with a plug-in's input."""
    return fields_of(registry, name)[0]


def refuse_unwritable(path: Path, suffixes: Iterable[str]) -> None:
    """Refuse an output file with another suffix, or in a missing folder."""
    known = list(suffixes)
    if path.suffix.lower() not in known:
        allowed = f"a name that ends in {', '.join(known)}"
        raise InputError(f"file '{path}'", allowed, did_you_mean(path.suffix, known))
    if not path.parent.is_dir():
        raise InputError(f"file '{path}'", "a file in an existing folder", f"create '{path.parent}' first")


def refuse_unless_forced(*paths: Path, force: bool) -> None:
    """Refuse to replace a file without --force."""
    for path in () if force else paths:
        refuse_existing(path, "replace it with --force")


def refuse_own_design(path: Path, sensor: str) -> None:
    """Refuse to replace the file of a design by a measured sensor, which refers to that file."""
    if sensor and path.resolve() == Path(sensor_design(sensor)).resolve():
        raise InputError(f"file '{path}', the design itself", "another file for --out")


def refuse_short(given: str, setup: LiveRun, summary: Summary) -> None:
    """Raise `InputError` where a source ended before its first complete window."""
    if not (summary.windows or summary.skipped or summary.interrupted):
        allowed = f"{min(setup.window.length, setup.seconds):g} s or more"
        raise InputError(f"{given} (shorter than a window)", allowed, "use a shorter --window")
