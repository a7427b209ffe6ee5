"""What a person sees of a running recording: a picture in a terminal, or a line."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.text import Text

from monochord.capture.recording.feeds import FeedNow
from monochord.capture.recording.levels import Level
from monochord.capture.recording.progress import Progress
from monochord.core.units import Seconds, decibels

LABEL, FAINT, WARN, FINE = "grey62", "grey42", "bold orange1", "green"
FLOOR = -60.0  # decibels at the left end of a level meter
EIGHTHS = " ▏▎▍▌▋▊▉"
SHOWN = ("fz", "x", "y", "z")  # of a reading, where it has them; else its first three values
LATE = 0.9  # of the rate that is due


def frame(path: Path, now: Progress, noticed: Sequence[str], columns: int) -> list[Text]:
    """Return the picture of a moment as lines of at most `columns` cells; the newest notices stand below."""
    return [
        _title(path, now, columns),
        Text(),
        *(_meter(k + 1, level, columns) for k, level in enumerate(now.levels)),
        Text(),
        *(_feed(feed) for feed in now.feeds),
        _audio(now),
        _disk(now),
        *(Text(f"  ! {text}", WARN) for text in noticed),
    ]


def plain(now: Progress) -> str:
    """Return one line without any drawing, for a log or a pipe."""
    peaks = " / ".join(f"{decibels(level.held):.0f}" for level in now.levels)
    clipped = sum(level.clipped for level in now.levels)
    feeds = "".join(
        f"; {feed.name} {feed.rate:.0f} a second, missing {feed.health.missing}"
        + (f", silent for {feed.silent:.1f} s" if feed.silent else "")
        for feed in now.feeds
    )
    silent = f", silent for {now.silent:.1f} s" if now.silent else ""
    return (
        f"{now.elapsed:8.1f} s  peak {peaks} dBFS, clipped {clipped}, gaps {now.gaps}, dropped {now.dropped}"
        f"{silent}{feeds}; {1e-6 * now.space.size:.1f} MB, room for {duration(now.space.left)}"
    )


def duration(seconds: Seconds) -> str:
    """Return a time as a person reads it.

    >>> duration(75.0), duration(5400.0), duration(math.inf)
    ('1:15', '1.5 h', '?')
    """
    if not math.isfinite(seconds):
        return "?"
    if seconds >= 3600.0:
        return f"{seconds / 3600.0:.{1 if seconds < 36000.0 else 0}f} h"
    return f"{int(seconds) // 60}:{int(seconds) % 60:02d}"


def _title(path: Path, now: Progress, columns: int) -> Text:
    left = Text.assemble(("  ● ", "bold red"), ("monochord", "bold"), (f"   {path.name}", LABEL))
    right = f"{duration(now.elapsed)}   {1e-6 * now.space.size:.1f} MB  "
    return left + Text(right.rjust(max(columns - len(left), len(right) + 1)), LABEL)


def _meter(number: int, level: Level, columns: int) -> Text:
    width = max(columns - 34, 10)
    filled, held = _place(level.rms) * width, min(int(_place(level.held) * width), width - 1)
    bar = ("█" * int(filled) + EIGHTHS[int(filled % 1.0 * 8.0)])[:width].ljust(width)
    line = Text(f"  mic {number}  ", LABEL)
    for k, cell in enumerate(bar):
        if k == held and level.held > 0.0:
            line.append("▏", WARN if level.clipping else "bold white")
        else:
            line.append(cell if cell != " " else "·", FINE if cell != " " else FAINT)
    line.append(f" {decibels(level.rms):6.1f} dBFS" if level.rms > 0.0 else "  silence   ", LABEL)
    if level.clipping:
        return line.append("  CLIP", WARN)
    if level.not_numbers:
        return line.append("  not numbers", WARN)
    return line.append(f"  clipped {level.clipped}", LABEL) if level.clipped else line


def _place(share: float) -> float:
    """Return where a level stands between the floor and full scale, from 0 to 1."""
    return min(max(1.0 - decibels(share) / FLOOR, 0.0), 1.0) if share > 0.0 else 0.0


def _feed(feed: FeedNow) -> Text:
    line = Text.assemble((f"  {feed.name:<9}", LABEL))
    for text in _values(feed):
        line.append(f"{text}   ", "bold")
    if feed.silent:
        return line.append(f"silent for {feed.silent:.1f} s", WARN)
    due, style = feed.feed.rate, WARN if feed.rate < LATE * feed.feed.rate else ""
    line.append(f"{feed.rate:.0f}{f' of {due:.0f}' if due else ''} a second   ", style)
    for name, count in (("missing", feed.health.missing), ("faulty", feed.faulty)):
        line.append(f"{name} {count}   ", WARN if count else "")
    return line


def _values(feed: FeedNow) -> Iterator[str]:
    units = dict(zip(feed.feed.columns, feed.feed.units, strict=True))
    shown = [name for name in SHOWN if name in feed.values] or list(feed.values)[:3]
    for name in shown:
        value, unit = feed.values[name], units[name]
        yield f"{name} {1e3 * value:.1f} mm" if unit == "m" else f"{name} {value:.2f} {unit}".rstrip()


def _audio(now: Progress) -> Text:
    line = Text.assemble(("  audio    ", LABEL))
    if now.silent:
        line.append(f"silent for {now.silent:.1f} s   ", WARN)
    counts = {
        "gaps": now.gaps,
        "dropped": now.dropped,
        "xruns": now.health.xruns,
        "reconnects": now.health.reconnects,
    }
    for name, count in counts.items():
        line.append(f"{name} {count}   ", WARN if count else "")
    return line


def _disk(now: Progress) -> Text:
    style = WARN if now.space.left < 600.0 else ""
    line = Text.assemble(("  disk     ", LABEL))
    line.append(f"{1e-9 * now.space.free:.1f} GB free, room for {duration(now.space.left)}   ", style)
    return line.append(f"waiting {100 * now.waiting:.0f} %", WARN) if now.waiting > 0.1 else line
