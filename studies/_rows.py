"""Evaluation results as rows of figures, for tables over conditions, builds or known touches.

A row has the keys of `KEYS`, and beside them the coverage of two standard errors, both by quantity, and
intervals. Errors in mm and N are of touched windows with an estimate; shares within the tolerance and the
accuracy of contact count an abstention as a miss. None stands where there is nothing to compute a figure
from, such as the coverage of an estimator that states no standard errors.

Coverage is of the estimates of position and of force together. `gross_share` is the share of answered
windows whose position or force is more than `GROSS` standard errors off: confidently wrong. `answered` is the
share of touched windows with an estimate of all that is known of them.
"""

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.types import Flags, Floats, Indices
from monochord.evaluation import (
    CLEAN,
    DRAWS,
    EVERYTHING,
    MIN_SESSIONS,
    Results,
    Score,
    blocks_of,
    detection,
    regression_rows,
    score_of,
)
from monochord.metrics import LIMITS, finite_rows, normal_coverage

SummaryRow: TypeAlias = dict[str, Any]
KEYS = (
    "model", "world", "touches", "object", "condition", "position_mae_mm", "position_within_5mm",
    "force_mae_n", "contact_accuracy", "slip_auc", "coverage_1se", "gross_share", "answered", "builds", "n",
)  # fmt: skip
"""Keys of a row, shared by all tables."""
LABELS = KEYS[:5]
"""Keys that identify a row."""
FACTORS: Mapping[str, float] = {"position": 1e3, "force": 1.0}
"""Factor from a quantity's SI unit to its error column's unit."""
COLUMNS: Mapping[str, str] = {"position": "position_mae_mm", "force": "force_mae_n"}
"""Error column of each quantity."""
GROSS = 5.0
"""Standard errors beyond which an error is gross."""


HEADS = (
    "answered", "position", "<= 5 mm", "force", "contact", "slip area", "1 se", "2 se", f"> {GROSS:g} se",
)  # fmt: skip
"""Column headers of `cells`."""
INTERVALS = {"position_mae_mm": 1, "force_mae_n": 3}
"""Columns for which a page shows an interval."""
BLANK = "-"
EXPLAINED = (
    "Errors are mean absolute ones over touched windows with an estimate; shares are over all touched "
    "windows, where an abstention is a miss. Under 1 se and 2 se is the share of truths within one and two "
    f"stated standard errors ({normal_coverage(1.0):.1%} and {normal_coverage(2.0):.1%} where they are "
    f"right), under > {GROSS:g} se the share of answered windows that are further off: confidently wrong."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Scored:
    """Windows with known truth of a quantity: error, standard error and block, (n,); NaN for abstentions."""

    error: Floats
    std: Floats
    block: Indices

    @property
    def answered(self) -> Flags:
        return finite_rows(self.error)

    def where(self, rows: Flags) -> "_Scored":
        return _Scored(error=self.error[rows], std=self.std[rows], block=self.block[rows])


def summary_row(
    results: Results,
    *,
    model: str,
    world: str = "",
    touches: int = 0,
    body: str = EVERYTHING,
    condition: str = CLEAN,
    draws: int = DRAWS,
) -> SummaryRow:
    """Return one row of figures from results.

    Parameters
    ----------
    results
        Estimates beside the truth.
    model, world, touches, body, condition
        Identity of the row: the estimator, the simulated world ("" for real sound), the number of known
        touches per build, the object, and the condition.
    draws
        Bootstrap draws of the intervals, over builds where there are `MIN_SESSIONS`, else over sessions; 0
        for none.
    """
    block, what = _blocks(results)
    scored = regression_rows(results, "position") | regression_rows(results, "force")
    by = {name: _scored(results, name, block) for name in COLUMNS}
    own = {name: each.where(regression_rows(results, name)) for name, each in by.items()}
    estimates = _stated(own)
    gross, gross_block = _gross(by, scored)
    contact, slip = (detection(results, name, draws=0) for name in ("contact", "slip"))
    scores = {column: _error(own[name], FACTORS[name], draws) for name, column in COLUMNS.items()}
    scores["coverage_1se"] = _share(estimates, 1.0, draws)
    scores["gross_share"] = _mean(gross, gross_block, draws)
    values = {
        "model": model,
        "world": world,
        "touches": touches,
        "object": body,
        "condition": condition,
        **{name: _rounded(score.value) for name, score in scores.items()},
        "position_within_5mm": _within(own["position"], LIMITS["position"]),
        "contact_accuracy": _rounded(contact.accuracy.value),
        "slip_auc": _rounded(slip.area.value),
        "answered": _answered(results, by, scored),
        "builds": len(set(_builds(results)[results.trial])),
        "n": int(scored.sum()),
    }
    row: SummaryRow = {key: values[key] for key in KEYS}
    row["coverage_2se"] = _rounded(_share(estimates, 2.0, 0).value)
    for name, each in own.items():
        alone = _stated({name: each})
        for sigmas in (1.0, 2.0):
            row[f"{name}_coverage_{sigmas:g}se"] = _rounded(_share(alone, sigmas, 0).value)
    row["simulated"] = results.simulated
    row["drawn"] = what
    row["intervals"] = {
        name: [_rounded(score.low), _rounded(score.high)]
        for name, score in scores.items()
        if score.low is not None
    }
    return row


def cells(row: SummaryRow) -> tuple[str, ...]:
    """Return the figures of a row as texts, in the order of `HEADS`.

    >>> row = dict.fromkeys(("answered", "position_mae_mm", "position_within_5mm", "force_mae_n"), 1.0)
    >>> row |= dict.fromkeys(("contact_accuracy", "slip_auc", "coverage_1se", "coverage_2se", "gross_share"))
    >>> cells(row)
    ('100.0 %', '1 mm', '100.0 %', '1 N', '-', '-', '-', '-', '-')
    """
    return (
        _percent(row["answered"]),
        _number(row["position_mae_mm"], " mm"),
        _percent(row["position_within_5mm"]),
        _number(row["force_mae_n"], " N"),
        _percent(row["contact_accuracy"]),
        BLANK if row["slip_auc"] is None else f"{row['slip_auc']:.3f}",
        _percent(row["coverage_1se"]),
        _percent(row["coverage_2se"]),
        BLANK if row["gross_share"] is None else f"{100.0 * row['gross_share']:.2f} %",
    )


def keep_summary(file: Path, rows: Sequence[SummaryRow], page: Callable[[Sequence[SummaryRow]], str]) -> None:
    """Replace the rows with the same `LABELS` in FILE.json, and print all its rows to FILE.md.

    Raises
    ------
    InputError
        If the file has other content.
    """
    every = {tuple(row[key] for key in LABELS): row for row in (read_summary(file) if file.exists() else [])}
    every |= {tuple(row[key] for key in LABELS): row for row in rows}
    lines = ",\n".join(json.dumps(row, allow_nan=False) for row in every.values())
    file.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    file.with_suffix(".md").write_text(page(list(every.values())), encoding="utf-8")


def read_summary(file: Path) -> list[SummaryRow]:
    """Return the rows in a file.

    Raises
    ------
    InputError
        If the file is missing, or has other content.
    """
    try:
        rows: list[SummaryRow] = json.loads(file.read_text(encoding="utf-8"))
        complete = all(key in row for row in rows for key in KEYS)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"rows {file} (missing or damaged)", "a file from a study") from error
    if not complete:
        raise InputError(f"rows {file} of other keys", ", ".join(KEYS))
    return rows


