"""The live view with no hardware: the twin, the truth beside the estimate."""

import dataclasses
import json
import sys
from contextlib import nullcontext
from typing import Any

import click

from monochord.cli._options import amount, completes
from monochord.cli._output import echo
from monochord.core.compilation import compilation_shown
from monochord.core.errors import InputError, did_you_mean
from monochord.live import LiveSettings, Scorer, run
from monochord.physics.materials import material_names
from monochord.physics.sensors import sensor_names

LEARNED, PHYSICS = "model", "closed_form"
BUNDLED = "demo"
"""Name of the bundled model that the demonstration shows."""
TRAINED_BUILD, TRAINED_DAYS, TRAINED_MATERIAL = 1, range(1, 8), "plastic"
"""The sensor, days and material that this model was trained on, by the plan paper."""
UNSEEN_DAY = 10
"""A day that no session of that plan is of."""


@click.command()
@click.argument("sensor", default="prototype", **completes(sensor_names))
@click.option("--seconds", type=amount, default=20.0, show_default=True, metavar="S", help="How long.")
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Random seed of the touches."
)
@click.option(
    "--estimator",
    default=LEARNED,
    show_default=True,
    metavar="NAME",
    help=f"{LEARNED}: the bundled trained one; {PHYSICS}: physics alone.",
    **completes(lambda: (LEARNED, PHYSICS)),
)
@click.option("--build", type=click.IntRange(min=0), metavar="N", help="Another sensor of the same design.")
@click.option("--day", type=click.IntRange(min=0), metavar="N", help="Another day of the same sensor.")
@click.option(
    "--material",
    multiple=True,
    metavar="NAME",
    help="Material of what touches it: 'monochord list materials'; repeatable.",
    **completes(material_names),
)
@click.option("--json", "as_json", is_flag=True, help="Print only the result, as one JSON object.")
def demo(sensor: str, **options: Any) -> None:
    """Touch a simulated SENSOR in real time and show estimates beside the truth.

    The twin, a simulation of the sensor, takes the place of string, drivers, objects and contact microphones;
    windows, estimator and view are those of `monochord live`. Objects press, slide and roll at random, and a
    small bundled model estimates contact, position, normal force and slip. Control-C or SIGTERM ends it with
    its score.

    \b
    monochord demo --material allen_key
    monochord demo --estimator closed_form
    """  # noqa: D301
    name = options["estimator"].replace("-", "_")
    if name not in (LEARNED, PHYSICS):
        given = f"estimator '{options['estimator']}' in the demonstration"
        raise InputError(given, f"{LEARNED} or {PHYSICS}", did_you_mean(name, (LEARNED, PHYSICS)))
    source, estimator = _twin(sensor, options, name), _estimator(name)
    sinks = {} if options["as_json"] else {"terminal": {}}
    settings = LiveSettings.read(
        {"source": source, "estimator": estimator, "sinks": sinks, "seconds": options["seconds"]}
    )
    setup, score = settings.build(), Scorer()
    with nullcontext() if options["as_json"] else compilation_shown():
        summary = run(dataclasses.replace(setup, sinks=(*setup.sinks, score)))
    if options["as_json"]:
        facts = {key: source.get(key) for key in ("sensor", "build", "day", "seed", "materials")}
        about = {"simulated": True, "estimator": name, **facts}
        json.dump(about | score.tree() | summary.tree(), sys.stdout)
        echo()
        return
    remarks = _of_the_model(source) if name == LEARNED else _of_the_physics(score)
    echo("", *summary.lines(), "", *score.lines(), "", *remarks)


def _twin(sensor: str, options: dict[str, Any], name: str) -> dict[str, Any]:
    """Return the twin's options: the model is shown on the sensor it was trained on, on another day."""
    source = {"name": "twin", "sensor": sensor, "seed": options["seed"]}
    defaults: dict[str, Any] = {}
    if name == LEARNED:
        defaults = {"build": TRAINED_BUILD, "day": UNSEEN_DAY, "materials": [TRAINED_MATERIAL]}
    given = {"build": options["build"], "day": options["day"], "materials": [*options["material"]]}
    return source | defaults | {key: value for key, value in given.items() if value not in (None, [])}


def _estimator(name: str) -> dict[str, Any]:
    return {"name": name, "path": BUNDLED} if name == LEARNED else {"name": name, "tension_law": "geometric"}


def _of_the_model(source: dict[str, Any]) -> list[str]:
    """Return what the score is worth: what of this run the model was trained on."""
    day, unseen = source["day"], [name for name in source["materials"] if name != TRAINED_MATERIAL]
    if (source["sensor"], source["build"]) != ("prototype", TRAINED_BUILD):
        trained = "It was trained on another sensor than this one, and knows nothing of this one."
    elif day in TRAINED_DAYS:
        trained = f"It was trained on this very sensor on this very day, {day}, though not on these touches."
    else:
        days = f"days {TRAINED_DAYS[0]} to {TRAINED_DAYS[-1]}"
        trained = f"It was trained on this sensor on {days}, never on day {day}."
    materials = f"It was not trained on {', '.join(unseen)}." if unseen else ""
    first = f"All of this is simulated, sound and training alike; the model is '{BUNDLED}'."
    rolling = "Some objects roll. None did in training, and the model takes most of them for sliding."
    return [line for line in (first, trained, materials, rolling) if line]


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
