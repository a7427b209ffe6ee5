"""The verb `ablate`: what each part of a perceiver buys."""

import json
from pathlib import Path
from typing import Any

import click

from monochord.evaluation.ablation import Grid, compared
from monochord.evaluation.ablation import ablate as ablated


@click.command()
@click.argument("grid", type=click.Path(path_type=Path))
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("ablation"), show_default=True, help="Folder."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def ablate(grid: Path, *, out: Path, as_json: bool) -> None:
    """Train and evaluate every variation of GRID, a TOML file, and compare them.

    After an interruption, or with more variations, the same command goes on.

    \b
    monochord ablate grid.toml --out ablation
    """  # noqa: D301
    chosen = Grid.read(grid)
    scores = ablated(chosen, out, lambda name, what: click.echo(f"{name}: {what}", err=True))
    rows = compared(scores)
    if as_json:
        click.echo(json.dumps({"title": chosen.title, "part": chosen.part, "rows": rows}, allow_nan=False))
    else:
        click.echo("\n".join(_lines(chosen, rows)))


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
