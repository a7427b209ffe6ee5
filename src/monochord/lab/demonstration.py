"""The parts of a demonstration: the options of its twin and estimator, tuning, and a JACK server."""

import shlex
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from monochord.capture.sources import SOURCES
from monochord.core.errors import DeviceError, InputError
from monochord.live import Scorer
from monochord.live.tuning import tuned
from monochord.physics.sensors import LENGTH_TOLERANCE, load_sensor

LEARNED, PHYSICS = "model", "closed_form"
BUNDLED = "demo"
"""Name of the bundled model in the demonstration."""
JACK_PERIOD = 256
"""JACK period of a server started here, in frames."""
TRAINED_SENSOR, TRAINED_BUILDS = "prototype", range(6001, 6301)
"""The sensor, and its builds, that this model was trained on (plan builds_2)."""
UNSEEN: Mapping[str, Any] = {
    "world": "plausible_1",
    "build": 131,
    "day": 51,
    "materials": ["plastic", "wood", "metal_tube", "allen_key"],
}
"""A build, a day and objects outside that plan's training sessions."""


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
    own, trained = load_sensor(sensor).string.length, load_sensor(TRAINED_SENSOR).string.length
    if abs(own / trained - 1.0) > LENGTH_TOLERANCE:
        given = f"sensor '{sensor}', whose string is {own:g} m long, for the bundled model"
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
    """Write the tuned sensor, estimated from its untouched sound, and return the file."""
    later = {"start": 3600.0, "position": 0.1, "force": 1.0}
    untouched: dict[str, Any] = {**source, "script": [later], "speed": 0.0}
    twin = SOURCES.build(untouched.pop("name"), untouched)
    path.write_text(tuned([twin], ["twin"], source["sensor"]).toml(), encoding="utf-8")
    return str(path)


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
    rolling = "Some objects roll. None did in training, and the model mistakes most of them for sliding."
    return [first, trained, objects, rolling]


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