def write_summary_csv(file: Path, rows: Sequence[SummaryRow]) -> None:
    """Write rows as text, without their intervals; None is an empty field."""
    names = [name for name in rows[0] if name != "intervals"] if rows else list(KEYS)
    with file.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, names, extrasaction="ignore", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _blocks(results: Results) -> tuple[Indices, str]:
    """Return each window's bootstrap block (n,), and the kind of block."""
    names, number = np.unique(_builds(results)[results.trial], return_inverse=True)
    return (number.astype(np.int64), "builds") if len(names) >= MIN_SESSIONS else blocks_of(results)


def _builds(results: Results) -> NDArray[np.str_]:
    """Return the build of each trial; a design itself counts as one."""
    return np.array(["" if trial.build is None else str(trial.build) for trial in results.trials])


def _scored(results: Results, name: str, block: Indices) -> _Scored:
    std = results.std.get(name, np.full(len(results), np.nan))
    return _Scored(error=results.error_of(name), std=std, block=block)


def _stated(own: Mapping[str, _Scored]) -> _Scored:
    """Return the errors of all estimates with a standard error, in units of it."""
    parts = [each.where(finite_rows(each.error) & finite_rows(each.std)) for each in own.values()]
    return _Scored(
        error=np.concatenate([part.error for part in parts]),
        std=np.concatenate([part.std for part in parts]),
        block=np.concatenate([part.block for part in parts]),
    )


def _gross(by: Mapping[str, _Scored], scored: Flags) -> tuple[Flags, Indices]:
    """Return whether each answered window (n,) has a gross error, and its block."""
    stated, wrong = np.zeros(len(scored), bool), np.zeros(len(scored), bool)
    for each in by.values():
        has_std = scored & finite_rows(each.error) & finite_rows(each.std)
        stated |= has_std
        wrong[has_std] |= np.abs(each.error[has_std]) > GROSS * each.std[has_std]
    return wrong[stated], next(iter(by.values())).block[stated]


def _answered(results: Results, by: Mapping[str, _Scored], scored: Flags) -> float | None:
    complete = scored.copy()
    for name, each in by.items():
        complete &= each.answered | ~regression_rows(results, name)
    return _rounded(float(complete[scored].mean())) if scored.any() else None


def _error(scored: _Scored, factor: float, draws: int) -> Score:
    return _mean(factor * np.abs(scored.error[scored.answered]), scored.block[scored.answered], draws)


def _share(stated: _Scored, sigmas: float, draws: int) -> Score:
    return _mean(np.abs(stated.error) <= sigmas * stated.std, stated.block, draws)


def _within(scored: _Scored, limit: float) -> float | None:
    if not len(scored.error):
        return None
    return _rounded(float(np.mean(np.nan_to_num(np.abs(scored.error), nan=np.inf) <= limit)))


def _mean(values: Floats | Flags, block: Indices, draws: int) -> Score:
    if not len(values):
        return Score()
    return score_of(lambda at: float(values[at].mean()), block, draws)


def _rounded(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.4g}")


def _number(value: float | None, unit: str) -> str:
    return BLANK if value is None else f"{value:.3g}{unit}"


def _percent(value: float | None) -> str:
    return BLANK if value is None else f"{100.0 * value:.1f} %"
