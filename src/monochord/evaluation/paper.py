"""The paper's tables: its figures for the real sensor, and Monochord's rows in the same form.

Yi, Xing, Manchester and Fazeli, Sound of Touch, tables of contact location and of force under acoustic noise:
one real sensor, features of an Audio Spectrogram Transformer, windows of 0.1 s; the noise is pop music from a
loudspeaker 20 cm away. The paper reports slip and contact as detected without error. Its figures are a
reference, not a rival: a simulated sensor has no wear, no glue and no room noise.

A row of ours is a feature, an object and a condition: errors in mm and N, shares and correlations over all
touched windows, None where a feature does not estimate. `keep_rows` keeps them in a JSON file, `paper_page`
prints them.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

from monochord.core.errors import InputError
from monochord.core.files import write_text
from monochord.evaluation.results import CLEAN
from monochord.evaluation.scorecard import EVERYTHING, Scorecard, ScoreTable
from monochord.evaluation.scores import Score

__all__ = [
    "NOISE",
    "PAPER",
    "RANDOM_WEIGHTS",
    "PaperRow",
    "Reported",
    "keep_rows",
    "labelled",
    "paper_page",
    "paper_rows",
    "reported",
]

NOISE = "noise"
RANDOM_WEIGHTS = " random weights"
"""Name suffix of a feature whose network has random weights."""
QUANTITIES = {
    "position": ("position_mae_mm", "position_within_5mm", "position_r", "mm", "within 5 mm", 1e3),
    "force": ("force_mae_n", "force_within_0_2n", "force_r", "N", "within 0.2 N", 1.0),
}
"""Columns of the error, the share and the correlation; the unit, the share's name, and the factor from SI."""
SENSOR_OF_THE_PAPER = "*the paper's sensor (real)*"
BLANK = "-"

PaperRow: TypeAlias = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reported:
    """Mean absolute error in SI units, share within 5 mm or 0.2 N, and Pearson's r."""

    mae: float
    within: float
    r: float


def _conditions(*columns: tuple[float, float, float]) -> dict[str, Reported]:
    return {
        condition: Reported(mae=mae, within=within, r=r)
        for condition, (mae, within, r) in zip((CLEAN, NOISE), columns, strict=True)
    }


PAPER: Mapping[str, Mapping[str, Mapping[str, Reported]]] = MappingProxyType(
    {
        "position": {
            "plastic": _conditions((2.7e-3, 0.878, 0.994), (3.1e-3, 0.833, 0.994)),
            "wood": _conditions((8.8e-3, 0.514, 0.863), (8.6e-3, 0.557, 0.857)),
            "metal_tube": _conditions((5.4e-3, 0.700, 0.952), (8.0e-3, 0.571, 0.893)),
            "allen_key": _conditions((2.7e-3, 0.829, 0.993), (2.8e-3, 0.871, 0.992)),
        },
        "force": {
            "plastic": _conditions((0.141, 0.744, 0.909), (0.131, 0.756, 0.928)),
            "wood": _conditions((0.111, 0.843, 0.903), (0.115, 0.829, 0.927)),
            "metal_tube": _conditions((0.172, 0.700, 0.908), (0.173, 0.657, 0.906)),
            "allen_key": _conditions((0.167, 0.671, 0.844), (0.165, 0.657, 0.819)),
        },
    }
)
"""Figures by quantity, object and condition (clean, noise)."""


def reported(quantity: str, body: str, condition: str) -> Reported | None:
    """Return the paper's figure of a quantity, object and condition, or None.

    The paper's noise was music, so its figures stand beside music at any ratio; other noises have none.

    Examples
    --------
    >>> figure = reported("position", "wood", "music 10 dB")
    >>> figure.mae if figure else None
    0.0086
    >>> reported("position", "wood", "hum 10 dB")
    """
    kind = condition if condition == CLEAN else NOISE if condition.partition(" ")[0] == "music" else ""
    return PAPER.get(quantity, {}).get(body, {}).get(kind)


def labelled(feature: str, *, random: bool) -> str:
    """Return a feature's name in its rows, marked if its weights are random.

    >>> labelled("ast", random=True), labelled("log_mel", random=False)
    ('ast random weights', 'log_mel')
    """
    return feature if not random or RANDOM_WEIGHTS in feature else feature + RANDOM_WEIGHTS


def paper_rows(card: Scorecard, feature: str, part: str = "test") -> list[PaperRow]:
    """Return the rows of a scorecard and of its baselines under a feature's name.

    Parameters
    ----------
    card
        The scores.
    feature
        Name of the rows; baselines add their own names.
    part
        Part of the split that was scored.

    Examples
    --------
    ``monochord evaluate --rows FILE`` keeps them in a file.
    """
    named = {f"{feature}, {name.replace('_', ' ')}": scores for name, scores in card.baselines.items()}
    tables: Mapping[str, Scorecard | ScoreTable] = {feature: card, **named}
    return [
        {**row, "simulated": card.simulated}
        for name, scores in tables.items()
        for row in _table_rows(scores, name, part)
    ]


