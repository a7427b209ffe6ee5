"""The command `transfer`: a model on builds that it was not trained on, by the touches that it knows."""

import json
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import click

from monochord.cli._output import echo, progress_bar
from monochord.core.errors import InputError
from monochord.datasets.build import Labelling
from monochord.evaluation.builds import TOUCHES, UNSEEN, Per, evaluate_builds
from monochord.evaluation.select import EvaluationSettings
from monochord.evaluation.summary import SummaryRow, keep_summary
from monochord.evaluation.summary_page import HEADS, builds_page, cells
from monochord.lab.workers import run_all


@click.command()
@click.argument("model")
@click.option("--sessions", multiple=True, required=True, metavar="FILES", help="Unseen builds; repeatable.")
@click.option(
    "--touches",
    default=",".join(map(str, TOUCHES)),
    show_default=True,
    metavar="N,N",
    help="Numbers of known touches.",
)
@click.option(
    "--per",
    type=click.Choice(["session", "build"]),
    default="session",
    show_default=True,
    help="Adapted to: each session, with its object, or a build by all of its sessions, for other objects.",
)
@click.option("--condition", default=UNSEEN, show_default=True, metavar="TEXT", help="Name of the condition.")
@click.option(
    "--labels",
    type=click.Choice(["recorded", "measured"]),
    help="From the session, or from force and pose.  [default: recorded where there are any]",
)
@click.option("--name", default="", metavar="NAME", help="Name of the model in the rows.  [default: MODEL]")
@click.option(
    "--baselines/--no-baselines", default=True, show_default=True, help="Ridge on the same feature."
)
@click.option(
    "--rows", type=click.Path(path_type=Path), metavar="FILE", help="Keep rows in FILE, a JSON, and a page."
)
@click.option("--workers", type=click.IntRange(min=1), metavar="N", help="Processes.  [default: one a core]")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def transfer(
    model: str,
    *,
    sessions: tuple[str, ...],
    touches: str,
    per: Per,
    condition: str,
    labels: Labelling | None,
    name: str,
    baselines: bool,
    rows: Path | None,
    workers: int | None,
    as_json: bool,
) -> None:
    """Test MODEL on builds that it was not trained on, adapted to 0, 1, 5 ... touches of each.

    Every session is adapted to by its first touches and scored on the others, beside ridge regression on the
    same feature, corrected by the same touches, and beside ridge regression that has seen nothing else. With
    --labels measured, touches are known and scored by what robot and force sensor say, errors included.

    \b
    monochord transfer run --sessions sealed --rows docs/results/builds.json
    monochord transfer run --sessions monday/*.mcap --touches 0,10 --labels measured
    """  # noqa: D301
    settings = EvaluationSettings(model=model, sessions=sessions, baselines=baselines)
    with progress_bar("builds") as progress:
        result = evaluate_builds(
            settings,
            name=name or Path(model).name,
            touches=_numbers(touches),
            per=per,
            condition=condition,
            labels=labels or "",
            run=partial(run_all, workers=workers),
            progress=progress,
            refused=lambda why: echo(f"left out: {why}", err=True),
        )
    if rows is not None:
        keep_summary(rows, result, builds_page)
    echo(*([json.dumps({"rows": result}, allow_nan=False)] if as_json else _lines(result)))


def _numbers(text: str) -> tuple[int, ...]:
    try:
        numbers = tuple(int(each) for each in text.split(","))
    except ValueError as error:
        raise InputError(f"--touches {text}", "whole numbers with commas between, such as 0,10") from error
    if min(numbers) < 0:
        raise InputError(f"--touches {text}", "0 or more")
    return numbers


def _lines(rows: Sequence[SummaryRow]) -> list[str]:
    heads = ("world", "object", "estimator", "touches", *HEADS, "builds")
    table: list[tuple[str, ...]] = [heads]
    for row in rows:
        names = (row["world"] or "real", row["object"], row["model"].replace("_", " "), str(row["touches"]))
        table.append((*names, *cells(row), str(row["builds"])))
    widths = [max(len(line[column]) for line in table) for column in range(len(heads))]
    kind = ", simulated" if all(row["simulated"] for row in rows) else ""
    lines = [f"{rows[0]['condition']}{kind}: {len(rows)} rows"]
    for line in table:
        texts = [f"{text:<{width}}" for text, width in zip(line[:3], widths[:3], strict=True)]
        numbers = [f"{text:>{width}}" for text, width in zip(line[3:], widths[3:], strict=True)]
        lines.append("  " + "  ".join([*texts, *numbers]))
    return lines
