"""The printed table of scores: a row for each object, condition and estimator."""

import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, overload

from monochord.core.errors import required
from monochord.evaluation.scorecard import Scorecard, ScoreTable
from monochord.evaluation.scores import Detection, Regression

if TYPE_CHECKING:
    import pandas as pd

HEADS = ("windows", "answered", "error", "<= 5 mm", "r", "error", "<= 0.2 N", "r", "contact", "slip area")
WIDTHS = (9, 10, 10, 9, 7, 10, 10, 7, 9, 11)
"""Columns of the table as text, and their least widths."""
LABELS = ("object", "condition", "estimator")
NUMBERS = (
    "windows", "answered", "position_error", "position_within", "position_r", "force_error", "force_within",
    "force_r", "contact_accuracy", "slip_area",
)  # fmt: skip
"""Columns of the table as values."""


@dataclass(frozen=True, slots=True)
class Scores(Sequence[Mapping[str, Any]]):
    """Scores of all touched windows: a row for each object, condition and estimator.

    A row maps `LABELS` and `NUMBERS` to values: ``position_error`` and ``force_error`` are mean absolute
    errors in m and N, ``position_within`` and ``force_within`` the shares within 5 mm and 0.2 N, and
    ``slip_area`` the area under the curve; None where there is no score. As text and in a notebook, the table
    uses mm and N.

    >>> row = dict.fromkeys(NUMBERS, None) | {"object": "wood", "condition": "clean", "estimator": "model"}
    >>> scores = Scores([row | {"windows": 40, "answered": 1.0, "position_error": 0.0012}])
    >>> scores.lines()[1].split()[:8]
    ['wood', 'clean', 'model', '40', '100.0', '%', '1.2', 'mm']
    """

    rows: Sequence[Mapping[str, Any]]

    @overload
    def __getitem__(self, index: int) -> Mapping[str, Any]: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[Mapping[str, Any]]: ...
    def __getitem__(self, index: int | slice) -> Mapping[str, Any] | Sequence[Mapping[str, Any]]:
        return self.rows[index]

    def __len__(self) -> int:
        return len(self.rows)

    def __str__(self) -> str:
        return "\n".join(self.lines())

    __repr__ = __str__

    def lines(self) -> list[str]:
        """Return the table as text lines, header first."""
        table = self._texts()
        longest = [max(map(len, column)) for column in zip(*table, strict=True)]
        numbers = [max(size + 2, width) for size, width in zip(longest[len(LABELS) :], WIDTHS, strict=True)]
        lines: list[str] = []
        for row in table:
            names = [f"  {text:<{width}}" for text, width in zip(row[: len(LABELS)], longest, strict=False)]
            cells = zip(row[len(LABELS) :], numbers, strict=True)
            lines.append("".join([*names, *(f"{text:>{width}}" for text, width in cells)]))
        return lines

    def to_pandas(self) -> "pd.DataFrame":
        """Return the table as a data frame of values; raises `InputError` where pandas is not installed."""
        with required("A table as a data frame", "pandas >= 2.2", "pandas"):
            import pandas as pd  # noqa: PLC0415
        return pd.DataFrame([dict(row) for row in self.rows], columns=[*LABELS, *NUMBERS])

    def _repr_html_(self) -> str:
        head, *rows = (
            "".join(f"<{tag}>{html.escape(text)}</{tag}>" for text in row)
            for row, tag in zip(self._texts(), ["th", *["td"] * len(self.rows)], strict=True)
        )
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"

    def _texts(self) -> list[tuple[str, ...]]:
        """Return the cells as text, header first."""
        return [(*LABELS, *HEADS), *map(_cells, self.rows)]


def score_rows(card: Scorecard) -> Scores:
    """Return the rows of a scorecard and its baselines, over all touched windows."""
    tables: Mapping[str, Scorecard | ScoreTable] = {card.estimator: card, **card.baselines}
    shown = [(row.object, row.condition) for row in card.table if row.state == "touched"]
    return Scores(
        [
            {"object": body, "condition": condition, "estimator": name, **_numbers(table, body, condition)}
            for body, condition in shown
            for name, table in tables.items()
        ]
    )


def _numbers(scores: Scorecard | ScoreTable, body: str, condition: str) -> dict[str, Any]:
    key = (body, condition, "touched")
    row = next((row for row in scores.table if (row.object, row.condition, row.state) == key), None)
    if row is None:
        return dict.fromkeys(NUMBERS)
    contact = scores.contact.get(body, {}).get(condition)
    slip: Detection | None = scores.slip.get(body, {}).get(condition)
    values = (
        row.position.windows,
        row.position.answered,
        *_errors(row.position),
        *_errors(row.force),
        contact.accuracy.value if contact else None,
        slip.area.value if slip else None,
    )
    return dict(zip(NUMBERS, values, strict=True))


def _errors(score: Regression) -> tuple[float | None, float | None, float | None]:
    return score.mae.value, score.within.value, score.r.value


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    def text(name: str, pattern: str, factor: float = 1.0) -> str:
        return "-" if row[name] is None else pattern.format(factor * row[name])

    share = "{:.1f} %"
    return (
        row["object"],
        row["condition"],
        row["estimator"].replace("_", " "),
        "-" if row["windows"] is None else str(row["windows"]),
        text("answered", share, 100.0),
        text("position_error", "{:.3g} mm", 1e3),
        text("position_within", share, 100.0),
        text("position_r", "{:.3f}"),
        text("force_error", "{:.3g} N"),
        text("force_within", share, 100.0),
        text("force_r", "{:.3f}"),
        text("contact_accuracy", share, 100.0),
        text("slip_area", "{:.4f}"),
    )
