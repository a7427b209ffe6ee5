"""Notes on the sensor's health in words: for the terminal's frame, and as news for a log."""

import textwrap
from collections.abc import Mapping

from rich.text import Text

from monochord.core.printable import printable
from monochord.core.units import Seconds
from monochord.live.health import Level, Note
from monochord.live.sinks.base import Update

LABELS: Mapping[Level, str] = {"error": "error", "warning": "warning", "info": "note"}
"""What a note is called by its level, the worst first."""
STYLES: Mapping[Level, str] = {"error": "bold red", "warning": "bold orange1", "info": "bold cyan"}
BRIEF: Seconds = 0.5
"""An info that lasts for less, such as that a new touch settles, is not shown."""
INDENT = 11
"""Columns before the words."""
MIN_WIDTH = 8
"""Columns of words, however narrow the terminal."""


def current(update: Update) -> list[Note]:
    """Return the notes of an update, the worst first, then the oldest, without an info that is `BRIEF`."""
    now, order = update.prediction.time, list(LABELS)
    shown = [note for note in update.notes if note.level != "info" or now - note.since >= BRIEF - 1e-9]
    return sorted(shown, key=lambda note: order.index(note.level))


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
    """Return the notes that there are now, by key, and a line for each that has ended or is new.

    Parameters
    ----------
    before
        What this returned for the update before; empty at first.
    update
        The update now.

    Returns
    -------
    tuple[Mapping[str, Note], list[str]]
        One that only changes its sentence, as where something is counted, is no news; one that changes its
        level is.
    """
    if not update.notes and not before:
        return before, []
    notes = {note.key: note for note in current(update)}
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
