"""The live view with no hardware: the twin, the truth beside the estimate."""

import dataclasses
import json
import sys

import click

from monochord.cli._options import amount
from monochord.live import Score, Settings, run


@click.command()
@click.argument("sensor", default="prototype")
@click.option("--seconds", type=amount, default=20.0, show_default=True, metavar="S", help="How long.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of the touches.")
@click.option("--json", "as_json", is_flag=True, help="Print only the result, as one JSON object.")
def demo(sensor: str, seconds: float, seed: int, as_json: bool) -> None:  # noqa: FBT001
    """Touch a simulated SENSOR in real time and see the touch located, truth beside estimate.

    The twin takes the place of string, drivers, objects and contact microphones; windows, estimator and view
    are those of `monochord live`. The objects press, slide and roll at random. Control-C or SIGTERM ends it
    with its result.
    """
    settings = Settings.read(
        {
            "source": {"name": "twin", "sensor": sensor, "seed": seed},
            "estimator": {"name": "closed_form", "tension_law": "geometric"},
            "sinks": {} if as_json else {"terminal": {}},
            "seconds": seconds,
        }
    )
    session, score = settings.session(), Score()
    summary = run(dataclasses.replace(session, sinks=(*session.sinks, score)))
    if as_json:
        json.dump(score.tree() | summary.tree(), sys.stdout)
        click.echo()
        return
    click.echo("\n".join(["", *summary.lines(), "", *score.lines(), *_last_words(score)]))


def _last_words(score: Score) -> list[str]:
    """Say what the result is worth: whose sound it is, and where the estimator had nothing to say."""
    lines = ["All of this is simulated sound. It is made by the twin, not by a sensor."]
    asked = len(score.errors) + score.abstained
    if asked and score.abstained:
        share = score.abstained / asked
        lines.append(
            f"The closed-form estimator takes a touch for a clamp; in {share:.0%} of the windows the sound"
            " did not fit that, and it abstained."
        )
    return lines
