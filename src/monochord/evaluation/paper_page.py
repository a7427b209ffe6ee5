"""The rows of `monochord.evaluation.paper_rows` as tables for people, beside the paper's own."""

from collections.abc import Iterator, Sequence

from monochord.evaluation.paper import PAPER, reported
from monochord.evaluation.paper_rows import Row

QUANTITIES = {
    "position": ("position_mae_mm", "position_within_5mm", "position_r", "mm", "within 5 mm", 1e3),
    "force": ("force_mae_n", "force_within_0_2n", "force_r", "N", "within 0.2 N", 1.0),
}
"""Columns of the error, the share and the correlation; the unit, the share's name, and SI to the unit."""
WHOLE = "all objects"
PAPERS = "*the paper's sensor (real)*"
NOTHING = "-"


def paper_page(rows: Sequence[Row]) -> str:
    """Return rows as text in Markdown: position, force, contact and slip, a table for each condition.

    A row of the paper's own figures stands above those of an object and condition that it has.

    Examples
    --------
    ``monochord ablate features --rows docs/results/paper.json`` writes it beside the rows.
    """
    kind = "All sound is simulated. " if rows and all(row["simulated"] for row in rows) else ""
    intro = (
        f"{kind}Errors are of answered windows, shares of all touched ones: an abstention is a miss. "
        "In italics the paper's figures of its one real sensor: a reference, measured on other sound."
    )
    conditions = list(dict.fromkeys(row["condition"] for row in rows))
    parts = ["# The paper's tables", "", intro, ""]
    for quantity in QUANTITIES:
        for condition in conditions:
            title = f"## {quantity.capitalize()}, {condition}"
            parts += [title, "", *_errors(rows, quantity, condition), ""]
    for name in ("contact_accuracy", "slip_auc"):
        title = {"contact_accuracy": "Contact: told right", "slip_auc": "Slip: area under the curve"}[name]
        parts += [f"## {title}", "", *_told(rows, name, conditions), ""]
    return "\n".join(parts).rstrip() + "\n"


def _errors(rows: Sequence[Row], quantity: str, condition: str) -> Iterator[str]:
    mae, within, r, unit, share, factor = QUANTITIES[quantity]
    here = [row for row in rows if row["condition"] == condition]
    bodies = _bodies(here)
    yield _line(["feature", *(_plain(body) for body in bodies)])
    yield _rule(len(bodies))
    beside = [reported(quantity, body, condition) for body in bodies]
    if any(beside):
        cells = [
            NOTHING if one is None else f"*{factor * one.mae:.3g} {unit}, {one.within:.1%}, {one.r:.3f}*"
            for one in beside
        ]
        yield _line([PAPERS, *cells])
    for feature in dict.fromkeys(row["feature"] for row in here):
        held = {row["object"]: row for row in here if row["feature"] == feature}
        cells = [_cell(held.get(body), mae, within, r, unit) for body in bodies]
        yield _line([feature, *cells])
    yield ""
    yield f"Mean absolute error, share {share}, Pearson's r."


def _cell(row: Row | None, mae: str, within: str, r: str, unit: str) -> str:
    if row is None or row[mae] is None:
        return NOTHING
    return f"{row[mae]:.3g} {unit}, {row[within]:.1%}" + ("" if row[r] is None else f", {row[r]:.3f}")


def _told(rows: Sequence[Row], name: str, conditions: Sequence[str]) -> Iterator[str]:
    yield _line(["feature", *conditions])
    yield _rule(len(conditions))
    for feature in dict.fromkeys(row["feature"] for row in rows):
        cells: list[str] = []
        for condition in conditions:
            held = [row for row in rows if (row["feature"], row["condition"]) == (feature, condition)]
            whole = [row for row in held if row["object"] == WHOLE] or held
            value = whole[0][name] if whole else None
            cells.append(
                NOTHING if value is None else f"{value:.1%}" if name != "slip_auc" else f"{value:.3f}"
            )
        yield _line([feature, *cells])


def _bodies(rows: Sequence[Row]) -> list[str]:
    """Return the objects of rows, those of the paper first and in its order."""
    found = list(dict.fromkeys(row["object"] for row in rows))
    known = [body for body in PAPER["position"] if body in found]
    return known + [body for body in found if body not in known]


def _plain(body: str) -> str:
    return body.replace("_", " ")


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _rule(columns: int) -> str:
    return "|---|" + "---:|" * columns
