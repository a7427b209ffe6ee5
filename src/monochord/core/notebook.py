"""Display of objects at a prompt and in a notebook: short texts, HTML tables, and axes for plots."""

from collections.abc import Iterable, Sequence
from html import escape
from textwrap import shorten, wrap
from typing import TYPE_CHECKING

from monochord.core.errors import required

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ROW_HEIGHT, WIDTH = 1.8, 7.2
"""Size of a panel in inches."""
COLUMNS = 120
"""Longest line of a text at a prompt, in characters."""


def html_table(title: str, rows: Iterable[Sequence[str]], header: Sequence[str] = ()) -> str:
    """Return a table in HTML: a title, column names where given, and rows of texts.

    >>> html_table("a < b", [("length", "0.2 m")])
    '<table><caption>a &lt; b</caption><tbody><tr><td>length</td><td>0.2 m</td></tr></tbody></table>'
    """
    head = f"<thead>{_row(header, 'th')}</thead>" if header else ""
    body = "".join(_row(row, "td") for row in rows)
    return f"<table><caption>{escape(title)}</caption>{head}<tbody>{body}</tbody></table>"


def _row(cells: Sequence[str], tag: str) -> str:
    return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"


def lines(title: str, facts: Iterable[tuple[str, str]]) -> str:
    r"""Return a title and facts as text for a prompt: three lines, of `COLUMNS` characters each, at most.

    Facts without a text are left out, and so are, with a mark, those that do not fit.

    >>> lines("Model", [("sensor", "prototype"), ("notes", ""), ("training", "12 sessions")])
    'Model\n  sensor: prototype; training: 12 sessions'
    """
    text = "; ".join(f"{name}: {value}" for name, value in facts if value)
    rows = wrap(text, COLUMNS, initial_indent="  ", subsequent_indent="  ", max_lines=2, placeholder=" ...")
    return "\n".join([shorten(title, COLUMNS, placeholder=" ..."), *rows])


def panels(names: Sequence[str], across: str = "time (s)") -> "tuple[Axes, ...]":
    """Return the axes of a new pyplot figure, one below the other, each labelled with its name."""
    with required("A plot", "matplotlib >= 3.9", "figures"):
        from matplotlib import pyplot as plt  # noqa: PLC0415
    size = (WIDTH, ROW_HEIGHT * len(names) + 0.6)
    figure = plt.figure(figsize=size, layout="constrained")
    rows: list[Axes] = []
    for number, name in enumerate(names, 1):
        axes = figure.add_subplot(len(names), 1, number, sharex=rows[0] if rows else None)
        axes.set_ylabel(name)
        axes.tick_params(labelbottom=number == len(names))
        rows.append(axes)
    rows[-1].set_xlabel(across)
    return tuple(rows)
