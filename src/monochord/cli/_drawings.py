"""The pictures of an evaluation's page, drawn by the figures."""

from contextlib import suppress
from io import StringIO
from pathlib import Path

from monochord.core.errors import InputError
from monochord.evaluation.results import Results
from monochord.evaluation.scorecard import conditions_of
from monochord.figures import FIGURES

OF_A_CONDITION = ("scatter", "error_map", "confusion")
OVER_NOISE = "snr_curves"
IN_THE_ROOM_TOO = 2
"""Conditions that are drawn one by one: the first, and the first that was in the room."""


def drawings(file: Path, results: Results) -> dict[str, str]:
    """Return the figures of a file of results as SVG, by what they show."""
    added = {trial.condition for trial in results.trials if trial.ratio is not None}
    alone = [name for name in conditions_of(results) if name not in added][:IN_THE_ROOM_TOO]
    chosen = {
        f"{name.replace('_', ' ')}, {condition}": (name, {"condition": condition})
        for condition in alone
        for name in OF_A_CONDITION
    }
    if len({trial.ratio for trial in results.trials}) > 2:
        chosen["over added noise"] = (OVER_NOISE, {})
    found: dict[str, str] = {}
    for title, (name, options) in chosen.items():
        with suppress(InputError):  # there is nothing of this kind to draw, as without any touch
            found[title] = _drawn(name, {"results": str(file), **options})
    return found


def _drawn(name: str, options: dict[str, str]) -> str:
    text = StringIO()
    FIGURES.build(name, options).draw().savefig(text, format="svg")
    return text.getvalue()
