"""The live view with no hardware: the twin, the truth beside the estimate."""

import dataclasses
import json
import sys
from contextlib import nullcontext
from typing import Any

import click

from monochord.cli._options import amount
from monochord.cli._output import echo
from monochord.core.compilation import compilation_shown
from monochord.core.errors import InputError, did_you_mean
from monochord.live import Score, Settings, run

LEARNED, PHYSICS = "model", "closed_form"
BUNDLED = "demo"
"""Name of the model that comes along."""
HEARD_BUILD, HEARD_DAYS, HEARD_STUFF = 1, range(1, 8), "plastic"
"""What it learned from, the plan paper: which sensor, on which days, touched by what."""
NEW_DAY = 10
"""One that no session of that plan is of."""


@click.command()
@click.argument("sensor", default="prototype")
@click.option("--seconds", type=amount, default=20.0, show_default=True, metavar="S", help="How long.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the touches.")
@click.option(
    "--estimator",
    default=LEARNED,
    show_default=True,
    metavar="NAME",
    help=f"{LEARNED}, what was learned, or {PHYSICS}.",
)
@click.option("--build", type=click.IntRange(min=0), metavar="N", help="Another sensor of the same design.")
@click.option("--day", type=click.IntRange(min=0), metavar="N", help="Another day.")
@click.option("--material", multiple=True, metavar="NAME", help="What touches it; repeatable.")
@click.option("--json", "as_json", is_flag=True, help="Print only the result, as one JSON object.")
def demo(sensor: str, **options: Any) -> None:
    """Touch a simulated SENSOR in real time and see the touch told, truth beside estimate.

    The twin takes the place of string, drivers, objects and contact microphones; windows, estimator and view
    are those of `monochord live`. Objects press, slide and roll at random, and a small model that comes
    along tells contact, place, force and slip. Control-C or SIGTERM ends it with its score.

    \b
    monochord demo --material allen_key
    monochord demo --estimator closed_form
    """  # noqa: D301
    name = options["estimator"].replace("-", "_")
    if name not in (LEARNED, PHYSICS):
        given = f"estimator '{options['estimator']}' in the demonstration"
        raise InputError(given, f"{LEARNED} or {PHYSICS}", did_you_mean(name, (LEARNED, PHYSICS)))
    source, estimator = _twin(sensor, options, name), _told(name)
    sinks = {} if options["as_json"] else {"terminal": {}}
    settings = Settings.read(
        {"source": source, "estimator": estimator, "sinks": sinks, "seconds": options["seconds"]}
    )
    session, score = settings.session(), Score()
    with nullcontext() if options["as_json"] else compilation_shown():
        summary = run(dataclasses.replace(session, sinks=(*session.sinks, score)))
    if options["as_json"]:
        facts = {key: source.get(key) for key in ("sensor", "build", "day", "seed", "materials")}
        about = {"simulated": True, "estimator": name, **facts}
        json.dump(about | score.tree() | summary.tree(), sys.stdout)
        echo()
        return
    words = _of_the_learned(source) if name == LEARNED else _of_the_physics(score)
    echo("", *summary.lines(), "", *score.lines(), "", *words)


def _twin(sensor: str, options: dict[str, Any], name: str) -> dict[str, Any]:
    """Return the twin's options: what was learned is shown on its own sensor, on a day that is new to it."""
    source = {"name": "twin", "sensor": sensor, "seed": options["seed"]}
    usual: dict[str, Any] = {}
    if name == LEARNED:
        usual = {"build": HEARD_BUILD, "day": NEW_DAY, "materials": [HEARD_STUFF]}
    asked = {"build": options["build"], "day": options["day"], "materials": [*options["material"]]}
    return source | usual | {key: value for key, value in asked.items() if value not in (None, [])}


def _told(name: str) -> dict[str, Any]:
    return {"name": name, "path": BUNDLED} if name == LEARNED else {"name": name, "tension_law": "geometric"}


def _of_the_learned(source: dict[str, Any]) -> list[str]:
    """Say what the score is worth: what of this had been heard in training."""
    day, strange = source["day"], [stuff for stuff in source["materials"] if stuff != HEARD_STUFF]
    if (source["sensor"], source["build"]) != ("prototype", HEARD_BUILD):
        heard = "It learned from another sensor than this one, and was told nothing of this one."
    elif day in HEARD_DAYS:
        heard = f"It learned from this very sensor on this very day, {day}, though not from these touches."
    else:
        heard = (
            f"It learned from this sensor on days {HEARD_DAYS[0]} to {HEARD_DAYS[-1]}, never on day {day}."
        )
    touched = f"Of what touches it here, it never met {', '.join(strange)}." if strange else ""
    first = f"All of this is simulated, sound and training alike; the model is '{BUNDLED}'."
    rolling = "Some objects roll. None did where it learned, and it takes most of them for sliding."
    return [line for line in (first, heard, touched, rolling) if line]


def _of_the_physics(score: Score) -> list[str]:
    """Say what the result is worth: whose sound it is, and where the estimator had nothing to say."""
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
