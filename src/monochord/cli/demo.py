"""The live view with no hardware: a simulated string, the truth beside the estimate."""

import dataclasses
import json
import sys

import click

from monochord.cli._options import amount
from monochord.live import Score, Settings, run


@click.command()
@click.option("--seconds", type=amount, default=20.0, show_default=True, metavar="S", help="How long.")
@click.option("--json", "as_json", is_flag=True, help="Print only the result, as one JSON object.")
def demo(seconds: float, as_json: bool) -> None:  # noqa: FBT001
    """Touch a simulated string in real time and see it located, truth beside estimate.

    The split-string simulation takes the place of the two contact microphones; windows, estimator and view
    are those of `monochord live`. Control-C or SIGTERM ends it with its result.
    """
    settings = Settings.read(
        {
            "source": {"name": "split_string"},
            "estimator": {"name": "closed_form"},
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
    click.echo("\n".join(["", *summary.lines(), "", *score.lines(), "All of this is simulated sound."]))
