"""What figures of an evaluation's results have in common."""

from __future__ import annotations

from pathlib import Path

from monochord.core.errors import InputError, did_you_mean
from monochord.evaluation.results import Results, read_results

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#444444", "#999933")
"""Okabe and Ito's, which colour-blind eyes tell apart, and two more."""
SHOWN = {"position": (1e3, "mm"), "force": (1.0, "N")}
"""How a quantity is shown: factor and unit."""
LETTER_OF = {"position": "x", "force": "F"}


def in_condition(path: Path, condition: str) -> Results:
    """Return the results in a file that belong to a condition.

    Raises `InputError` where there are none, with the conditions that there are.
    """
    results = read_results(Path(path))
    at = results.of_trials("condition") == condition
    if not at.any():
        there = sorted({trial.condition for trial in results.trials})
        raise InputError(f"condition '{condition}'", ", ".join(there), did_you_mean(condition, there))
    return results.where(at)


def whose(results: Results, condition: str = "") -> str:
    """Return whose results in what condition they are, for a title, and whether they are simulated."""
    told = results.estimator.replace("_", " ") + (f", {condition}" if condition else "")
    return f"simulated: {told}" if results.simulated else told
