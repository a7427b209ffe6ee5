"""The command `evaluate`: scores of an estimator on test sessions."""

import json
from pathlib import Path
from typing import Any

import click

from monochord import evaluation
from monochord.cli._drawings import drawings, note_missing_figures
from monochord.cli._moved import refuse_moved
from monochord.cli._options import completes, refuse_without, set_option, worker_options
from monochord.cli._output import echo, progress_bar
from monochord.core.config import override
from monochord.core.errors import InputError
from monochord.evaluation.evaluate import PAGE, refuse_unwritable
from monochord.evaluation.paper import keep_rows, paper_rows
from monochord.evaluation.scorecard import Scorecard, ScoreTable
from monochord.evaluation.scores import Detection, Regression
from monochord.evaluation.select import EvaluationSettings
from monochord.perception.model.bundled import bundled_names

PARTS = ("test", "validation")
SUITE = "noise"
DEFAULT_ESTIMATOR = "closed_form"
HEADS = ("windows", "answered", "error", "<= 5 mm", "r", "error", "<= 0.2 N", "r", "contact", "slip area")
WIDTHS = (9, 10, 10, 9, 7, 10, 10, 7, 9, 11)
"""Columns of the table of scores."""


@click.command()
@click.argument("model", required=False, **completes(bundled_names))
@click.option(
    "--dataset",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Dataset to test on.  [default: that of MODEL]",
)
@click.option(
    "--split",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Split to use.  [default: that of MODEL, or of the dataset]",
)
@click.option(
    "--part",
    type=click.Choice(PARTS),
    default="test",
    show_default=True,
    help="Part of the split to test on.",
)
@click.option(
    "--sessions",
    multiple=True,
    metavar="FILES",
    help="Test on these sessions instead of a dataset; repeatable.",
)
@click.option(
    "--estimator",
    metavar="NAME",
    help=f"Estimator to test if there is no MODEL.  [default: {DEFAULT_ESTIMATOR}]",
)
@set_option("monochord list estimators")
@click.option("--sensor", metavar="PRESET", help="Sensor whose string the estimator assumes.")
@click.option("--tuned", is_flag=True, help="Tune that string to the untouched beginning of each session.")
@click.option(
    "--noise",
    "noises",
    multiple=True,
    metavar="KIND:DB",
    help="Also test with added noise, such as music:10; repeatable.",
)
@click.option(
    "--suite",
    metavar=SUITE,
    is_flag=False,
    flag_value="",
    help="Also test with every kind of noise at 0 to 25 dB.",
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Random seed of the noise."
)
@click.option("--baselines/--no-baselines", default=True, show_default=True, help="Also test the baselines.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Write the results and a report to this folder.",
)
@click.option(
    "--rows",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Also keep the rows of the table in a JSON file.",
)
@click.option(
    "--feature", metavar="NAME", help="Name of these rows in that file.  [default: the feature, or MODEL]"
)
@worker_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def evaluate(
    model: str | None,
    *,
    out: Path | None,
    rows: Path | None,
    feature: str | None,
    estimator: str | None,
    assignments: tuple[str, ...],
    as_json: bool,
    suite: str | None,
    workers: int | None,
    cluster: str,
    **options: Any,
) -> None:
    """Test a model on sessions that it was not trained on.

    MODEL is a run folder, a model folder, or a bundled model such as demo. Each test session is replayed
    window by window, as live. A leaking split is refused, and so is a session that MODEL was trained on. For
    comparison, ridge regression and extra trees are fitted to the same features of the training windows.

    \b
    monochord evaluate run --out report --noise music:10
    monochord evaluate demo --sessions session.mcap
    monochord evaluate --estimator closed_form --dataset dataset --sensor prototype
    """  # noqa: D301
    if model is not None and estimator is not None:
        raise InputError(f"model {model} beside --estimator {estimator}", "one of both")
    if options["sessions"]:
        refuse_without("--split or --part beside --sessions", "all of the sessions", "split", "part")
    if rows is None:
        refuse_without("--feature without --rows", "beside --rows, whose name it is", "feature")
    refuse_moved("suite", suite, [SUITE])
    if suite not in (None, SUITE):
        given = f"--suite {suite}" if suite else "--suite without a name"
        raise InputError(given, SUITE, "write --suite noise for every kind of noise")
    if not (options["noises"] or suite):
        refuse_without("--seed without noise", "beside --noise or --suite, whose it is", "seed")
    settings = EvaluationSettings(
        model=model,
        estimator=estimator or DEFAULT_ESTIMATOR,
        options=override({}, assignments),
        suite=suite == SUITE,
        **options,
    )
    if out is not None:
        refuse_unwritable(out)
    with progress_bar() as progress:
        outcome = evaluation.evaluate(settings, progress=progress, workers=workers, cluster=cluster)
    if out is not None:
        evaluation.write(out, outcome, drawings)
        note_missing_figures()
    card = outcome.card
    if rows is not None:
        keep_rows(rows, paper_rows(card, feature or outcome.label, settings.part))
    written = [] if out is None else [f"report: {out / PAGE}"]
    echo(*([json.dumps(card.tree(), allow_nan=False)] if as_json else [*_lines(card), *written]))


def _lines(card: Scorecard) -> list[str]:
    """Return the table of a scorecard: a line for each object and condition, over all touched windows."""
    kind = ", simulated" if card.simulated else ""
    lines = [f"{card.estimator}{kind}: {card.windows} windows of {card.sessions} sessions"]
    lines += [f"note: {note}" for note in card.notes]
    own = ScoreTable(table=card.table, contact=card.contact, slip=card.slip)
    tables = {card.estimator: own, **card.baselines}
    rows: list[tuple[str, str, str, tuple[str, ...]]] = [("object", "condition", "estimator", HEADS)]
    for body, condition in [(row.object, row.condition) for row in card.table if row.state == "touched"]:
        for name, table in tables.items():
            rows.append((body, condition, name.replace("_", " "), _cells(table, body, condition)))
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    for row in rows:
        texts = "  ".join(f"{text:<{width}}" for text, width in zip(row[:3], widths, strict=True))
        numbers = "".join(f"{text:>{width}}" for text, width in zip(row[3], WIDTHS, strict=True))
        lines.append(f"  {texts}{numbers}")
    return lines


def _cells(scores: ScoreTable, body: str, condition: str) -> tuple[str, ...]:
    key = (body, condition, "touched")
    row = next((row for row in scores.table if (row.object, row.condition, row.state) == key), None)
    if row is None:
        return ("-",) * len(HEADS)
    contact = scores.contact.get(body, {}).get(condition)
    slip = scores.slip.get(body, {}).get(condition)
    return (
        str(row.position.windows),
        _share(row.position.answered),
        *_errors(row.position, 1e3, "mm"),
        *_errors(row.force, 1.0, "N"),
        _share(contact.accuracy.value if contact else None),
        _area(slip),
    )


def _errors(score: Regression, factor: float, unit: str) -> tuple[str, str, str]:
    error = "-" if score.mae.value is None else f"{factor * score.mae.value:.3g} {unit}"
    return error, _share(score.within.value), "-" if score.r.value is None else f"{score.r.value:.3f}"


def _share(value: float | None) -> str:
    return "-" if value is None else f"{100.0 * value:.1f} %"


def _area(slip: Detection | None) -> str:
    return "-" if slip is None or slip.area.value is None else f"{slip.area.value:.4f}"
