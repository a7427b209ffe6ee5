"""The sensor's health notes as text: in the terminal's frame, and as log lines."""

import textwrap
from collections.abc import Mapping

from rich.text import Text

from monochord.core.printable import printable
from monochord.live.health import Level, Note, shown_notes
from monochord.live.update import Update

LABELS: Mapping[Level, str] = {"error": "error", "warning": "warning", "info": "note"}
"""Label of a note by level."""
STYLES: Mapping[Level, str] = {"error": "bold red", "warning": "bold orange1", "info": "bold cyan"}
INDENT = 11
"""Columns before the text."""
MIN_WIDTH = 8
"""Smallest text width in columns, however narrow the terminal."""


def wrapped(note: Note, columns: int) -> list[Text]:
    """Return sentence and remedy as lines of at most `columns`, beside the level.

    >>> note = Note(key="hum", level="error", sentence="It hums.", remedy="Check the cables.", since=0.0)
    >>> [line.plain for line in wrapped(note, 32)]
    ['  error    It hums. Check the', '           cables.']
    """
    sentence, text = _one_line(note.sentence), _one_line(f"{note.sentence} {note.remedy}")
    whole, style = Text(text), STYLES[note.level]
    whole.stylize(style, 0, len(sentence))
    first, lines = 0, list[Text]()
    width = max(columns - INDENT - 1, MIN_WIDTH)
    for part in textwrap.wrap(text, width, break_on_hyphens=False):
        first = text.index(part, first)
        label = "" if lines else f"  {LABELS[note.level]}"
        lines.append(Text.assemble((label.ljust(INDENT), style), whole[first : first + len(part)]))
        first += len(part)
    return lines


def clipped(note: Note, name: str, columns: int) -> Text:
    """Return the note on one of several strings as one line of at most `columns`."""
    style = STYLES[note.level]
    line = Text.assemble(
        (f"{name}  {LABELS[note.level]}  {_one_line(note.sentence)}", style), f" {_one_line(note.remedy)}"
    )
    line.truncate(columns, overflow="ellipsis")
    return line


def news(before: Mapping[str, Note], update: Update) -> tuple[Mapping[str, Note], list[str]]:
    """Return the current notes by key, and a line for each new or ended note.

    `before` are the notes returned for the previous update; empty at first.
    A note whose sentence alone changes, such as a counter, gives no line; a change of level does.
    """
    if not update.notes and not before:
        return before, []
    notes = {note.key: note for note in shown_notes(update.notes, update.time)}
    head = f"{update.string}  " if update.string else ""
    head += f"{update.prediction.time:8.2f} s  "
    ended = [f"{head}ended: {note.sentence}" for key, note in before.items() if key not in notes]
    new = [
        f"{head}{LABELS[note.level]}: {note.sentence} {note.remedy}".rstrip()
        for key, note in notes.items()
        if key not in before or before[key].level != note.level
    ]
    return notes, ended + new


def _one_line(text: str) -> str:
    return printable(" ".join(text.split()))
