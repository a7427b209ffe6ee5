"""The command `ablate`: what each part of a model contributes."""

import json
from pathlib import Path
from typing import Any

import click

from monochord.cli._drawings import drawings
from monochord.cli._options import refuse_without, set_option
from monochord.cli._output import echo
from monochord.cli.evaluate import music
from monochord.core.config import load_toml, override
from monochord.core.errors import InputError
from monochord.datasets.build import find_sessions
from monochord.datasets.store import open_dataset
from monochord.evaluation.ablation import Ablation, compared
from monochord.evaluation.ablation import ablate as run_ablation
from monochord.evaluation.grids import Grid, load_grid
from monochord.evaluation.paper import keep_rows
from monochord.perception.training.configs import config_path
from monochord.perception.training.settings import TrainingSettings


@click.command()
@click.argument("grid")
@click.option("--dataset", type=click.Path(), metavar="DIR", help="Dataset of monochord build.")
@click.option(
    "--sessions", multiple=True, metavar="FILES", help="Sessions that it was built from; repeatable."
)
@click.option("--part", type=click.Choice(["validation", "test"]), help="Part that is evaluated.")
@click.option("--noise", multiple=True, metavar="KIND:DB", help="Also evaluate with noise; repeatable.")
@set_option("monochord list settings ablate")
@click.option("--only", multiple=True, metavar="NAME", help="Only this variation; repeatable.")
@click.option(
    "--out", type=click.Path(path_type=Path), default=Path("ablation"), show_default=True, help="Folder."
)
@click.option(
    "--rows", type=click.Path(path_type=Path), metavar="FILE", help="Keep rows of the paper's table in FILE."
)
@click.option(
    "--workers",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    metavar="N",
    help="Variations at a time.",
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

    Options replace values of the grid. After an interruption, or with more variations, the same command goes
    on. A variation that fails is reported, and the others go on; then the exit status is 1.

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
    outcome = run_ablation(chosen, out, _report, workers=workers, music=music, draw=drawings)
    if rows is not None and outcome.rows:
        keep_rows(rows, [row for each in outcome.rows.values() for row in each])
    echo(*([_json(chosen, outcome)] if as_json else _lines(chosen, compared(outcome.scores))))
    outcome.refuse_failed()


def _refuse_impossible(grid: Grid) -> None:
    """Refuse settings and sessions that cannot be used before any variation is begun."""
    config_path(grid.config)
    open_dataset(grid.dataset)
    for name, variation in grid.compared.items():
        try:
            if not variation.estimator:
                config = load_toml(config_path(variation.config or grid.config))
                TrainingSettings.read(override(config, [*grid.set, *variation.set])).resolved()
            if variation.is_built:
                find_sessions(variation.sessions or grid.sessions)
        except InputError as error:
            raise InputError(f"variation {name}: {error.given}", error.allowed, error.remedy) from error


def _report(name: str, what: str) -> None:
    echo(f"{name}: {what}", err=True)


def _json(grid: Grid, outcome: Ablation) -> str:
    tree = {
        "title": grid.title,
        "part": grid.part,
        "rows": compared(outcome.scores),
        "failed": outcome.failed,
    }
    return json.dumps(tree, allow_nan=False)


def _lines(grid: Grid, rows: list[dict[str, Any]]) -> list[str]:
    names = [
        f"{row['variation']}, {row['baseline'].replace('_', ' ')}" if row["baseline"] else row["variation"]
        for row in rows
    ]
    width = max([len(name) for name in names] + [9])
    kind = ", simulated" if any(row["simulated"] for row in rows) else ""
    heads = ("windows", "position", "<= 5 mm", "force", "<= 0.2 N", "contact", "slip area")
    lines = [f"{grid.title or grid.config}{kind}, on {grid.part}"]
    lines.append(f"  {'variation':<{width}}" + "".join(f"{head:>11}" for head in heads))
    return lines + [
        f"  {name:<{width}}" + "".join(f"{text:>11}" for text in _row(row))
        for name, row in zip(names, rows, strict=True)
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
