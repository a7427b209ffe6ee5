"""The command `live`: estimates from a running source as they arrive."""

import dataclasses
from pathlib import Path
from typing import Any

import click

from monochord.cli._options import (
    STRING_OPTIONS,
    allow_host_option,
    amount,
    completes,
    first_field,
    model_and_input,
    put_source,
    refuse_short,
    set_option,
    source_options,
    string_options,
    window_options,
)
from monochord.cli._output import echo
from monochord.cli._skin import with_skin
from monochord.core.config import Tree, dump_toml, load_toml, override, table
from monochord.core.errors import InputError
from monochord.front.page import with_page
from monochord.live import LiveRun, run
from monochord.live.calibration import calibrated
from monochord.live.saved_settings import SavedSettings
from monochord.live.settings import NAME, put_estimator, refuse_string_twice
from monochord.live.sinks import SINKS
from monochord.live.sinks.base import Sink
from monochord.perception.model.bundled import bundled_names
from monochord.physics.sensors import sensor_names

PAGE = "web"
"""The sink that --allow-host configures."""
LINES = "jsonl"
"""The sink behind --json."""


@click.command()
@click.argument("inputs", metavar="[MODEL] [INPUT]", nargs=-1, **completes(bundled_names))
@source_options
@click.option(
    "--sensor",
    "sensors",
    multiple=True,
    metavar="[NAME=]PRESET",
    help="Sensor: a name from 'monochord list sensors', or a file of 'monochord tune'. Repeat it with "
    "names: several strings, of two channels each in this order.",
    **completes(sensor_names),
)
@click.option(
    "--skin",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Several strings on one link, from the file of 'monochord skin'.",
)
@string_options
@window_options
@click.option(
    "--sink",
    "sinks",
    multiple=True,
    metavar="NAME[=WHERE]",
    help="Where to send estimates, from 'monochord list sinks'; repeatable.  [default: terminal]",
    **completes(SINKS.names),
)
@allow_host_option
@click.option("--seconds", type=amount, metavar="S", help="Stop after S seconds of sound.")
@click.option("--real-time", is_flag=True, help="Run with real-time priority.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per window.")
@click.option(
    "--config", type=click.Path(path_type=Path), metavar="FILE", help="Read settings from a TOML file."
)
@set_option("monochord list settings live")
@click.option(
    "--save-config",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write all settings of this run to a TOML file.",
)
def live(inputs: tuple[str, ...], **options: Any) -> int:
    """Estimate touches live, from a sensor or a recording.

    MODEL is the folder of a trained model, or a bundled one such as demo; without it, a closed-form estimator
    is used. INPUT is a sound file (wav, flac, mp3, ogg, aiff and others), a session's .mcap, a device or JACK
    ports. Options override --config, and --set overrides both. Control-C or SIGTERM ends the run and prints a
    summary. If a sink fails, it is closed, the others continue, and the exit status is 1.

    \b
    monochord live demo --source twin
    monochord live take.wav --length 0.65 --open A2 --json
    monochord live demo --device 'USB Audio' --sensor sensor.toml
    monochord live demo --sensor left=left.toml --sensor right=right.toml
    """  # noqa: D301
    options["sensor"] = " --sensor ".join(options["sensors"])
    refuse_string_twice(*(options[name] for name in ("string", "sensor", "length", "open_frequency")))
    options["sensor"], strings = _sensors(options["sensors"])
    if options["skin"] and options["sensors"]:
        raise InputError("--skin with --sensor", "only one of them", "a skin names its sensors")
    model, opened = model_and_input(inputs)
    tree = _tree(model, opened, options)
    if options["allow_host"]:
        _allow(tree["sinks"], [*options["allow_host"]])
    tree |= {"strings": strings} if strings else {}
    tree = with_skin(tree, options["skin"]) if options["skin"] else tree
    tree = override(tree, options["assignments"])
    tree = calibrated(tree, options["calibrate"])
    setup = LiveRun.read(tree)
    saving: tuple[Sink, ...] = ()
    if options["save_config"]:
        saving = (SavedSettings(options["save_config"], dump_toml(setup.resolved())),)
    summary = run(dataclasses.replace(setup, sinks=(*saving, *with_page(setup.sinks))))
    refuse_short(opened or table(tree, "source")["name"], setup, summary)
    # Standard output may carry data, of which the summary is no part.
    echo(*summary.lines(), err=options["as_json"])
    return int(any(each.failure for each in summary.delivered))


def _sensors(given: tuple[str, ...]) -> tuple[str | None, Tree]:
    """Return the sensor of one string, or the tables of several named strings."""
    named = [each.partition("=") for each in given if not Path(each).exists()]
    strings: Tree = {name: {"sensor": preset} for name, _, preset in named if preset and NAME.fullmatch(name)}
    if len(given) > max(len(strings), 1):
        text = " ".join(f"--sensor {each}" for each in given)
        raise InputError(text, "one sensor, or several of different names", "write --sensor NAME=PRESET")
    return None if strings else next(iter(given), None), strings


def _tree(model: str | None, opened: str | None, options: dict[str, Any]) -> Tree:
    """Return the settings of the configuration file with the options applied."""
    tree: Tree = load_toml(options["config"]) if options["config"] else {}
    put_source(tree, options, opened, models=bundled_names())
    put_estimator(tree, model, **{name: options[name] for name in STRING_OPTIONS})
    if options["seconds"] is not None:
        tree["seconds"] = options["seconds"]
    if options["real_time"]:
        tree["real_time"] = True
    configured = table(tree, "sinks") if "sinks" in tree else None
    tree["sinks"] = _sinks(configured, options["sinks"], as_json=options["as_json"])
    return tree


def _sinks(configured: Tree | None, named: tuple[str, ...], *, as_json: bool) -> Tree:
    """Return the sink tables: from --sink, else from the configuration, else the terminal."""
    known, sinks = configured or {}, Tree()
    for text in named:
        kind, equals, where = text.partition("=")
        if kind in sinks:  # what two of a kind write would be mixed up
            raise InputError(f"--sink {kind} twice", "one of each kind")
        sinks[kind] = {**table(known, kind), **({first_field(SINKS, kind): where} if equals else {})}
    if as_json and sinks.get(LINES):
        raise InputError(f"--json with --sink {LINES}", "only one of them", "both write the same lines")
    if as_json:
        sinks[LINES] = {**table(known, LINES), first_field(SINKS, LINES): "-"}
    if sinks or configured is not None:
        return sinks or known
    return {"terminal": {}}


def _allow(sinks: Tree, names: list[str]) -> None:
    """Add further host names of the page to its sink's table."""
    if PAGE not in sinks:
        given = " ".join(f"--allow-host {name}" for name in names)
        raise InputError(f"{given} without a page", f"--sink {PAGE}", "add that sink")
    sinks[PAGE] = {**table(sinks, PAGE), "allow_host": names}
