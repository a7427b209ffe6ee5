"""The command `evaluate`: scores an estimator on test sessions."""

import json
from pathlib import Path
from typing import Any

import click

from monochord.cli._options import completes, refuse_without, set_option, worker_options
from monochord.cli._output import echo
from monochord.cli._signature import options_of
from monochord.core.errors import InputError, MissingLibraryError
from monochord.evaluation.evaluate import PAGE, refuse_unwritable
from monochord.figures.base import require_matplotlib
from monochord.front.evaluate import evaluate as evaluated
from monochord.perception.model.bundled import bundled_names


@click.command()
@click.argument("model", required=False, **completes(bundled_names))
@options_of(evaluated, "data", flags=("--dataset",), metavar="DIR")
@options_of(evaluated, "split", metavar="FILE")
@options_of(evaluated, "part")
@options_of(evaluated, "sessions", multiple=True, type=str, metavar="FILES")
@options_of(evaluated, "skip")
@options_of(evaluated, "estimator", metavar="NAME")
@set_option("monochord list estimators")
@options_of(evaluated, "sensor", metavar="PRESET")
@options_of(evaluated, "tuned")
@options_of(evaluated, "noise", metavar="KIND:DB")
@options_of(evaluated, "suite", is_flag=False, flag_value="", type=click.Choice(["noise"]), default=None)
@options_of(evaluated, "seed", "baselines")
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
    help="Also save the table's rows to a JSON file.",
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
        raise InputError(f"model {model} with --estimator {estimator}", "only one of them")
    if options["sessions"]:
        refuse_without(
            "--split or --part with --sessions", "neither, since all sessions are tested", "split", "part"
        )
    else:
        refuse_without("--skip without --sessions", "--sessions, of which it leaves some out", "skip")
    if rows is None:
        refuse_without("--feature without --rows", "--rows, since --feature names the rows", "feature")
    if not (options["noise"] or suite):
        refuse_without("--seed without noise", "--noise or --suite with --seed", "seed")
    if out is not None:
        refuse_unwritable(out)
    report = evaluated(model, estimator=estimator, settings=assignments, suite=suite is not None, **options)
    if out is not None:
        report.write(out)
        _note_missing_figures()
    if rows is not None:
        report.keep_rows(rows, feature)
    written = [] if out is None else [f"report: {out / PAGE}"]
    echo(*([json.dumps(report.tree(), allow_nan=False)] if as_json else [*report.lines(), *written]))


def _note_missing_figures() -> None:
    """Print to standard error how to get figures, where the plotting library is missing."""
    try:
        require_matplotlib()
    except MissingLibraryError as error:
        echo(f"note: no figures: {error}", err=True)
