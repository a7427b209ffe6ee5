"""The terminal's frame: the drawn string, estimates, levels, the stream's counters, last event and notes."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import groupby
from operator import itemgetter

import numpy as np
from rich.text import Text

from monochord.core.labels import SETTLED
from monochord.core.printable import printable
from monochord.core.reasons import Reason
from monochord.core.timing import Percentiles
from monochord.core.types import Estimate, Signal, Truth
from monochord.core.units import Metres, Newtons
from monochord.dsp.levels import LOUD_LEVEL, levels
from monochord.live.events import Event
from monochord.live.health import shown_notes
from monochord.live.sinks import _notes, _string
from monochord.live.sinks._string import TOUCH, TRUTH
from monochord.live.update import Update

LABEL, DIM, WARN, BAND = "grey62", "grey42", "bold orange1", "cyan"
MAX_FORCE: Newtons = 2.0
"""Force at the right end of its scale, in N; larger values are drawn at that end."""
WORDS = {"contact": ("untouched", "touched"), "slip": ("rests", "slides")}
"""Words for a probability near 0 and near 1."""
ESTIMATED, TRUE, BOTH = "●", "◆", "◉"
NAMED_COLUMNS = 72
"""Smallest width in columns at which the ends of a scale are named."""
FLOOR = -60.0  # decibels at the left end of a level meter
EIGHTHS = " ▏▎▍▌▋▊▉"
ORDER = ("contact", "position", "force", "slip", "frequency")  # what a person looks for first
NORMAL_REASONS = (Reason.NO_CONTACT, Reason.NOT_ESTIMATED)
"""Abstention reasons that are not problems."""
TRACK_COLUMN = 37
"""Columns before a track."""
MIN_TRACK = 8
"""Smallest readable width of a track, in cells."""
MAX_EVENTS = 3
"""Number of events in a plain line, which is printed once a second however many there are."""


class Rank(IntEnum):
    """Priority of each part on a terminal that is too low for all of them."""

    EXTRA = 0
    TRACKED = 1
    BLANK = 2
    EVENT = 3
    INFO = 4
    LEGEND = 5
    WARNING = 6
    LATENCY = 7
    COUNTERS = 8
    LEVELS = 9
    PICTURE = 10
    TITLE = 11
    ESTIMATE = 12
    ERROR = 13


NOTE_RANKS = {"error": Rank.ERROR, "warning": Rank.WARNING, "info": Rank.INFO}


@dataclass(frozen=True, slots=True)
class FrameLines:
    """Lines of a frame that are shown or left out together; of a note the first line may stay alone."""

    rank: Rank
    lines: Sequence[Text]
    is_note: bool = False


def frame(
    update: Update,
    signal: Signal,
    length: Metres,
    latency: Percentiles,
    columns: int,
    rows: int,
    ends: tuple[str, str] = ("nut", "bridge"),
    last: Event | None = None,
) -> list[Text]:
    """Return the picture of one update as lines, `columns` wide and fewer than `rows`.

    `length` is that of the drawn string, `ends` names its ends, and `last` is the last event.
    """
    truth = update.truth
    sound_levels = [levels(channel) for channel in update.window.samples]
    loudness = [max(0.0, 1.0 - rms / FLOOR) if math.isfinite(rms) else 0.0 for rms, _ in sound_levels]
    swings = loudness if len(loudness) > 1 else [0.0, loudness[0]]
    position, force = (update.prediction.estimate(name) for name in ("position", "force"))
    picture = _string.draw(
        columns - 4,
        length,
        (position.value, position.std) if position.valid else None,
        truth.get("position") if truth.get("contact") else None,
        force.value if force.valid else None,
        swings,
        _caption(truth),
        ends,
    )
    blank = FrameLines(Rank.BLANK, [Text()])
    meters = [_meter(k + 1, rms, peak, columns) for k, (rms, peak) in enumerate(sound_levels)]
    learned = any(name in update.prediction.estimates for name in WORDS)
    middle = [*_estimates(update, length, columns), *([legend(truth)] if learned else [])]
    ranks = [*[Rank.ESTIMATE] * (len(ORDER) - 1), Rank.LEGEND]
    parts = [
        FrameLines(Rank.TITLE, [_title(update, signal, columns)]),
        blank,
        FrameLines(Rank.PICTURE, [Text.assemble("  ", line) for line in picture]),
        blank,
        *(FrameLines(ranks[k] if k < len(ranks) else Rank.EXTRA, [line]) for k, line in enumerate(middle)),
        blank,
        FrameLines(Rank.LEVELS, meters),
        blank,
        FrameLines(Rank.LATENCY, [_latency(latency)]),
        FrameLines(Rank.COUNTERS, [_health(update)]),
    ]
    if last is not None:
        parts.append(FrameLines(Rank.TRACKED, [_tracked(update)]))
        parts.append(FrameLines(Rank.EVENT, [Text.assemble(("  event    ", LABEL), event_in_words(last))]))
    notes = shown_notes(update.notes, update.time)
    parts.extend(
        FrameLines(NOTE_RANKS[note.level], _notes.wrapped(note, columns), is_note=True) for note in notes
    )
    return fitted(parts, rows - 1)


def several(updates: Iterable[Update], latency: Percentiles, columns: int, rows: int) -> list[Text]:
    """Return a line for each of several strings, and one for its worst note, fewer than `rows`.

    Where both do not fit, an error replaces the estimates.
    """
    parts = list[FrameLines]()
    for update in updates:
        worst = next(iter(shown_notes(update.notes, update.time)), None)
        rank = Rank.PICTURE if worst is not None and worst.level == "error" else Rank.ESTIMATE
        parts.append(FrameLines(rank, [Text(printable(plain(update, latency)))]))
        if worst is not None:
            line = _notes.clipped(worst, update.string, columns)
            parts.append(FrameLines(NOTE_RANKS[worst.level], [line]))
    return fitted(parts, rows - 1)


def fitted(parts: Sequence[FrameLines], rows: int) -> list[Text]:
    """Return the lines of the parts that fit into `rows`, highest rank first, then in order.

    >>> ranks = {Rank.TITLE: "a", Rank.BLANK: "", Rank.ERROR: "b"}
    >>> parts = [FrameLines(rank, [Text(text)]) for rank, text in ranks.items()]
    >>> [line.plain for line in fitted(parts, 2)]
    ['a', 'b']
    """
    kept, free = dict[int, Sequence[Text]](), max(rows, 1)
    for k in sorted(range(len(parts)), key=lambda k: -parts[k].rank):
        lines = parts[k].lines
        if parts[k].is_note and 0 < free < len(lines):
            lines = [*lines[: free - 1], lines[free - 1] + "…"]
        if len(lines) <= free:
            kept[k] = lines
            free -= len(lines)
    return [line for k in sorted(kept) for line in kept[k]]


def plain(update: Update, latency: Percentiles, events: Sequence[Event] = ()) -> str:
    """Return one line without any drawing, for a log or a pipe.

    `events` are those since the previous line.
    """
    health = update.health
    estimates = ", ".join(_in_words(name, e) for name, e in _ordered(update.prediction.estimates.items()))
    rms = " / ".join(f"{levels(channel)[0]:.0f}" for channel in update.window.samples)
    p99 = f"{1e3 * latency.p99:.2f}"
    true = f"; {_truth_in_words(update.truth)}" if update.truth else ""
    name = f"{update.string}  " if update.string else ""
    return (
        f"{name}{update.prediction.time:8.2f} s  {estimates}{true}; level {rms} dB, "
        f"latency p99 {p99} ms, gaps {health.gaps}, dropped {health.dropped}, xruns {health.xruns}, "
        f"skipped {update.skipped}{_events_in_words(events)}"
    )


def event_in_words(event: Event) -> str:
    """Return an event as text.

    >>> event_in_words(Event(name="contact", on=True, time=12.34, delay=0.03, confidence=0.98))
    'touched at 12.34 s, decided 30 ms later, 98 %'
    """
    delay = f"{1e3 * event.delay:.0f} ms"
    return f"{_change(event)} at {event.time:.2f} s, decided {delay} later, {_percent(event.confidence)}"


def _events_in_words(events: Sequence[Event]) -> str:
    """Return the newest events as the end of a plain line, with their total where some are left out."""
    if not events:
        return ""
    more = f"{len(events)} events, the last: " if len(events) > MAX_EVENTS else ""
    words = [f"{_change(e)} at {e.time:.2f} s ({_percent(e.confidence)})" for e in events[-MAX_EVENTS:]]
    return f"; {more}{', '.join(words)}"


def _change(event: Event) -> str:
    return WORDS[event.name][event.on]


def quantity(value: float, unit: str) -> str:
    """Return a value with its unit as text; lengths are in millimetres.

    >>> quantity(0.22748, "m")
    '227.5 mm'
    >>> quantity(8.134e-5, "")
    '8.1e-05'
    """
    shown, name = (1e3 * value, "mm") if unit == "m" else (value, unit)
    if not name and 0.0 < abs(shown) < 0.1:
        return f"{shown:.2g}"
    if 0.0 < abs(shown) < 0.1:
        return f"{shown:.3f} {name}".rstrip()
    digits = 2 if abs(shown) < 10.0 else 1
    return f"{shown:.{digits}f} {name}".rstrip()


def _title(update: Update, signal: Signal, columns: int) -> Text:
    inputs = "1 microphone" if signal.channels == 1 else f"{signal.channels} microphones"
    left = Text.assemble(("  monochord", "bold"), (f"   {signal.sample_rate / 1e3:g} kHz, {inputs}", LABEL))
    right = f"{update.prediction.time:.1f} s  "
    return left + Text(right.rjust(columns - len(left)), LABEL)


def _ordered(estimates: Iterable[tuple[str, Estimate]]) -> list[tuple[str, Estimate]]:
    return sorted(estimates, key=lambda item: ORDER.index(item[0]) if item[0] in ORDER else len(ORDER))


def _in_words(name: str, estimate: Estimate) -> str:
    if not estimate.valid:
        # "no contact" would be an answer.
        missing = f"{name} not estimated" if name in WORDS else f"no {name}"
        return f"{missing} ({estimate.reason})"
    if name in WORDS:
        word, share = probability_in_words(name, estimate.value)
        return f"{word} ({share})"
    return f"{name} {quantity(estimate.value, estimate.unit)} +- {quantity(estimate.std, estimate.unit)}"


def _estimates(update: Update, length: Metres, columns: int) -> Iterator[Text]:
    for name, estimate in _ordered(update.prediction.estimates.items()):
        line = Text.assemble((f"  {name.replace('_', ' '):<12}", LABEL))
        if not estimate.valid:
            line.append(f"{'--':>10}", DIM)
            line.append(f"  {estimate.reason}", DIM if Reason.of(estimate.reason) in NORMAL_REASONS else WARN)
        elif name in WORDS:
            word, share = probability_in_words(name, estimate.value)
            line.append(f"{word:>10}", "bold").append(f"  {share:<11}", LABEL)
        else:
            style = TOUCH if name == "position" else "bold"
            line.append(f"{quantity(estimate.value, estimate.unit):>10}", style)
            spread = quantity(estimate.std, estimate.unit) if math.isfinite(estimate.std) else "?"
            line.append(f"  ± {spread:<9}", LABEL)
        yield _with_track(line, name, estimate, update.truth, length, columns)


def _with_track(
    line: Text, name: str, estimate: Estimate, truth: Truth, length: Metres, columns: int
) -> Text:
    """Return a row with its track and the true value, where there are any."""
    true, scale = true_value(name, truth), scale_of(name, length)
    words = ""
    if true is not None:
        words = WORDS[name][true >= 0.5] if name in WORDS else quantity(true, estimate.unit)
    named = columns >= NAMED_COLUMNS
    width = min(columns - TRACK_COLUMN - (11 if named else 0) - (18 if truth else 2), 48)
    if scale is not None and width >= MIN_TRACK:
        end = TRACK_COLUMN + width + (11 if named else 0)
        if len(line.plain.rstrip()) < TRACK_COLUMN:
            line.append(" " * (TRACK_COLUMN - len(line)))
            ends = (f"{scale.left:>2} ", f" {scale.right:<7}") if named else ("", "")
            line.append(ends[0], DIM).append(track(scale, estimate, true, width)).append(ends[1], DIM)
        # A long reason takes the place of the track, which has no estimate then.
        line.append(" " * (end - len(line)))
    return line.append(f"  truth {words:>9}", TRUTH) if words else line


def _caption(truth: Truth) -> str:
    """Return the true state of the touch besides its position; empty where unknown."""
    if not truth:
        return ""
    words = ["truth" if truth.get("contact", 1.0) else "truth: untouched"]
    if truth.get("slip"):
        velocity = 1e3 * truth.get("slip_velocity", math.nan)
        words.append(f"slides {velocity:.1f} mm/s" if math.isfinite(velocity) else "slides")
    if truth.get("settled", 1.0) < SETTLED:
        words.append("settling")
    return ", ".join(words)


def _truth_in_words(truth: Truth) -> str:
    """Return all true values, for a line without a drawing."""
    first, *rest = _caption(truth).split(", ")
    units = {"position": "m", "force": "N"}
    values = [f"{name} {quantity(truth[name], unit)}" for name, unit in units.items() if name in truth]
    return ", ".join([f"{first}{' ' if values else ''}{', '.join(values)}", *rest])


def _meter(number: int, rms: float, peak: float, columns: int) -> Text:
    width = max(columns - 34, 10)
    line = Text(f"  mic {number}  ", LABEL)
    if math.isnan(rms):
        return line.append("samples that are not numbers", WARN)
    filled = float(np.clip(1.0 - rms / FLOOR, 0.0, 1.0)) * width
    bar = ("█" * int(filled) + EIGHTHS[int(filled % 1.0 * 8.0)])[:width]
    line.append(bar, "green").append("·" * (width - len(bar)), DIM)
    line.append(f" {rms:6.1f} dB" if math.isfinite(rms) else " silence", LABEL)
    # The wave's top is cut off, and with it the spectrum is not the string's.
    return line.append("  clipped", WARN) if peak >= LOUD_LEVEL else line


def _tracked(update: Update) -> Text:
    """Return the decided and tracked values."""
    decided = [WORDS[name][on] for name, on in update.decided.items() if name == "contact"]
    values = [
        f"{quantity(each.value, each.unit)} ± {quantity(each.std, each.unit)}"
        for name, each in _ordered(update.tracked.items())
        if each.valid and name not in WORDS
    ]
    slip = [WORDS["slip"][update.decided["slip"]]] if values and "slip" in update.decided else []
    words = ", ".join([*decided, *values, *slip])
    return Text.assemble(("  tracked  ", LABEL), words or ("nothing is decided", DIM))


def _latency(latency: Percentiles) -> Text:
    return Text.assemble(("  latency  ", LABEL), latency.line())


def _health(update: Update) -> Text:
    health = update.health
    line = Text.assemble(("  stream   ", LABEL))
    counts: Sequence[tuple[str, int]] = (
        ("gaps", health.gaps),
        ("dropped", health.dropped),
        ("xruns", health.xruns),
        ("skipped", update.skipped),
        ("reconnects", health.reconnects),
    )
    for name, count in counts:
        line.append(f"{name} {count}   ", WARN if count else "")
    return line


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """The range of a quantity's track, in the estimate's unit, and the labels of its ends."""

    low: float
    high: float
    left: str
    right: str

    def at(self, value: float, width: int) -> int:
        """Return the cell of a value on a track."""
        share = (value - self.low) / (self.high - self.low)
        return round(float(np.clip(share, 0.0, 1.0)) * (width - 1))


def scale_of(name: str, length: Metres) -> Scale | None:
    """Return the scale of a quantity, None where it has none.

    >>> scale_of("force", 0.2).right, scale_of("tension", 0.2)
    ('2 N', None)
    """
    if name in WORDS:
        return Scale(low=0.0, high=1.0, left="no", right="yes")
    ends = {"position": (length, f"{1e3 * length:.0f} mm"), "force": (MAX_FORCE, f"{MAX_FORCE:g} N")}
    if name not in ends:
        return None
    high, right = ends[name]
    return Scale(low=0.0, high=high, left="0", right=right)


def probability_in_words(name: str, probability: float) -> tuple[str, str]:
    """Return the more likely answer and its probability.

    >>> probability_in_words("slip", 0.03)
    ('rests', '97 %')
    """
    return WORDS[name][probability >= 0.5], _percent(max(probability, 1.0 - probability))


def _percent(share: float) -> str:
    if not math.isfinite(share):
        return "? %"
    digits = 0 if share < 0.99 else 1
    # Rounding must not make a certainty of what is none.
    return f"{math.floor(share * 1000.0) / 10.0:.{digits}f} %"


def track(scale: Scale, estimate: Estimate, truth: float | None, width: int) -> Text:
    """Return the track: the estimate, one standard error on each side, and the truth where known."""
    cells, styles = ["─"] * width, [DIM] * width
    if estimate.valid and math.isfinite(estimate.std):
        first = scale.at(estimate.value - estimate.std, width)
        for cell in range(first, scale.at(estimate.value + estimate.std, width) + 1):
            cells[cell], styles[cell] = "━", BAND
    if truth is not None:
        cell = scale.at(truth, width)
        cells[cell], styles[cell] = TRUE, TRUTH
    if estimate.valid:
        cell = scale.at(estimate.value, width)
        cells[cell], styles[cell] = (BOTH if cells[cell] == TRUE else ESTIMATED), TOUCH
    line = Text()
    for style, alike in groupby(zip(cells, styles, strict=True), key=itemgetter(1)):
        line.append("".join(cell for cell, _ in alike), style)
    return line


def true_value(name: str, truth: Truth) -> float | None:
    """Return the true value of a quantity; None where unknown or without contact."""
    if name != "contact" and not truth.get("contact", 1.0):
        return None
    value = truth.get(name, math.nan)
    return value if math.isfinite(value) else None


def legend(truth: Truth) -> Text:
    """Return the meaning of a track's marks."""
    line = Text.assemble(("  ", ""), (ESTIMATED, TOUCH), (" estimate  ", DIM), ("━", BAND))
    line.append(" one standard error on each side", DIM)
    if truth:
        line.append("  ").append(TRUE, TRUTH).append(" truth  ", DIM)
        line.append(BOTH, TOUCH).append(" both", DIM)
    return line
