"""The command `bench`: benchmark results beside their baselines, and the machine they were measured on."""

import json
import platform
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

import click
import numpy as np

from monochord.benchmarks import BENCHMARKS
from monochord.benchmarks.base import Row
from monochord.cli._moved import refuse_moved
from monochord.cli._options import completes, set_option
from monochord.cli._output import echo
from monochord.core.config import override
from monochord.core.cores import available_cores
from monochord.core.errors import InputError, MonochordError


@click.command()
@click.argument("name", required=False, **completes(BENCHMARKS.names))
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object per row.")
@set_option("monochord list benchmarks")
def bench(name: str | None, as_json: bool, assignments: tuple[str, ...]) -> None:  # noqa: FBT001
    """Run the benchmarks and print each result beside its baseline.

    NAME is a benchmark of 'monochord list benchmarks'; without it, all of them run.

    \b
    monochord bench recording
    monochord bench live --json
    """  # noqa: D301
    if assignments and not name:
        raise InputError(f"--set {assignments[0]} for all benchmarks", "one NAME with --set")
    refuse_moved("benchmark", name, BENCHMARKS.names())
    # Whatever is refused is refused before anything is measured.
    chosen = {
        each: BENCHMARKS.build(each, override({}, assignments), where="")
        for each in ([name] if name else BENCHMARKS.names())
    }
    echo(_machine(), err=as_json)
    missing: list[MonochordError] = []
    for each, benchmark in chosen.items():
        if not as_json:
            echo("", each)
        try:
            for row in benchmark.run():
                echo(json.dumps(_record(each, row)) if as_json else _line(row))
        except MonochordError as error:  # what it needs is not on this machine
            missing.append(error)
            if len(missing) == len(chosen):
                raise
            echo(f"{each}  skipped: {error}", err=True)


def _record(benchmark: str, row: Row) -> dict[str, str | float | None]:
    return {"benchmark": benchmark, **asdict(row), "ratio": row.ratio}


def _line(row: Row) -> str:
    line = f"  {row.name:<36}{_number(float(row.value)):>10} {'' if row.unit == '1' else row.unit}"
    if row.baseline is None or row.baseline_value is None:
        return line.rstrip()
    ratio = "" if row.ratio is None else f"{row.ratio:.3g} times "
    return f"{line:<62}{ratio}{row.baseline} ({_number(float(row.baseline_value))})"


def _number(value: float) -> str:
    """Return counts in full and measurements to four digits."""
    return f"{value:.0f}" if value.is_integer() or abs(value) >= 1e4 else f"{value:.4g}"


def _machine() -> str:
    return (
        f"machine: {_processor()}, {available_cores()} cores, {platform.system()} {platform.release()}, "
        f"Python {platform.python_version()}, NumPy {np.__version__}"
    )


def _processor() -> str:
    return next(_named_processors(), platform.processor() or platform.machine())


def _named_processors() -> Iterator[str]:
    table = Path("/proc/cpuinfo")
    for line in table.read_text(encoding="utf-8-sig").splitlines() if table.exists() else ():
        key, _, value = line.partition(":")
        if key.strip() == "model name":
            yield value.strip()
