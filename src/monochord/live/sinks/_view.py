"""The terminal's frame: the drawn string, estimates, the level of each microphone, the stream's health."""

import math
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from rich.text import Text

from monochord.core.labels import SETTLED
from monochord.core.timing import Percentiles
from monochord.core.types import Audio, Estimate, Signal, Truth
from monochord.core.units import Metres, decibels
from monochord.live.sinks import _string, _tracks
from monochord.live.sinks._tracks import FAINT, LABEL, WARN
from monochord.live.sinks.base import Moment

FLOOR = -60.0  # decibels at the left end of a level meter
EIGHTHS = " ▏▎▍▌▋▊▉"
FIRST = ("contact", "position", "force", "slip", "frequency")  # what a person looks for first


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
    learned = any(name in moment.prediction.estimates for name in _tracks.WORDS)
    middle = [*_estimates(moment, length, columns), *([_tracks.legend(truth)] if learned else [])]
    foot = [Text(), *meters, Text(), _latency(latency), _health(moment)]
    head = [_title(moment, signal, columns), Text(), *(Text.assemble("  ", line) for line in picture), Text()]
    if rows - 1 - len(head) - len(foot) < min(len(middle), len(FIRST)):
        head, foot = ([line for line in part if line.plain] for part in (head, foot))
    room = max(rows - 1 - len(head) - len(foot), 1)
    return [*head, *middle[:room], *foot]


def plain(moment: Moment, latency: Percentiles) -> str:
    """Return one line without any drawing, for a log or a pipe."""
    health = moment.health
    said = ", ".join(_said(name, e) for name, e in _ordered(moment.prediction.estimates.items()))
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


def _said(name: str, estimate: Estimate) -> str:
    if not estimate.valid:
        # "no contact" would be an answer.
        silent = f"{name} not told" if name in _tracks.WORDS else f"no {name}"
        return f"{silent} ({estimate.why_not})"
    if name in _tracks.WORDS:
        word, share = _tracks.chance_in_words(name, estimate.value)
        return f"{word} ({share})"
    return f"{name} {quantity(estimate.value, estimate.unit)} +- {quantity(estimate.std, estimate.unit)}"


def _estimates(moment: Moment, length: Metres, columns: int) -> Iterator[Text]:
    for name, estimate in _ordered(moment.prediction.estimates.items()):
        line = Text.assemble((f"  {name.replace('_', ' '):<12}", LABEL))
        if not estimate.valid:
            line.append(f"{'--':>10}", FAINT)
            line.append(f"  {estimate.why_not}", WARN if estimate.why_not not in QUIETLY else FAINT)
        elif name in _tracks.WORDS:
            word, share = _tracks.chance_in_words(name, estimate.value)
            line.append(f"{word:>10}", "bold").append(f"  {share:<11}", LABEL)
        else:
            style = _string.TOUCH if name == "position" else "bold"
            line.append(f"{quantity(estimate.value, estimate.unit):>10}", style)
            spread = quantity(estimate.std, estimate.unit) if math.isfinite(estimate.std) else "?"
            line.append(f"  ± {spread:<9}", LABEL)
        yield _beside(line, name, estimate, moment.truth, length, columns)


QUIETLY = ("no contact", "not estimated")
"""Reasons for an abstention that are no trouble."""
FIGURES = 37
"""Columns before a track."""


def _beside(line: Text, name: str, estimate: Estimate, truth: Truth, length: Metres, columns: int) -> Text:
    """Return a row with its track, and the truth in figures, where there are any."""
    true, scale = _tracks.known(name, truth), _tracks.scale_of(name, length)
    words = ""
    if true is not None:
        words = _tracks.WORDS[name][true >= 0.5] if name in _tracks.WORDS else quantity(true, estimate.unit)
    named = columns >= _tracks.ROOMY
    width = min(columns - FIGURES - (11 if named else 0) - (18 if truth else 2), 48)
    if scale is not None and width >= LEAST_TRACK:
        line.append(" " * (FIGURES - len(line)))
        ends = (f"{scale.left:>2} ", f" {scale.right:<7}") if named else ("", "")
        line.append(ends[0], FAINT).append(_tracks.track(scale, estimate, true, width)).append(ends[1], FAINT)
    return line.append(f"  truth {words:>9}", _string.TRUTH) if words else line


LEAST_TRACK = 8
"""Cells of a track that can still be read."""


def _caption(truth: Truth) -> str:
    """Return what is true of the touch beside where it is; empty where nothing is known."""
    if not truth:
        return ""
    words = ["truth" if truth.get("contact", 1.0) else "truth: untouched"]
    if truth.get("slip"):
        words.append(f"slides {1e3 * truth.get('slip_velocity', math.nan):.1f} mm/s")
    if truth.get("settled", 1.0) < SETTLED:
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
