"""The parts of a demonstration: the options of its twin and estimator, tuning, and a JACK server."""

import shlex
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from monochord.capture.sources import SOURCES
from monochord.core.errors import DeviceError, InputError
from monochord.core.units import Metres
from monochord.live import Scorer
from monochord.live.tuning import tuned
from monochord.physics.sensors import LENGTH_TOLERANCE, load_sensor
from monochord.physics.twin.world import sensor_of

LEARNED, PHYSICS = "model", "closed_form"
BUNDLED = "demo"
"""Name of the bundled model in the demonstration."""
JACK_PERIOD = 256
"""JACK period of a server started here, in frames."""
TRAINED_SENSOR, TRAINED_BUILDS = "prototype", range(10001, 12449)
"""The sensor, and its builds, that this model was trained on (plan builds_3)."""
UNSEEN: Mapping[str, Any] = {
    "world": "plausible",
    "build": 131,
    "day": 51,
    "materials": ["plastic", "wood", "metal_tube", "allen_key"],
}
"""A build, a day and objects outside that plan's training sessions, in its world.

The build is one that no plan uses, and an ordinary one: over a minute of touches 97 % of positions are told,
as on the builds 77, 300, 401 and 150 (94 to 100 %), and forces read 0.08 N high, there 0.38 N low to 0.08 N
high, with the length as a ruler says.
"""
RULER: Metres = 5e-4
"""Step of the scale on which a person reads the string's length."""


def twin_options(sensor: str, seed: int, **given: Any) -> dict[str, Any]:
    """Return the options of the twin; by default, the build, day and objects are outside the training.

    A value of None or an empty list selects the default.

    >>> twin_options("prototype", 1, build=None, day=7, materials=[])["build"]
    131
    """
    chosen = {key: value for key, value in given.items() if value not in (None, [])}
    return {"name": "twin", "sensor": sensor, "seed": seed, **UNSEEN, **chosen}


def refuse_unlearned(sensor: str) -> None:
    """Raise `InputError` for a sensor whose string length differs from the model's training."""
    length, trained = load_sensor(sensor).string.length, load_sensor(TRAINED_SENSOR).string.length
    if abs(length / trained - 1.0) > LENGTH_TOLERANCE:
        given = f"sensor '{sensor}', whose string is {length:g} m long, for the bundled model"
        remedy = f"monochord demo {shlex.quote(sensor)} --estimator closed_form"
        raise InputError(given, f"{trained:g} m, as in its training", remedy)


def jack_server(stack: ExitStack) -> str:
    """Return the name of the JACK server: the default one, or one started here until the stack closes."""
    from monochord.capture.jack.client import JackClient  # noqa: PLC0415  (loads libjack)
    from monochord.capture.jack.server import JackServer  # noqa: PLC0415

    try:
        JackClient("monochord-probe").close()
    except DeviceError:
        return stack.enter_context(JackServer(period=JACK_PERIOD)).name
    return ""


def write_tuned(source: dict[str, Any], path: Path) -> str:
    """Write the tuned sensor, as ``monochord tune --length`` does, and return the file.

    The pitch is estimated from the twin's untouched sound; the length is what a ruler says of this build.
    """
    later = {"start": 3600.0, "position": 0.1, "force": 1.0}
    untouched: dict[str, Any] = {**source, "script": [later], "speed": 0.0}
    twin = SOURCES.build(untouched.pop("name"), untouched)
    length = ruled_length(source)
    path.write_text(tuned([twin], ["twin"], source["sensor"], length=length).toml(), encoding="utf-8")
    return str(path)


def ruled_length(source: Mapping[str, Any]) -> Metres:
    """Return the length of a twin's string as read off a ruler with half millimetres.

    >>> ruled_length(twin_options("prototype", 0))
    0.202
    """
    design, world = load_sensor(source["sensor"]), source.get("world", "ideal")
    built = sensor_of(design, world, build=source.get("build"), day=source.get("day"))
    length = built.measured_length or built.string.length
    return round(round(length / RULER) * RULER, 6)


def estimator_options(name: str) -> dict[str, Any]:
    """Return the options of the estimator of this name.

    >>> estimator_options(PHYSICS)["tension_law"]
    'geometric'
    """
    return {"name": name, "path": BUNDLED} if name == LEARNED else {"name": name, "tension_law": "geometric"}


def remarks_on_model(source: dict[str, Any]) -> list[str]:
    """Return the limits of the score: which parts of this run the model was trained on."""
    first = f"All of this is simulated, sound and training alike; the model is '{BUNDLED}'."
    builds = f"builds {TRAINED_BUILDS[0]} to {TRAINED_BUILDS[-1]}"
    build = source.get("build")
    if source["sensor"] != TRAINED_SENSOR:
        trained = "It was trained on another sensor, not on this one."
    elif build in TRAINED_BUILDS:
        trained = f"It was trained on this very build, {build}, though not on these touches."
    else:
        which = "the design itself" if build is None else f"build {build}"
        trained = f"It was trained on {builds} of this sensor, not on {which}."
    objects = f"None of these objects was in its training data: {', '.join(source.get('materials', []))}."
    return [first, trained, objects]


def remarks_on_physics(score: Scorer) -> list[str]:
    """Return the limits of the score: simulated sound, and the share of abstentions."""
    lines = ["All sound is simulated by the twin, not recorded from a sensor."]
    tree = score.tree()
    answered, abstained = tree["answered"] or 0, tree["abstained"] or 0
    if abstained:
        share = abstained / (answered + abstained)
        lines.append(
            "The closed-form estimator assumes that a touch clamps the string;"
            f" it abstained in the {share:.0%} of windows whose sound did not fit."
        )
    return lines
