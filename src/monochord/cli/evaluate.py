"""The command `evaluate`: scores an estimator on test sessions."""

import json
from pathlib import Path
from typing import Any

import click

from monochord.cli._moved import refuse_moved
from monochord.cli._options import completes, refuse_without, set_option, worker_options
from monochord.cli._output import echo
from monochord.core.errors import InputError, MissingLibraryError
from monochord.evaluation.evaluate import PAGE, refuse_unwritable
from monochord.figures.base import require_matplotlib
from monochord.front.evaluate import DEFAULT_ESTIMATOR
from monochord.front.evaluate import evaluate as evaluated
from monochord.perception.model.bundled import bundled_names

PARTS = ("test", "validation")
SUITE = "noise"


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
    dataset: Path | None,
    noises: tuple[str, ...],
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
    if rows is None:
        refuse_without("--feature without --rows", "--rows, since --feature names the rows", "feature")
    refuse_moved("suite", suite, [SUITE])
    if suite not in (None, SUITE):
        given = f"--suite {suite}" if suite else "--suite without a name"
        raise InputError(given, SUITE, "use --suite noise for every kind of noise")
    if not (noises or suite):
        refuse_without("--seed without noise", "--noise or --suite with --seed", "seed")
    if out is not None:
        refuse_unwritable(out)
    report = evaluated(
        model,
        dataset,
        estimator=estimator,
        settings=assignments,
        noise=noises,
        suite=suite == SUITE,
        **options,
    )
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
