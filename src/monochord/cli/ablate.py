"""The verb `ablate`: what each part of a model buys."""

import json
from pathlib import Path
from typing import Any

import click

from monochord.cli._kept_rows import keep
from monochord.cli._options import refuse_without
from monochord.cli._output import echo
from monochord.core.config import load_toml, override
from monochord.core.errors import InputError
from monochord.datasets.build import find_sessions
from monochord.datasets.store import open_dataset
from monochord.evaluation.ablation import Ablation, compared
from monochord.evaluation.ablation import ablate as ablated
from monochord.evaluation.grid import Grid
from monochord.evaluation.grids import load_grid
from monochord.perception.training.configs import config_path
from monochord.perception.training.settings import Settings


@click.command()
@click.argument("grid")
@click.option("--dataset", type=click.Path(), metavar="DIR", help="What monochord build made.")
@click.option("--sessions", multiple=True, metavar="FILES", help="What it was built of; repeatable.")
@click.option("--part", type=click.Choice(["validation", "test"]), help="What is judged on.")
@click.option("--noise", multiple=True, metavar="KIND:DB", help="Judged with noise too; repeatable.")
@click.option("--set", "assignments", multiple=True, metavar="A.B=C", help="Any value of the grid.")
@click.option("--only", multiple=True, metavar="NAME", help="One variation; repeatable.")
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("ablation"), show_default=True, help="Folder."
)
@click.option(
    "--rows", type=click.Path(path_type=Path), metavar="FILE", help="Keep the paper's rows in FILE."
)
@click.option(
    "--workers", type=click.IntRange(min=1), default=1, show_default=True, metavar="N", help="At a time."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def ablate(
    grid: str,
    *,
    out: Path,
    rows: Path | None,
    only: tuple[str, ...],
    workers: int,
    assignments: tuple[str, ...],
    as_json: bool,
    **differs: Any,
) -> None:
    """Train and evaluate every variation of GRID, a preset's name or a TOML file, and compare them.

    Options stand in place of what the grid says. After an interruption, or with more variations, the same
    command goes on. A variation that fails is told, and the others go on; then the status is 1.

    \b
    monochord ablate parts --dataset dataset --sessions sessions --out ablation
    monochord ablate features --dataset dataset --sessions sessions --rows rows.json --workers 2
    """  # noqa: D301
    tree = {name: value for name, value in differs.items() if value}
    chosen = load_grid(grid, tree, assignments)
    chosen = chosen.only(only) if only else chosen
    _refuse_impossible(chosen)
    if not any(variation.is_built and not variation.sessions for variation in chosen.compared.values()):
        refuse_without("--sessions", "for variations with windows of their own", "sessions")
    found = ablated(chosen, out, _tell, workers=workers)
    if rows is not None and found.rows:
        keep(rows, [row for each in found.rows.values() for row in each])
    echo(*([_json(chosen, found)] if as_json else _lines(chosen, compared(found.scores))))
    found.refuse_failed()


def _refuse_impossible(grid: Grid) -> None:
    """Refuse settings and sessions that no variation can be made of, before all the others are made."""
    config_path(grid.config)
    open_dataset(grid.dataset)
    for name, variation in grid.compared.items():
        try:
            if not variation.estimator:
                config = load_toml(config_path(variation.config or grid.config))
                Settings.read(override(config, [*grid.set, *variation.set])).resolved()
            if variation.is_built:
                find_sessions(variation.sessions or grid.sessions)
        except InputError as error:
            raise InputError(f"variation {name}: {error.given}", error.allowed, error.remedy) from error


def _tell(name: str, what: str) -> None:
    echo(f"{name}: {what}", err=True)


def _json(grid: Grid, found: Ablation) -> str:
    tree = {"title": grid.title, "part": grid.part, "rows": compared(found.scores), "failed": found.failed}
    return json.dumps(tree, allow_nan=False)


def _lines(grid: Grid, rows: list[dict[str, Any]]) -> list[str]:
    wide = max([len(row["variation"]) for row in rows] + [9])
    kind = ", simulated" if any(row["simulated"] for row in rows) else ""
    heads = ("windows", "position", "<= 5 mm", "force", "<= 0.2 N", "contact", "slip area")
    lines = [f"{grid.title or grid.config}{kind}, on {grid.part}"]
    lines.append(f"  {'variation':<{wide}}" + "".join(f"{name:>11}" for name in heads))
    return lines + [
        f"  {row['variation']:<{wide}}" + "".join(f"{text:>11}" for text in _row(row)) for row in rows
    ]


def _row(row: dict[str, Any]) -> list[str]:
    return [
        str(row["windows"]),
        _number(row["position_mae"], 1e3, " mm"),
        _share(row["position_within"]),
        _number(row["force_mae"], 1.0, " N"),
        _share(row["force_within"]),
        _share(row["contact_accuracy"]),
        _number(row["slip_area"], 1.0, ""),
    ]


def _number(value: float | None, factor: float, unit: str) -> str:
    return "-" if value is None else f"{factor * value:.3g}{unit}"


def _share(value: float | None) -> str:
    return "-" if value is None else f"{100.0 * value:.1f} %"
