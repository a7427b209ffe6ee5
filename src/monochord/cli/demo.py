"""The command `demo`: the live view without hardware, with the twin's truth beside the estimates."""

import dataclasses
import json
import math
import sys
from contextlib import ExitStack
from typing import Any, get_args

import click

from monochord.cli._options import allow_host_option, amount, completes, refuse_without
from monochord.cli._output import echo
from monochord.core.errors import InputError, did_you_mean
from monochord.core.interruption import interruption
from monochord.core.ownership import scratch_folder
from monochord.front.page import with_page
from monochord.lab.demonstration import (
    LEARNED,
    PHYSICS,
    estimator_options,
    jack_server,
    refuse_unlearned,
    remarks_on_model,
    remarks_on_physics,
    twin_options,
    write_tuned,
)
from monochord.live import LiveRun, Scorer, run
from monochord.physics.materials import load_material, material_names
from monochord.physics.sensors import sensor_names
from monochord.physics.twin.world import World

UNWATCHED = 20.0
"""Duration of a demonstration that prints only its result, in s."""


@click.command()
@click.argument("sensor", default="prototype", **completes(sensor_names))
@click.option(
    "--seconds", type=amount, metavar="S", help="How long to run.  [default: until Control-C; 20 with --json]"
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Random seed of the touches."
)
@click.option(
    "--estimator",
    default=LEARNED,
    show_default=True,
    metavar="NAME",
    help=f"{LEARNED}: the bundled trained model; {PHYSICS}: physics alone.",
    **completes(lambda: (LEARNED, PHYSICS)),
)
@click.option(
    "--world",
    type=click.Choice(get_args(World)),
    help="A perfect sensor, or one with the tolerances and noise of a real build.  [default: plausible]",
)
@click.option(
    "--build",
    type=click.IntRange(min=0),
    metavar="N",
    help="Simulate build N of the sensor: the same design, other tolerances.",
)
@click.option(
    "--day", type=click.IntRange(min=0), metavar="N", help="Simulate day N: another temperature and tuning."
)
@click.option(
    "--material",
    multiple=True,
    metavar="NAME",
    help="Object that touches the string, from 'monochord list materials'; repeatable.",
    **completes(material_names),
)
@click.option(
    "--jack",
    is_flag=True,
    help="Send the sound through a JACK server; start one with the dummy driver if none runs.",
)
@click.option(
    "--port",
    type=click.IntRange(0, 65535),
    default=0,
    metavar="PORT",
    help="Port of the page; 0 picks a free one.",
)
@allow_host_option
@click.option("--no-browser", is_flag=True, help="Serve the page without opening a browser.")
@click.option("--json", "as_json", is_flag=True, help="Print the score alone, as one JSON object.")
def demo(sensor: str, **options: Any) -> None:
    """Touch a simulated sensor, and see estimates beside the truth.

    SENSOR is a sensor of 'monochord list sensors', by default the prototype. Its digital twin, a simulation,
    replaces the string, the drivers, the microphones and the touching objects; everything else runs as in
    'monochord live'. The sensor is tuned first, and its length is told as a ruler says. Objects then press,
    slide and roll at random, and a bundled model estimates contact, position, normal force and slip. It was
    trained on other builds of this sensor.

    A page opens in the browser; press on its string with the mouse or a finger to touch it yourself. Over
    ssh, or without a display, open the printed address. Control-C ends the demonstration and prints a score.

    \b
    monochord demo
    monochord demo --material allen_key --estimator closed_form
    monochord demo --seconds 5 --json
    """  # noqa: D301
    name = options["estimator"].replace("-", "_")
    if name not in (LEARNED, PHYSICS):
        given = f"estimator '{options['estimator']}' in the demonstration"
        raise InputError(given, f"{LEARNED} or {PHYSICS}", did_you_mean(name, (LEARNED, PHYSICS)))
    # Refused before the page is announced, and before anything is compiled.
    for material in options["material"]:
        load_material(material)
    if name == LEARNED:
        refuse_unlearned(sensor)
    source = twin_options(
        sensor, options["seed"], materials=[*options["material"]],
        **{key: options[key] for key in ("world", "build", "day")},
    )  # fmt: skip
    estimator = estimator_options(name)
    quiet, score = options["as_json"], Scorer()
    seconds = options["seconds"] or (UNWATCHED if quiet else math.inf)
    if quiet:
        refuse_without("--allow-host with --json", "a run that serves the page", "allow_host")
    page = {
        "at": str(options["port"]),
        "browser": not options["no_browser"],
        "allow_host": [*options["allow_host"]],
    }
    sinks = {} if quiet else {"web": page, "terminal": {}}
    setup = LiveRun.read({"source": source, "estimator": estimator, "sinks": sinks, "seconds": seconds})
    with ExitStack() as stack:
        if options["jack"]:
            from monochord.lab.jack_twin import JackTwin  # noqa: PLC0415

            stop = stack.enter_context(interruption())
            stack.enter_context(stop.at_once())  # an end while all is started ends the server, too
            server = jack_server(stack)
            played = {name: value for name, value in source.items() if name != "name"}
            setup = dataclasses.replace(setup, source=JackTwin(server=server, twin=played))
        begun = [stack.enter_context(sink.ahead()) for sink in with_page(setup.sinks)]
        as_tuned = write_tuned(source, stack.enter_context(scratch_folder()) / "sensor.toml")
        summary = run(dataclasses.replace(setup, sinks=(*begun, score), sensor=as_tuned))
    if options["as_json"]:
        facts = {key: source.get(key) for key in ("sensor", "world", "build", "day", "seed", "materials")}
        about = {"simulated": True, "estimator": name, **facts}
        json.dump(about | score.tree() | summary.tree(), sys.stdout)
        echo()
        return
    remarks = remarks_on_model(source) if name == LEARNED else remarks_on_physics(score)
    echo("", *summary.lines(), "", *score.lines(), "", *remarks)
