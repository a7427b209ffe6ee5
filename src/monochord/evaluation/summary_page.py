"""Rows of figures as pages in Markdown: one for the hardware suite, one for unseen builds."""

from collections.abc import Iterator, Sequence

from monochord.evaluation.summary import GROSS, SummaryRow
from monochord.metrics import normal_coverage

HEADS = (
    "answered", "position", "<= 5 mm", "force", "contact", "slip area", "1 se", "2 se", f"> {GROSS:g} se",
)  # fmt: skip
"""Heads of the columns of `cells`."""
INTERVALS = {"position_mae_mm": 1, "force_mae_n": 3}
"""Places among these of figures whose interval a page shows."""
BLANK = "-"
EXPLAINED = (
    "Errors are mean absolute ones over touched windows with an estimate; shares are over all touched "
    "windows, where an abstention is a miss. Under 1 se and 2 se is the share of truths within one and two "
    f"stated standard errors ({normal_coverage(1.0):.1%} and {normal_coverage(2.0):.1%} where they are "
    f"right), under > {GROSS:g} se the share of answered windows that are further off: confidently wrong."
)

COUNTED = (
    "The column of windows (`n` in the rows) counts touched windows of 0.1 s whose position or force is "
    "known, answered or not. All figures of position and force are of these. Windows of known touches, of "
    "the taps that align the streams, and with the beginning or the end of a touch are left out. Contact is "
    "also scored on untouched windows, which `n` does not count: where only motors sound, it is 0."
)


def cells(row: SummaryRow) -> tuple[str, ...]:
    """Return the figures of a row as texts, in the order of `HEADS`.

    >>> row = dict.fromkeys(("answered", "position_mae_mm", "position_within_5mm", "force_mae_n"), 1.0)
    >>> row |= dict.fromkeys(("contact_accuracy", "slip_auc", "coverage_1se", "coverage_2se", "gross_share"))
    >>> cells(row)
    ('100.0 %', '1 mm', '100.0 %', '1 N', '-', '-', '-', '-', '-')
    """
    return (
        _share(row["answered"]),
        _number(row["position_mae_mm"], " mm"),
        _share(row["position_within_5mm"]),
        _number(row["force_mae_n"], " N"),
        _share(row["contact_accuracy"]),
        BLANK if row["slip_auc"] is None else f"{row['slip_auc']:.3f}",
        _share(row["coverage_1se"]),
        _share(row["coverage_2se"]),
        BLANK if row["gross_share"] is None else f"{100.0 * row['gross_share']:.2f} %",
    )


def hardware_page(rows: Sequence[SummaryRow], figure: str = "") -> str:
    """Return the rows of the hardware suite as text: a table for each estimator, a line for each condition.

    Parameters
    ----------
    rows
        As `monochord.evaluation.hardware` gives them.
    figure
        File of a figure of them beside the page, if there is one.

    Examples
    --------
    ``monochord evaluate MODEL --suite hardware --out FOLDER`` writes it as ``hardware.md``.
    """
    parts = [
        "# On sensors as hardware may have them",
        "",
        "All sound is simulated: the same touches in every condition, with one thing changed in each. "
        '"Tuned" means that the string is known as tuned, as monochord tune measures it. ' + EXPLAINED,
        "",
    ]
    parts += [f"![errors by condition]({figure})", ""] if figure else []
    for model in dict.fromkeys(row["model"] for row in rows):
        own = [row for row in rows if row["model"] == model]
        parts += [f"## {model.replace('_', ' ')}", "", *_table(own), ""]
    return "\n".join(parts).rstrip() + "\n"


def builds_page(rows: Sequence[SummaryRow]) -> str:
    """Return the rows of unseen builds as text: a table for each world, condition and object.

    Examples
    --------
    ``monochord transfer MODEL --sessions FILES --rows docs/results/builds.json`` writes it beside the rows.
    """
    parts = [
        "# Unseen builds",
        "",
        "Each build is adapted to by its first touches, of known position and force, and scored on the "
        'touches after them. "Ridge" is ridge regression on the same feature, fitted to the same training '
        'windows and corrected by the same touches; "from scratch" is one fitted to these touches '
        "alone. "
        + EXPLAINED
        + " In brackets are intervals of 95 %, drawn over builds where there are five or more.",
        "",
        COUNTED,
        "",
    ]
    kinds = dict.fromkeys((row["world"], row["condition"], row["object"]) for row in rows)
    for world, condition, body in kinds:
        own = [
            row for row in rows if (row["world"], row["condition"], row["object"]) == (world, condition, body)
        ]
        where = f"{world} world, simulated" if world else "real sound"
        parts += [f"## {condition.capitalize()}, {body.replace('_', ' ')}, {where}", "", *_curves(own), ""]
    return "\n".join(parts).rstrip() + "\n"


def _curves(rows: Sequence[SummaryRow]) -> Iterator[str]:
    yield "| " + " | ".join(["estimator", "touches", *HEADS, "builds", "windows"]) + " |"
    yield "|---|" + "---:|" * (len(HEADS) + 3)
    for row in rows:
        figures = list(cells(row))
        for name, at in INTERVALS.items():
            figures[at] += _interval(row, name)
        name = row["model"].replace("_", " ")
        line = [name, str(row["touches"]), *figures, str(row["builds"]), str(row["n"])]
        yield "| " + " | ".join(line) + " |"


def _interval(row: SummaryRow, name: str) -> str:
    low_high = row.get("intervals", {}).get(name)
    return f" ({low_high[0]:.3g} to {low_high[1]:.3g})" if low_high else ""


def _table(rows: Sequence[SummaryRow]) -> Iterator[str]:
    yield "| " + " | ".join(["condition", *HEADS, "windows"]) + " |"
    yield "|---|" + "---:|" * (len(HEADS) + 1)
    for row in rows:
        yield "| " + " | ".join([row["condition"], *cells(row), str(row["n"])]) + " |"


def _number(value: float | None, unit: str) -> str:
    return BLANK if value is None else f"{value:.3g}{unit}"


def _share(value: float | None) -> str:
    return BLANK if value is None else f"{100.0 * value:.1f} %"
