"""The live view with no hardware: the twin, the truth beside the estimate."""

import dataclasses
import json
import math
import shlex
import sys
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, get_args

import click

from monochord.capture.sources import SOURCES
from monochord.cli._options import allow_host_option, amount, completes, refuse_without
from monochord.cli._output import echo
from monochord.core.errors import DeviceError, InputError, did_you_mean
from monochord.core.interruption import interruption
from monochord.core.ownership import scratch_folder
from monochord.live import LiveRun, Scorer, run
from monochord.live.tuning import tuned
from monochord.perception.tuning.sessions import LENGTH_TOLERANCE
from monochord.physics.materials import load_material, material_names
from monochord.physics.sensors import load_sensor, sensor_names
from monochord.physics.twin.world import World

UNWATCHED = 20.0
"""Seconds of a demonstration whose only output is its result."""
LEARNED, PHYSICS = "model", "closed_form"
BUNDLED = "demo"
"""Name of the bundled model that the demonstration shows."""
JACK_PERIOD = 256
"""Frames a period of a JACK server that is started here."""
TRAINED_SENSOR, TRAINED_BUILDS = "prototype", range(1, 73)
"""The sensor and the builds of it that this model was trained on, by the plan builds."""
UNSEEN: Mapping[str, Any] = {
    "world": "plausible_1",
    "build": 131,
    "day": 51,
    "materials": ["plastic", "wood", "metal_tube", "allen_key"],
}
"""A build, a day and objects that no training session of that plan is of."""


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
    help=f"{LEARNED}: the bundled trained model; {PHYSICS}: physics, with modes picked by trained networks.",
    **completes(lambda: (LEARNED, PHYSICS)),
)
@click.option(
    "--world",
    type=click.Choice(get_args(World)),
    help="A perfect sensor, or one with the tolerances and noise of a real build.  [default: plausible_1]",
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
    stands in for the string, the drivers, the microphones and the touching objects; everything else runs as
    in 'monochord live'. The sensor is tuned first. Objects then press, slide and roll at random, and a
    bundled model estimates contact, position, normal force and slip. It was trained on other builds of this
    sensor.

    A page opens in the browser; press on its string with the mouse or a finger to touch it yourself. Over
    ssh, or without a display, open the address that is printed. Control-C ends the demonstration and prints
    a score.

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
        _refuse_unlearned(sensor)
    source, estimator = _twin(sensor, options), _estimator(name)
    quiet, score = options["as_json"], Scorer()
    seconds = options["seconds"] or (UNWATCHED if quiet else math.inf)
    if quiet:
        refuse_without("--allow-host beside --json", "it where the page is served", "allow_host")
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
            server = _jack_server(stack)
            played = {name: value for name, value in source.items() if name != "name"}
            setup = dataclasses.replace(setup, source=JackTwin(server=server, twin=played))
        begun = [stack.enter_context(sink.ahead()) for sink in setup.sinks]
        as_tuned = _write_tuned(source, stack.enter_context(scratch_folder()) / "sensor.toml")
        summary = run(dataclasses.replace(setup, sinks=(*begun, score), sensor=as_tuned))
    if options["as_json"]:
        facts = {key: source.get(key) for key in ("sensor", "world", "build", "day", "seed", "materials")}
        about = {"simulated": True, "estimator": name, **facts}
        json.dump(about | score.tree() | summary.tree(), sys.stdout)
        echo()
        return
    remarks = _of_the_model(source) if name == LEARNED else _of_the_physics(score)
    echo("", *summary.lines(), "", *score.lines(), "", *remarks)


def _twin(sensor: str, options: dict[str, Any]) -> dict[str, Any]:
    """Return the twin's options: by default a build, a day and objects that the model does not know."""
    given = {key: options[key] for key in ("world", "build", "day")}
    given["materials"] = [*options["material"]]
    chosen = {key: value for key, value in given.items() if value not in (None, [])}
    return {"name": "twin", "sensor": sensor, "seed": options["seed"], **UNSEEN, **chosen}


def _refuse_unlearned(sensor: str) -> None:
    """Raise `InputError` for a sensor whose string is of another length than the model was trained on."""
    own, trained = load_sensor(sensor).string.length, load_sensor(TRAINED_SENSOR).string.length
    if abs(own / trained - 1.0) > LENGTH_TOLERANCE:
        given = f"sensor '{sensor}', whose string is {own:g} m long, for the bundled model"
        remedy = f"monochord demo {shlex.quote(sensor)} --estimator closed_form"
        raise InputError(given, f"{trained:g} m, as it was trained", remedy)


def _jack_server(stack: ExitStack) -> str:
    """Return the name of the JACK server: the default one, or one of our own while the stack is open."""
    from monochord.capture.jack.client import JackClient  # noqa: PLC0415  (loads libjack)
    from monochord.capture.jack.server import JackServer  # noqa: PLC0415

    try:
        JackClient("monochord-probe").close()
    except DeviceError:
        return stack.enter_context(JackServer(period=JACK_PERIOD)).name
    return ""


def _write_tuned(source: dict[str, Any], path: Path) -> str:
    """Write the sensor as tuned, estimated from its untouched sound, and return the file."""
    later = {"start": 3600.0, "position": 0.1, "force": 1.0}
    untouched: dict[str, Any] = {**source, "script": [later], "speed": 0.0}
    twin = SOURCES.build(untouched.pop("name"), untouched)
    path.write_text(tuned([twin], ["twin"], source["sensor"]).toml(), encoding="utf-8")
    return str(path)


def _estimator(name: str) -> dict[str, Any]:
    return {"name": name, "path": BUNDLED} if name == LEARNED else {"name": name, "tension_law": "geometric"}


def _of_the_model(source: dict[str, Any]) -> list[str]:
    """Return what the score is worth: what of this run the model was trained on."""
    first = f"All of this is simulated, sound and training alike; the model is '{BUNDLED}'."
    builds = f"builds {TRAINED_BUILDS[0]} to {TRAINED_BUILDS[-1]}"
    build = source.get("build")
    if source["sensor"] != TRAINED_SENSOR:
        trained = "It was trained on another sensor than this one, and knows nothing of this one."
    elif build in TRAINED_BUILDS:
        trained = f"It was trained on this very build, {build}, though not on these touches."
    else:
        which = "the design itself" if build is None else f"build {build}"
        trained = f"It was trained on {builds} of this sensor, never on {which}."
    objects = f"No object that it was trained on is one of these: {', '.join(source.get('materials', []))}."
    rolling = "Some objects roll. None did in training, and the model takes most of them for sliding."
    return [first, trained, objects, rolling]


def _of_the_physics(score: Scorer) -> list[str]:
    """Return what the score is worth: that the sound is simulated, and how often the estimator abstained."""
    lines = ["All of this is simulated sound. It is made by the twin, not by a sensor."]
    tree = score.tree()
    answered, abstained = tree["answered"] or 0, tree["abstained"] or 0
    if abstained:
        share = abstained / (answered + abstained)
        lines.append(
            f"The closed-form estimator takes a touch for a clamp; in {share:.0%} of the windows the sound"
            " did not fit that, and it abstained."
        )
    return lines
