"""The terminal's frame: the drawn string, estimates, the level of each microphone, the stream's health."""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from rich.text import Text

from monochord.sinks import _string
from monochord.sinks.base import Moment
from monochord.timing import Percentiles
from monochord.types import Audio, Estimate, Signal, Truth
from monochord.units import Metres, decibels

LABEL, FAINT, WARN = "grey62", "grey42", "bold orange1"
FLOOR = -60.0  # decibels at the left end of a level meter
EIGHTHS = " ▏▎▍▌▋▊▉"
FIRST = ("position", "force", "frequency")  # what a person looks for first; the rest follows as it comes


def frame(
    moment: Moment, signal: Signal, length: Metres, latency: Percentiles, columns: int, rows: int
) -> list[Text]:
    """Return the picture of one moment as lines, `columns` wide and at most `rows` high."""
    truth = moment.truth
    loudness = [levels(channel) for channel in moment.window.samples]
    heard = [max(0.0, 1.0 - rms / FLOOR) if math.isfinite(rms) else 0.0 for rms, _ in loudness]
    swings = heard if len(heard) > 1 else [0.0, heard[0]]
    position, force = (moment.prediction.estimate(name) for name in ("position", "force"))
    picture = _string.draw(
        columns - 4,
        length,
        (position.value, position.std) if position.valid else None,
        truth.get("position") if truth.get("contact") else None,
        force.value if force.valid else None,
        swings,
        _caption(truth),
    )
    meters = [_meter(k + 1, rms, peak, columns) for k, (rms, peak) in enumerate(loudness)]
    foot = [Text(), *meters, Text(), _latency(latency), _health(moment)]
    head = [_title(moment, signal, columns), Text(), *(Text.assemble("  ", line) for line in picture), Text()]
    room = max(rows - 1 - len(head) - len(foot), 1)
    middle = list(_estimates(moment))[:room]
    return [*head, *middle, *foot]


def plain(moment: Moment, latency: Percentiles) -> str:
    """Return one line without any drawing, for a log or a pipe."""
    health = moment.health
    said = ", ".join(
        f"{name} {quantity(e.value, e.unit)} +- {quantity(e.std, e.unit)}"
        if e.valid
        else f"no {name} ({e.why_not})"
        for name, e in _ordered(moment.prediction.estimates.items())
    )
    rms = " / ".join(f"{levels(channel)[0]:.0f}" for channel in moment.window.samples)
    p99 = f"{1e3 * latency.p99:.2f}"
    known = f"; {_truth_in_words(moment.truth)}" if moment.truth else ""
    return (
        f"{moment.prediction.time:8.2f} s  {said}{known}; level {rms} dB, "
        f"latency p99 {p99} ms, gaps {health.gaps}, dropped {health.dropped}, xruns {health.xruns}, "
        f"skipped {moment.skipped}"
    )


def levels(channel: Audio) -> tuple[float, float]:
    """Return the level of a channel, root mean square and peak, in dB below full scale; NaN stays NaN."""
    with np.errstate(all="ignore"):
        wide = channel.astype(np.float64)
        return decibels(float(np.sqrt(np.mean(wide**2)))), decibels(float(np.max(np.abs(wide))))


def quantity(value: float, unit: str) -> str:
    """Return a value as a person reads it: lengths in millimetres.

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


def _title(moment: Moment, signal: Signal, columns: int) -> Text:
    ears = "1 microphone" if signal.channels == 1 else f"{signal.channels} microphones"
    left = Text.assemble(("  monochord", "bold"), (f"   {signal.sample_rate / 1e3:g} kHz, {ears}", LABEL))
    right = f"{moment.prediction.time:.1f} s  "
    return left + Text(right.rjust(columns - len(left)), LABEL)


def _ordered(estimates: Iterable[tuple[str, Estimate]]) -> list[tuple[str, Estimate]]:
    return sorted(estimates, key=lambda item: FIRST.index(item[0]) if item[0] in FIRST else len(FIRST))


def _estimates(moment: Moment) -> Iterator[Text]:
    for name, estimate in _ordered(moment.prediction.estimates.items()):
        line = Text.assemble((f"  {name.replace('_', ' '):<13}", LABEL))
        if estimate.valid:
            style = _string.TOUCH if name == "position" else "bold"
            line.append(f"{quantity(estimate.value, estimate.unit):>10}", style)
            spread = quantity(estimate.std, estimate.unit) if math.isfinite(estimate.std) else "?"
            line.append(f"  ± {spread:<9}", LABEL)
        else:
            line.append(f"{'--':>10}", FAINT)
            line.append(f"  {estimate.why_not}", WARN if name == "position" else FAINT)
        yield line + _beside(name, estimate, moment.truth)


def _beside(name: str, estimate: Estimate, truth: Truth) -> Text:
    """Return the truth beside an estimate, where the source knows it."""
    if name not in truth or not truth.get("contact", 1.0) or not math.isfinite(truth[name]):
        return Text()
    line = Text(f"   truth {quantity(truth[name], estimate.unit):>9}", _string.TRUTH)
    if estimate.valid:
        off = estimate.value - truth[name]
        line.append(f"   off by {'+' if off >= 0 else '-'}{quantity(abs(off), estimate.unit)}", LABEL)
    return line


def _caption(truth: Truth) -> str:
    """Return what is true of the touch beside where it is; empty where nothing is known."""
    if not truth:
        return ""
    words = ["truth" if truth.get("contact", 1.0) else "truth: untouched"]
    if truth.get("slip"):
        words.append(f"slides {1e3 * truth.get('slip_velocity', math.nan):.1f} mm/s")
    if not truth.get("settled", 1.0):
        words.append("settling")
    return ", ".join(words)


def _truth_in_words(truth: Truth) -> str:
    """Return all that is true, for a line without a drawing."""
    first, *rest = _caption(truth).split(", ")
    units = {"position": "m", "force": "N"}
    known = [f"{name} {quantity(truth[name], unit)}" for name, unit in units.items() if name in truth]
    return ", ".join([f"{first}{' ' if known else ''}{', '.join(known)}", *rest])


def _meter(number: int, rms: float, peak: float, columns: int) -> Text:
    width = max(columns - 34, 10)
    line = Text(f"  mic {number}  ", LABEL)
    if math.isnan(rms):
        return line.append("samples that are not numbers", WARN)
    filled = float(np.clip(1.0 - rms / FLOOR, 0.0, 1.0)) * width
    bar = ("█" * int(filled) + EIGHTHS[int(filled % 1.0 * 8.0)])[:width]
    line.append(bar, "green").append("·" * (width - len(bar)), FAINT)
    line.append(f" {rms:6.1f} dB" if math.isfinite(rms) else " silence", LABEL)
    # Full scale reached: the wave's top is cut off, and with it the spectrum is not the string's.
    return line.append("  clipped", WARN) if peak > -0.01 else line


def _latency(latency: Percentiles) -> Text:
    return Text.assemble(("  latency  ", LABEL), latency.line())


def _health(moment: Moment) -> Text:
    health = moment.health
    line = Text.assemble(("  stream   ", LABEL))
    counts: Sequence[tuple[str, int]] = (
        ("gaps", health.gaps),
        ("dropped", health.dropped),
        ("xruns", health.xruns),
        ("skipped", moment.skipped),
        ("reconnects", health.reconnects),
    )
    for name, count in counts:
        line.append(f"{name} {count}   ", WARN if count else "")
    return line
