"""The hardware suite of the command `evaluate`: its options, its run, and what it prints and writes."""

import json
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import click

from monochord.cli._drawings import note_missing_figures
from monochord.cli._output import echo, progress_bar
from monochord.core.errors import InputError, MissingLibraryError
from monochord.evaluation.evaluate import RESULTS
from monochord.evaluation.hardware import HardwareEvaluation, evaluate_hardware
from monochord.evaluation.results import write_results
from monochord.evaluation.select import EvaluationSettings, load
from monochord.evaluation.summary import SummaryRow, keep_summary, write_summary_csv
from monochord.evaluation.summary_page import HEADS, cells, hardware_page
from monochord.figures import FIGURES
from monochord.lab.hardware import chosen_conditions, render_suite
from monochord.live.tuning import preset_of

Command = TypeVar("Command", bound=Callable[..., Any])
NAME = "hardware"
"""Stem of the files that a suite writes, and the name of its figure."""
OPTIONS = (
    click.option(
        "--cache",
        type=click.Path(path_type=Path),
        default=Path("hardware-sessions"),
        show_default=True,
        metavar="DIR",
        help="Folder of the suite's sessions, which other models use again.",
    ),
    click.option(
        "--only", multiple=True, metavar="NAME", help="Only this condition of the suite; repeatable."
    ),
    click.option("--quick", is_flag=True, help="A few touches only in each condition."),
    click.option(
        "--workers",
        type=click.IntRange(min=1),
        metavar="N",
        help="Processes that render the suite.  [default: one a core]",
    ),
)


def hardware_options(command: Command) -> Command:
    """Add the options of the hardware suite to a command."""
    for option in reversed(OPTIONS):
        command = option(command)
    return command


@dataclass(frozen=True, slots=True, kw_only=True)
class HardwareRun:
    """The options of `hardware_options`."""

    cache: Path
    only: tuple[str, ...] = ()
    quick: bool = False
    workers: int | None = None


def test_on_hardware(
    run: HardwareRun,
    settings: EvaluationSettings,
    *,
    name: str | None,
    out: Path | None,
    rows: Path | None,
    as_json: bool,
) -> None:
    """Render what is not rendered yet, evaluate it, print the table, and write what is to be written."""
    conditions = chosen_conditions(run.only)
    sensor = sensor_of(settings)
    with progress_bar() as progress:
        sessions = render_suite(
            conditions,
            sensor,
            run.cache,
            seed=settings.seed,
            quick=run.quick,
            workers=run.workers,
            progress=progress,
        )
        outcome = evaluate_hardware(
            settings,
            sessions,
            name=name or (Path(settings.model).name if settings.model else settings.estimator),
            retuned={condition.name for condition in conditions if condition.is_retuned},
            progress=progress,
        )
    if rows is not None:
        keep_summary(rows, outcome.rows, hardware_page)
    if out is not None:
        _write(out, outcome)
        note_missing_figures()
    if as_json:
        echo(json.dumps({"sensor": sensor, "rows": outcome.rows, "notes": outcome.notes}, allow_nan=False))
    else:
        echo(*_lines(outcome))


def sensor_of(settings: EvaluationSettings) -> str:
    """Return the name of the sensor that a model was trained on, or that the settings name.

    Raises
    ------
    InputError
        If neither says which.
    """
    candidate = load(settings)
    known = settings.sensor or candidate.config.get("sensor")
    if known:
        return str(known)
    if candidate.definition is None:
        raise InputError(
            "an estimator without a sensor", "the sensor of the suite", "name it: --sensor prototype"
        )
    return preset_of(candidate.definition.string)


def _lines(outcome: HardwareEvaluation) -> list[str]:
    """Return the table: a line for each condition and estimator."""
    table = [("condition", "estimator", *HEADS)]
    table += [(row["condition"], row["model"].replace("_", " "), *cells(row)) for row in outcome.rows]
    widths = [max(len(line[column]) for line in table) for column in range(len(table[0]))]
    lines = [f"hardware suite, simulated: {len(outcome.rows)} rows"]
    lines += [f"note: {note}" for note in outcome.notes]
    for line in table:
        texts = [f"{text:<{width}}" for text, width in zip(line[:2], widths[:2], strict=True)]
        numbers = [f"{text:>{width}}" for text, width in zip(line[2:], widths[2:], strict=True)]
        lines.append("  " + "  ".join([*texts, *numbers]))
    return lines


def _write(folder: Path, outcome: HardwareEvaluation) -> None:
    """Write rows as JSON, CSV and a page with its figure, and the estimates of the first estimator."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{NAME}.json"
    file.unlink(missing_ok=True)
    keep_summary(file, outcome.rows, _page_with(f"{NAME}.svg"))
    write_summary_csv(file.with_suffix(".csv"), outcome.rows)
    write_results(next(iter(outcome.results.values())), folder / RESULTS)
    with suppress(MissingLibraryError):
        FIGURES.build(NAME, {"rows": str(file)}).draw().savefig(file.with_suffix(".svg"))


def _page_with(figure: str) -> Callable[[Any], str]:
    def page(rows: list[SummaryRow]) -> str:
        return hardware_page(rows, figure)

    return page
