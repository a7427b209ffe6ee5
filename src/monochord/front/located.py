"""Where a recorded string is stopped or touched: the result of `monochord.front.locate.locate`."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from monochord.core.pitch_names import pitch_name
from monochord.core.ranges import checked
from monochord.core.types import Floats
from monochord.core.units import Hertz, Metres, Seconds
from monochord.perception.model.table import PredictionTable

if TYPE_CHECKING:
    from pandas import DataFrame

NUT, PICKUP = "the nut", "pickup 1"
"""What positions count from."""
SAME_FRET = 0.5
"""Largest distance in frets of two windows of one held note."""
PAUSE: Seconds = 0.1
"""Longest time without a position within one held note."""
LEAST_WINDOWS = 3
"""Fewest windows of a held note."""
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
_QUANTITY = re.compile(r"(?: (?:of|by))? ?#(?:(?: and| to) #)*(?: (?:Hz|%|mm|s|N|dB)(?!\w))?")


class Place(NamedTuple):
    """One window: where the string is stopped, or why this is not known.

    `time` is the window's start in s; `position` and its standard error `std` are in m, `frequency` in Hz.
    `fret` is 12 log2(frequency / open frequency), and `note` the note's name with its deviation in cents.
    Numbers are NaN and texts empty where unknown; `reason` is empty where the position is known.
    """

    time: Seconds
    position: Metres
    std: Metres
    frequency: Hertz
    fret: float
    note: str
    reason: str

    def tree(self, *, frets: bool = False) -> dict[str, Any]:
        """Return the window as JSON has it, None where unknown; `frets` adds fret and note."""
        values = {
            "time": self.time,
            "frequency": self.frequency,
            "position": self.position,
            "position_std": self.std,
            "valid": not self.reason,
            "why_not": self.reason,
        }
        if frets:
            values |= {"fret": round(self.fret, 1), "note": self.note or None}
        return {
            name: None if isinstance(value, float) and math.isnan(value) else value
            for name, value in values.items()
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldNote:
    """Consecutive windows at one place, from `begin` to `end` in s: medians of what `Place` has."""

    begin: Seconds
    end: Seconds
    position: Metres
    std: Metres
    frequency: Hertz
    fret: float

    @property
    def note(self) -> str:
        """Name of the note, with its deviation in cents."""
        return pitch_name(self.frequency)


@dataclass(frozen=True, kw_only=True, eq=False)
class Located:
    """Where a recorded string is stopped or touched: an immutable table with a row for each window.

    ``len(places)`` is the number of windows, and iteration yields a `Place` for each.

    Attributes
    ----------
    table
        Position, frequency and fret of each window as estimates, with standard errors and reasons.
    origin
        What positions count from: the nut of a stopped string, or pickup 1.
    length, open_frequency
        Of the string, in m and in Hz; NaN where unknown.
    window
        Length of a window, in s.
    assumptions
        What the positions assume.
    inputs
        What is wrong with two channels that are not two microphones.
    heard
        What sounds where few windows have a position; else empty.
    simulated
        Whether the sound is simulated.
    interrupted
        Whether Control-C ended the recording early.
    """

    table: PredictionTable
    origin: str
    length: Metres
    open_frequency: Hertz
    window: Seconds
    assumptions: tuple[str, ...]
    inputs: tuple[str, ...]
    heard: str
    simulated: bool = False
    interrupted: bool = False

    @property
    def time(self) -> Floats:
        """Start (n,) of each window, in s."""
        return self.table.time

    @property
    def position(self) -> Floats:
        """Position (n,) in m, NaN where unknown."""
        return self.table.position.value

    @property
    def std(self) -> Floats:
        """Standard error (n,) of the position in m, NaN where unknown."""
        return self.table.position.std

    @property
    def frequency(self) -> Floats:
        """Frequency (n,) of the sounding part in Hz, NaN where unknown."""
        return self.table.frequency.value

    @property
    def fret(self) -> Floats:
        """Fret (n,): 12 log2(frequency / open frequency) of a stopped string, NaN where unknown."""
        return self.table.fret.value

    @cached_property
    def note(self) -> NDArray[np.str_]:
        """Name (n,) of the note with its deviation in cents, empty where unknown."""
        named = zip(self.fret, self.frequency, strict=True)
        return np.array([pitch_name(each) if math.isfinite(fret) else "" for fret, each in named], np.str_)

    @property
    def reason(self) -> NDArray[np.str_]:
        """Why a window (n,) has no position, empty where it has one."""
        return self.table.position.reason

    def __len__(self) -> int:
        return len(self.table)

    def __iter__(self) -> Iterator[Place]:
        columns = (self.time, self.position, self.std, self.frequency, self.fret, self.note, self.reason)
        return (Place(*row) for row in zip(*(each.tolist() for each in columns), strict=True))

    def held_notes(self) -> list[HeldNote]:
        """Return the notes of a stopped string, in order of time."""
        notes, first = list[HeldNote](), 0
        known = np.flatnonzero(np.isfinite(self.fret))
        for k in range(1, len(known) + 1):
            if k < len(known) and self._continues(known[first:k], known[k]):
                continue
            if k - first >= LEAST_WINDOWS:
                notes.append(self._held(known[first:k]))
            first = k
        for k, (before, after) in enumerate(pairwise(notes)):
            if before.end > after.begin:  # by windows that hold both
                change = 0.5 * (before.end + after.begin)
                notes[k], notes[k + 1] = replace(notes[k], end=change), replace(after, begin=change)
        return notes

    def _continues(self, held: NDArray[np.intp], window: np.intp) -> bool:
        """Return whether a window has the note of windows before it, by the latest of them."""
        latest = held[-LEAST_WINDOWS:]
        pause = self.time[window] - self.time[held[-1]] - self.window
        return pause <= PAUSE and abs(self.fret[window] - np.median(self.fret[latest])) <= SAME_FRET

    def _held(self, windows: NDArray[np.intp]) -> HeldNote:
        columns = (self.position, self.std, self.frequency, self.fret)
        position, std, frequency, fret = (float(np.median(column[windows])) for column in columns)
        return HeldNote(
            begin=float(self.time[windows[0]]),
            end=float(self.time[windows[-1]]) + self.window,
            position=position,
            std=std,
            frequency=frequency,
            fret=fret,
        )

    def reasons(self) -> dict[str, int]:
        """Return the number of windows without a position by kind of reason, most frequent first.

        Reasons that differ only in their numbers are of one kind; numbers that they share stay.
        """
        kinds: dict[str, list[tuple[list[str], int]]] = {}
        reasons, counts = np.unique(self.reason[self.reason != ""], return_counts=True)
        for reason, count in zip(reasons.tolist(), counts.tolist(), strict=True):
            kinds.setdefault(_NUMBER.sub("#", reason), []).append((_NUMBER.findall(reason), count))
        counted = {
            _kind(pattern, [numbers for numbers, _ in each]): sum(count for _, count in each)
            for pattern, each in kinds.items()
        }
        return dict(sorted(counted.items(), key=lambda item: -item[1]))

    @checked
    def lines(self, *, frets: bool = False) -> list[str]:
        """Summarise the places as lines of text: medians, and the reasons of windows without a position.

        `frets` adds the fret and the name of each held note.
        """
        valid, total = int(self.table.position.valid.sum()), len(self)
        lines = [f"  {self.heard}"] if self.heard else []
        lines += [f"  windows with a position  {valid} of {total} ({100 * valid / max(total, 1):.1f} %)"]
        if valid:
            low, median, high = 1e3 * np.nanquantile(self.position, [0.1, 0.5, 0.9])
            lines += [
                f"  position                 {median:.2f} mm from {self.origin} (median)",
                f"  standard error           {1e3 * np.nanmedian(self.std):.2f} mm (median)",
                f"  middle four fifths       {low:.2f} to {high:.2f} mm",
            ]
        frequency = self.frequency[self.table.position.valid & self.table.frequency.valid]
        if len(frequency):
            lines.append(f"  frequency                {np.median(frequency):.3f} Hz (median)")
        lines += [f"  {line}" for line in self.assumptions if valid]
        lines += [
            f"  no position              {100 * count / total:.1f} % of windows: {kind}"
            for kind, count in self.reasons().items()
        ]
        lines += [f"  inputs                   {each}" for each in self.inputs]
        return lines + (self._fret_lines() if frets else [])

    def _fret_lines(self) -> list[str]:
        held = self.held_notes()
        if not held:
            none = "no note is held" if self.origin == NUT else "none: the string is touched, not stopped"
            return [f"  frets                    {none}"]
        return ["      from        to    fret  note           position"] + [
            f"  {note.begin:6.2f} s  {note.end:6.2f} s  {note.fret:6.1f}  {note.note:<8} "
            f"{1e3 * note.position:7.1f} mm +- {1e3 * note.std:.1f}"
            for note in held
        ]

    def to_pandas(self) -> "DataFrame":
        """Return a data frame indexed by time in s, with the other values of `Place` as columns.

        Raises
        ------
        MissingLibraryError
            If pandas is not installed; the error says how to install it.
        """
        frame = self.table.to_pandas()
        names = ("position", "std", "frequency", "fret", "note", "reason")
        return type(frame)({name: getattr(self, name) for name in names}, index=frame.index)

    def __repr__(self) -> str:
        valid = int(self.table.position.valid.sum())
        if not valid:
            reason = next(iter(self.reasons()), "no windows")
            return f"Located({len(self)} windows, none with a position: {reason})"
        place = f"{1e3 * np.nanmedian(self.position):.1f} mm from {self.origin}"
        return f"Located({len(self)} windows, {valid} with a position: {place} (median))"

    def _repr_html_(self) -> str:
        return self.table._repr_html_()


def _kind(pattern: str, numbers: Sequence[Sequence[str]]) -> str:
    """Return reasons of one pattern as one text: numbers that differ are left out, with their units."""
    slots = [column[0] if len(set(column)) == 1 else "#" for column in zip(*numbers, strict=True)]
    text = re.sub("#", lambda _: slots.pop(0), pattern)
    parts = [_QUANTITY.sub("", part).strip() for part in text.split(", ")]
    return ", ".join(part for part in parts if part)