def _table_rows(scores: Scorecard | ScoreTable, feature: str, part: str) -> Iterator[PaperRow]:
    for row in scores.table:
        if row.state != "touched":
            continue
        contact = scores.contact.get(row.object, {}).get(row.condition)
        slip = scores.slip.get(row.object, {}).get(row.condition)
        answered = row.position.answered
        yield {
            "feature": feature,
            "object": row.object,
            "condition": row.condition,
            "part": part,
            "position_mae_mm": _rounded(row.position.mae, 1e3),
            "position_within_5mm": _rounded(row.position.within),
            "position_r": _rounded(row.position.r),
            "position_answered": None if answered is None else round(answered, 4),
            "force_mae_n": _rounded(row.force.mae),
            "force_within_0_2n": _rounded(row.force.within),
            "force_r": _rounded(row.force.r),
            "contact_accuracy": _rounded(contact.accuracy) if contact else None,
            "slip_auc": _rounded(slip.area) if slip else None,
            "n": row.position.windows,
            "sessions": row.position.sessions,
        }


def _rounded(score: Score, factor: float = 1.0) -> float | None:
    return None if score.value is None else float(f"{factor * score.value:.4g}")


def keep_rows(file: Path, rows: Sequence[PaperRow]) -> None:
    """Replace the rows of the same features in FILE.json, and print all its rows to FILE.md.

    Raises
    ------
    InputError
        If the file has other content.
    """
    stored: list[PaperRow] = []
    replaced = {row["feature"] for row in rows}
    if file.exists():
        try:
            stored = json.loads(file.read_text(encoding="utf-8-sig"))
            stored = [row for row in stored if row["feature"] not in replaced]
        except (OSError, ValueError, TypeError, KeyError) as error:
            raise InputError(f"rows {file} (damaged)", "a file from monochord evaluate") from error
    every = sorted([*stored, *rows], key=lambda row: row["feature"])
    lines = ",\n".join(json.dumps(row, allow_nan=False) for row in every)
    write_text(file, f"[\n{lines}\n]\n")
    write_text(file.with_suffix(".md"), paper_page(every))


def paper_page(rows: Sequence[PaperRow]) -> str:
    """Return rows as Markdown: position, force, contact and slip, one table for each condition.

    The paper's figures form the first row of each table for which it has any.

    Examples
    --------
    ``monochord evaluate run --rows docs/results/paper.json`` writes it beside the rows.
    """
    kind = "All sound is simulated. " if rows and all(row["simulated"] for row in rows) else ""
    intro = (
        f"{kind}Errors are over windows with an estimate; shares are over all touched windows, where an "
        "abstention is a miss. In italics the paper's figures of its one real sensor: a reference, on other "
        "sound."
    )
    conditions = list(dict.fromkeys(row["condition"] for row in rows))
    parts = ["# The paper's tables", "", intro, ""]
    for quantity in QUANTITIES:
        for condition in conditions:
            title = f"## {quantity.capitalize()}, {condition}"
            parts += [title, "", *_errors(rows, quantity, condition), ""]
    for column, title in (
        ("contact_accuracy", "Contact: accuracy"),
        ("slip_auc", "Slip: area under the curve"),
    ):
        parts += [f"## {title}", "", *_detections(rows, column, conditions), ""]
    return "\n".join(parts).rstrip() + "\n"


def _errors(rows: Sequence[PaperRow], quantity: str, condition: str) -> Iterator[str]:
    unit, share, factor = QUANTITIES[quantity][3:]
    chosen = [row for row in rows if row["condition"] == condition]
    bodies = _bodies(chosen)
    yield _line(["feature", *(body.replace("_", " ") for body in bodies)])
    yield _rule(len(bodies))
    references = [reported(quantity, body, condition) for body in bodies]
    if any(references):
        cells = [
            BLANK if one is None else f"*{factor * one.mae:.3g} {unit}, {one.within:.1%}, {one.r:.3f}*"
            for one in references
        ]
        yield _line([SENSOR_OF_THE_PAPER, *cells])
    for feature in dict.fromkeys(row["feature"] for row in chosen):
        by_object = {row["object"]: row for row in chosen if row["feature"] == feature}
        yield _line([feature, *(_cell(by_object.get(body), quantity) for body in bodies)])
    yield ""
    yield f"Mean absolute error, share {share}, Pearson's r."


def _cell(row: PaperRow | None, quantity: str) -> str:
    mae, within, r, unit, *_ = QUANTITIES[quantity]
    if row is None or row[mae] is None:
        return BLANK
    return f"{row[mae]:.3g} {unit}, {row[within]:.1%}" + ("" if row[r] is None else f", {row[r]:.3f}")


def _detections(rows: Sequence[PaperRow], column: str, conditions: Sequence[str]) -> Iterator[str]:
    yield _line(["feature", *conditions])
    yield _rule(len(conditions))
    for feature in dict.fromkeys(row["feature"] for row in rows):
        cells: list[str] = []
        for condition in conditions:
            of_feature = [row for row in rows if (row["feature"], row["condition"]) == (feature, condition)]
            overall = [row for row in of_feature if row["object"] == EVERYTHING] or of_feature
            value = overall[0][column] if overall else None
            cells.append(
                BLANK if value is None else f"{value:.3f}" if column == "slip_auc" else f"{value:.1%}"
            )
        yield _line([feature, *cells])


def _bodies(rows: Sequence[PaperRow]) -> list[str]:
    """Return the objects of the rows: the paper's first, in its order."""
    bodies = list(dict.fromkeys(row["object"] for row in rows))
    known = [body for body in PAPER["position"] if body in bodies]
    return known + [body for body in bodies if body not in known]


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _rule(columns: int) -> str:
    return "|---|" + "---:|" * columns
