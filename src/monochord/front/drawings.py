"""The figures of an evaluation's report."""

from contextlib import suppress
from io import StringIO
from pathlib import Path

from monochord.core.errors import InputError
from monochord.evaluation.results import Results
from monochord.evaluation.scorecard import conditions_of
from monochord.figures import FIGURES

OF_A_CONDITION = ("scatter", "error_map", "confusion")
OVER_NOISE = "snr_curves"
MAX_CONDITIONS = 2
"""Conditions with separate figures: the clean one, and the first with ambient noise."""


def drawings(file: Path, results: Results) -> dict[str, str]:
    """Return the figures of a results file as SVG texts, by title."""
    added = {trial.condition for trial in results.trials if trial.ratio is not None}
    alone = [name for name in conditions_of(results) if name not in added][:MAX_CONDITIONS]
    chosen = {
        f"{name.replace('_', ' ')}, {condition}": (name, {"condition": condition})
        for condition in alone
        for name in OF_A_CONDITION
    }
    if len({trial.ratio for trial in results.trials}) > 2:
        chosen["over added noise"] = (OVER_NOISE, {})
    figures: dict[str, str] = {}
    for title, (name, options) in chosen.items():
        with suppress(InputError):  # nothing to draw, or to draw with
            figures[title] = _drawn(name, {"results": str(file), **options})
    return figures


def _drawn(name: str, options: dict[str, str]) -> str:
    """Return a figure as SVG text; equal results give equal texts."""
    figure, text = FIGURES.build(name, options).draw(), StringIO()
    import matplotlib as mpl  # noqa: PLC0415

    with mpl.rc_context({"svg.hashsalt": name}):
        figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()
