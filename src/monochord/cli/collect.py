"""The verb `collect`: a plan carried out on the virtual bench, as fast as the machine allows."""

import json
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from monochord.cli._output import echo
from monochord.core.errors import InputError
from monochord.core.ownership import sole_use
from monochord.lab.bench import Outcome
from monochord.lab.collection import checksum, chosen, made_folder
from monochord.lab.collection import collect as carry_out
from monochord.lab.course import course
from monochord.lab.plan import Assignment
from monochord.lab.plans import load_plan
from monochord.lab.tally import Tally


@click.command()
@click.argument("plan")
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder for the sessions.")
@click.option("--workers", type=click.IntRange(min=1), metavar="N", help="Processes.  [default: one a core]")
@click.option("--cluster", default="", metavar="ADDRESS", help="A running dask scheduler to work on.")
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Of all that is drawn."
)
@click.option("--set", "assignments", multiple=True, metavar="A=B", help="What differs from the plan.")
@click.option("--only", default="", metavar="NAME", help="One session or one group of the plan.")
@click.option("--real-time", is_flag=True, help="Through JACK, UDP and DDS, each part a process.")
@click.option("--server", default="", metavar="NAME", help="The JACK server, with --real-time.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def collect(
    plan: str, *, out: Path, seed: int, assignments: Sequence[str], only: str, as_json: bool, **how: Any
) -> None:
    """Make the sessions of PLAN, a preset's name or a TOML file, on the virtual bench.

    Sessions that are there already are kept: after an interruption the same command goes on.

    \b
    monochord collect small --out sessions
    monochord collect small --out sessions-one-driver --set sensor=prototype_one_driver
    """  # noqa: D301
    told = load_plan(plan, assignments)
    sessions = chosen(told, seed=seed, only=only)
    start = time.monotonic()
    done = sorted(_made(sessions, out, **how), key=lambda outcome: outcome.name)
    result = {"plan": told.name, "seed": seed, "out": str(out), **_totals(done)}
    result["wall"] = time.monotonic() - start
    if as_json:
        echo(json.dumps({**result, "sessions": [_entry(outcome) for outcome in done]}))
        return
    for outcome in done:
        echo(_line(outcome))
    echo(*_summary(result))


def _made(
    sessions: Sequence[Assignment],
    out: Path,
    *,
    workers: int | None,
    cluster: str,
    real_time: bool,
    server: str,
) -> Iterator[Outcome]:
    """Yield what becomes of the sessions, as they are done, with something to look at meanwhile."""
    if not real_time:
        if workers and cluster:
            raise InputError("--workers beside --cluster", "one of both", "a cluster has its own workers")
        if server:
            raise InputError("--server", "with --real-time", "offline there is no server")
        with closing(carry_out(sessions, out, workers=workers, cluster=cluster)) as outcomes:
            yield from _watched(outcomes, sessions)
        return
    if workers or cluster:
        raise InputError("--real-time with --workers or --cluster", "one of them", "real time takes its time")
    from rich.console import Console  # noqa: PLC0415

    from monochord.capture.recording.view import viewed  # noqa: PLC0415
    from monochord.lab.stage import Stage, play  # noqa: PLC0415

    with sole_use(made_folder(out)):
        for session in sessions:
            path = out / f"{session.name}.mcap"
            with viewed(path, Console(file=sys.stderr, highlight=False)) as view:
                yield play(session, out, Stage(server=server), view.show)


def _watched(outcomes: Iterator[Outcome], sessions: Sequence[Assignment]) -> Iterator[Outcome]:
    """Yield the outcomes, with a bar over the seconds of audio where there is a terminal to show it."""
    if not sys.stderr.isatty():
        yield from outcomes
        return
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn  # noqa: PLC0415

    seconds = {session.name: course(session).motion.end for session in sessions}
    columns = (
        TextColumn("{task.fields[done]} of {task.fields[all]} sessions"),
        BarColumn(),
        TextColumn("{task.completed:.0f} of {task.total:.0f} s of audio"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        bar = progress.add_task("", total=sum(seconds.values()), done=0, all=len(sessions))
        for count, outcome in enumerate(outcomes, start=1):
            progress.update(bar, advance=seconds[outcome.name], done=count)
            yield outcome


def _totals(done: Sequence[Outcome]) -> dict[str, Any]:
    counted = sum((outcome.tally for outcome in done), Tally())
    return {
        "simulated": True,
        "count": len(done),
        "kept": sum(outcome.kept for outcome in done),
        "seconds": sum(outcome.seconds for outcome in done),
        "windows": asdict(counted),
        "size": sum(outcome.size for outcome in done),
        "checksum": checksum(done),
    }


def _entry(outcome: Outcome) -> dict[str, Any]:
    return {**asdict(outcome), "path": str(outcome.path)}


def _line(outcome: Outcome) -> str:
    found = outcome.tally
    kinds = f"{found.static:4} static {found.slip:4} slip {found.clear:4} clear"
    kept = "  kept" if outcome.kept else ""
    size = f"{outcome.size / 1e6:5.1f} MB"
    return f"  {outcome.name:<20} {outcome.seconds:6.1f} s  {kinds}  {size}  {outcome.checksum[:16]}{kept}"


def _summary(result: dict[str, Any]) -> list[str]:
    windows = result["windows"]
    kinds = (
        f"{windows['static']} static ({windows['settled']} settled), {windows['slip']} slipping, "
        f"{windows['clear']} without contact, {windows['transition']} transitions"
    )
    count = f"{result['count']} session{'' if result['count'] == 1 else 's'} ({result['kept']} kept)"
    minutes, size = f"{result['seconds'] / 60:.1f}", result["size"] / 1e9
    pace = result["seconds"] / max(result["wall"], 1e-9)
    return [
        f"{result['plan']}, simulated: {count}, {minutes} min, {size:.3f} GB in {result['out']}",
        f"windows of 0.1 s: {kinds}",
        f"checksum {result['checksum']}",
        f"made in {result['wall']:.0f} s, {pace:.0f} times real time",
    ]
