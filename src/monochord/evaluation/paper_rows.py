"""The rows by which features are compared on the paper's plan, kept in one file of JSON.

A row is a feature, an object and a condition: errors in mm and N, shares and correlations, as in the paper's
tables, of all touched windows. ``None`` stands where a feature does not tell.
"""

import json
from pathlib import Path
from typing import Any

from monochord.core.errors import InputError
from monochord.evaluation.regression import Score
from monochord.evaluation.scorecard import Scorecard

Row = dict[str, Any]
RANDOM_WEIGHTS = " random weights"
"""What the name of a feature holds whose network learned nothing."""


def labelled(feature: str, *, drawn: bool) -> str:
    """Return the name of a feature for its rows, which says so where its weights were `drawn` at random.

    >>> labelled("ast", drawn=True), labelled("log_mel", drawn=False)
    ('ast random weights', 'log_mel')
    """
    return feature if not drawn or RANDOM_WEIGHTS in feature else feature + RANDOM_WEIGHTS


def paper_rows(card: Scorecard, feature: str, part: str = "test") -> list[Row]:
    """Return the rows of a scorecard under the name of a feature, with the part of the split they are of.

    Examples
    --------
    ``monochord evaluate --rows FILE`` keeps them.
    """
    rows: list[Row] = []
    for row in card.table:
        if row.state != "touched":
            continue
        contact = card.contact.get(row.object, {}).get(row.condition)
        slip = card.slip.get(row.object, {}).get(row.condition)
        rows.append(
            {
                "feature": feature,
                "object": row.object,
                "condition": row.condition,
                "part": part,
                "position_mae_mm": _rounded(row.position.mae, 1e3),
                "position_within_5mm": _rounded(row.position.within),
                "position_r": _rounded(row.position.r),
                "position_answered": None
                if row.position.answered is None
                else round(row.position.answered, 4),
                "force_mae_n": _rounded(row.force.mae),
                "force_within_0_2n": _rounded(row.force.within),
                "force_r": _rounded(row.force.r),
                "contact_accuracy": _rounded(contact.accuracy) if contact else None,
                "slip_auc": _rounded(slip.area) if slip else None,
                "n": row.position.windows,
                "sessions": row.position.sessions,
                "simulated": card.simulated,
            }
        )
    return rows


def keep_rows(file: Path, rows: list[Row]) -> list[Row]:
    """Put rows into a file in place of those of the same feature; return all that are in it then.

    Raises
    ------
    InputError
        If the file holds something else.
    """
    held: list[Row] = []
    if file.exists():
        try:
            held = json.loads(file.read_text(encoding="utf-8"))
            names = {row["feature"] for row in held}
        except (OSError, ValueError, TypeError, KeyError) as error:
            raise InputError(f"rows {file} (damaged)", "a file that monochord evaluate wrote") from error
    else:
        names = set()
    new = {row["feature"] for row in rows}
    kept = [row for row in held if row["feature"] in names - new] + rows
    kept.sort(key=lambda row: row["feature"])
    lines = ",\n".join(json.dumps(row, allow_nan=False) for row in kept)
    file.write_text(f"[\n{lines}\n]\n", encoding="utf-8")
    return kept


def _rounded(score: Score, factor: float = 1.0) -> float | None:
    return None if score.value is None else float(f"{factor * score.value:.4g}")
