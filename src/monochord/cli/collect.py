"""The command `collect`: simulates the sessions of a plan as fast as the machine allows."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from monochord.cli._options import completes, set_option, worker_options
from monochord.cli._output import echo
from monochord.cli._signature import options_of
from monochord.front.collect import collect as carry_out
from monochord.lab.plans import plan_names


@click.command()
@click.argument("plan", **completes(plan_names))
@options_of(carry_out, "out", required=True)
@worker_options
@options_of(carry_out, "seed")
@set_option("monochord list settings collect")
@options_of(carry_out, "only", "server", metavar="NAME")
@options_of(carry_out, "real_time")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def collect(plan: str, *, out: Path, assignments: Sequence[str], as_json: bool, **options: Any) -> None:
    """Simulate the recording sessions of a plan.

    PLAN is a plan of 'monochord list plans', or a TOML file. A simulated robot touches the virtual sensor
    while microphones, force and pose are recorded. Sessions that exist are kept: after an interruption, run
    the same command again.

    \b
    monochord collect quick --out sessions
    monochord collect small --out sessions-one-driver --set sensor=prototype_one_driver
    """  # noqa: D301
    result = carry_out(plan, out, settings=assignments, **options)
    echo(*([json.dumps(result.tree())] if as_json else result.lines()))
