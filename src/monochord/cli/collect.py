"""The command `collect`: the sessions of a plan, simulated as fast as the machine allows."""

import json
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click

from monochord.cli._options import completes, set_option, worker_options
from monochord.cli._output import echo
from monochord.core.errors import InputError
from monochord.core.ownership import sole_use
from monochord.lab.collection import checksum, chosen, made_folder
from monochord.lab.collection import collect as carry_out
from monochord.lab.offline import CollectedSession, WindowCounts
from monochord.lab.plan import Assignment
from monochord.lab.plans import load_plan, plan_names
from monochord.lab.schedule import schedule


@click.command()
@click.argument("plan", **completes(plan_names))
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    required=True,
    help="Folder for the sessions; made if missing.",
)
@worker_options
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Random seed.")
@set_option("monochord list settings collect")
@click.option("--only", default="", metavar="NAME", help="Collect only this session or group of the plan.")
@click.option("--real-time", is_flag=True, help="Play and record in real time, through JACK, UDP and DDS.")
@click.option("--server", default="", metavar="NAME", help="Name of the JACK server for --real-time.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def collect(
    plan: str, *, out: Path, seed: int, assignments: Sequence[str], only: str, as_json: bool, **how: Any
) -> None:
    """Simulate the recording sessions of a plan.

    PLAN is a plan of 'monochord list plans', or a TOML file. A simulated robot touches the virtual sensor
    while microphones, force and pose are recorded. Sessions that exist are kept: after an interruption, run
    the same command again.

    \b
    monochord collect quick --out sessions
    monochord collect small --out sessions-one-driver --set sensor=prototype_one_driver
    """  # noqa: D301
    settings = load_plan(plan, assignments)
    sessions = chosen(settings, seed=seed, only=only)
    start = time.monotonic()
    collected = sorted(_collected(sessions, out, **how), key=lambda one: one.name)
    result = {"plan": settings.name, "seed": seed, "out": str(out), **_totals(collected)}
    result["wall"] = time.monotonic() - start
    if as_json:
        echo(json.dumps({**result, "sessions": [_entry(one) for one in collected]}))
        return
    for one in collected:
        echo(_line(one))
    echo(*_summary(result))


def _collected(
    sessions: Sequence[Assignment],
    out: Path,
    *,
    workers: int | None,
    cluster: str,
    real_time: bool,
    server: str,
) -> Iterator[CollectedSession]:
    """Yield the results as the sessions are finished, and show the progress."""
    if not real_time:
        if server:
            raise InputError("--server", "with --real-time", "offline there is no server")
        with closing(carry_out(sessions, out, workers=workers, cluster=cluster)) as results:
            yield from _with_progress(results, sessions)
        return
    if workers or cluster:
        raise InputError("--real-time with --workers or --cluster", "one of them", "real time takes its time")
    from rich.console import Console  # noqa: PLC0415

    from monochord.capture.recording.view import viewed  # noqa: PLC0415
    from monochord.lab.real_time import play  # noqa: PLC0415

    with sole_use(made_folder(out)):
        for session in sessions:
            path = out / f"{session.name}.mcap"
            with viewed(path, Console(file=sys.stderr, highlight=False)) as view:
                yield play(session, out, server=server, show=view.show)


def _with_progress(
    results: Iterator[CollectedSession], sessions: Sequence[Assignment]
) -> Iterator[CollectedSession]:
    """Yield the results, with a bar over the seconds of audio on a terminal."""
    if not sys.stderr.isatty():
        yield from results
        return
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn  # noqa: PLC0415

    seconds = {session.name: schedule(session).motion.end for session in sessions}
    columns = (
        TextColumn("{task.fields[done]} of {task.fields[all]} sessions"),
        BarColumn(),
        TextColumn("{task.completed:.0f} of {task.total:.0f} s of audio"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True)) as progress:
        bar = progress.add_task("", total=sum(seconds.values()), done=0, all=len(sessions))
        for count, result in enumerate(results, start=1):
            progress.update(bar, advance=seconds[result.name], done=count)
            yield result


def _totals(collected: Sequence[CollectedSession]) -> dict[str, Any]:
    windows = sum((one.windows for one in collected), WindowCounts())
    return {
        "simulated": True,
        "count": len(collected),
        "kept": sum(one.kept for one in collected),
        "seconds": sum(one.seconds for one in collected),
        "windows": asdict(windows),
        "size": sum(one.size for one in collected),
        "sha256": checksum(collected),
    }


def _entry(one: CollectedSession) -> dict[str, Any]:
    entry = {**asdict(one), "path": str(one.path)}
    return {**entry, "sha256": entry.pop("checksum")}


def _line(one: CollectedSession) -> str:
    counts = one.windows
    kinds = f"{counts.static:4} static {counts.slip:4} slip {counts.clear:4} clear"
    kept = "  kept" if one.kept else ""
    size = f"{one.size / 1e6:5.1f} MB"
    return f"  {one.name:<20} {one.seconds:6.1f} s  {kinds}  {size}  {one.checksum[:16]}{kept}"


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
        f"SHA-256 of all files {result['sha256']}",
        f"made in {result['wall']:.0f} s, {pace:.0f} times real time",
    ]
