"""Shared by the figures of evaluation results."""

from __future__ import annotations

from pathlib import Path

from monochord.core.errors import InputError, did_you_mean
from monochord.evaluation.results import Results, read_results

UNITS = {"position": (1e3, "mm"), "force": (1.0, "N")}
"""Scale factor from SI, and display unit, of a quantity."""
SYMBOLS = {"position": "x", "force": "F"}


def in_condition(path: Path, condition: str) -> Results:
    """Return the results in a file for one condition.

    Raises `InputError` that names the file's conditions if there are none.
    """
    results = read_results(Path(path))
    rows = results.of_trials("condition") == condition
    if not rows.any():
        known = sorted({trial.condition for trial in results.trials})
        raise InputError(f"condition '{condition}'", ", ".join(known), did_you_mean(condition, known))
    return results.where(rows)


def title_of(results: Results, condition: str = "") -> str:
    """Return a title: estimator, condition, and whether the sound is simulated."""
    title = results.estimator.replace("_", " ") + (f", {condition}" if condition else "")
    return f"simulated: {title}" if results.simulated else title
