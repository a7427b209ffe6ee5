"""Taps in a session's streams, before and after alignment."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError
from monochord.core.ranges import Whole
from monochord.core.types import Floats
from monochord.core.units import Seconds
from monochord.figures import _style
from monochord.figures.base import Measured
from monochord.sessions import SessionReader, read_session
from monochord.sessions.alignment import AUDIO, Alignment, align, reading_times

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

SHOWN = {"audio": ("microphone 1", 1.0), "fz": ("force (N)", 1.0), "z": ("height (mm)", 1e3)}
"""Axis label of each row, and the factor from SI to its unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Taps(Measured):
    """Draw sound, force and height around the taps of `session`, as stamped and as corrected.

    `session` is a file. `end` shows the taps at the end instead of those at the start. `tap` is the tap's
    index, and `before` and `after` are the seconds shown around it.
    """

    session: Path
    end: bool = False
    tap: Whole = 0
    before: Annotated[Seconds, Meta(gt=0.0, le=10.0)] = 0.05
    after: Annotated[Seconds, Meta(gt=0.0, le=10.0)] = 0.1

    def draw(self) -> Canvas:
        """Align the session and draw its streams."""
        session, alignment = self._aligned()
        rows = _rows(session)
        centre = self._centre(alignment)
        page = _style.canvas(30.0 + 28.0 * len(rows))
        panels = page.subplots(len(rows), 2, sharex=True, sharey="row", squeeze=False)
        for line, (stream, column) in zip(panels, rows, strict=True):
            late = alignment.lateness.get(stream)
            for corrected, axes in enumerate(line):
                _draw_row(axes, self._cut(session, alignment, stream, column, centre, bool(corrected)))
                name, _ = SHOWN[column]
                _style.dress(axes, "", "", "", "" if corrected else name)
            if late is not None:
                offset = late.offsets[-1 if self.end else 0]
                label = f"{1e3 * offset.value:+.2f} ± {1e3 * offset.std:.2f} ms"
                line[0].text(1.0, 1.01, label, transform=line[0].transAxes, ha="right", va="bottom",
                             fontsize=_style.TICK, color=_style.INK)  # fmt: skip
        kind = "simulated, " if session.description.simulated else ""
        for axes, title in zip(panels[0], ("as stamped", "after alignment"), strict=True):
            axes.set_title(f"{kind}{title}", fontsize=_style.LABEL, color=_style.INK, pad=4)
        for axes in panels[-1]:
            axes.set_xlabel("time from the tap (ms)", fontsize=_style.LABEL, color=_style.INK)
            axes.set_xlim(-1e3 * self.before, 1e3 * self.after)
        page.align_ylabels(list(panels[:, 0]))
        return page

    def numbers(self) -> dict[str, Any]:
        """Return each stream's offset, uncertainty and taps at both ends, its drift, and the flags."""
        _, alignment = self._aligned()
        numbers: dict[str, Any] = {"reference": alignment.reference, "flags": list(alignment.flags)}
        for stream, late in alignment.lateness.items():
            numbers[stream] = {
                "offsets": [_finite(offset.value) for offset in late.offsets],
                "stds": [_finite(offset.std) for offset in late.offsets],
                "taps": [offset.taps for offset in late.offsets],
                "drift": _finite(late.drift),
                "ppm": _finite(late.ppm),
            }
        return numbers

    def _aligned(self) -> tuple[SessionReader, Alignment]:
        session = read_session(Path(self.session))
        return session, align(session)

    def _centre(self, alignment: Alignment) -> Seconds:
        """Return the time of the chosen tap, on the reference's clock."""
        if not alignment.taps:
            raise InputError(f"session {self.session} ({'; '.join(alignment.flags)})", "a session with taps")
        group = alignment.taps[-1 if self.end else 0]
        if self.tap >= group.size:
            raise InputError(f"tap {self.tap}", f"0 to {group.size - 1}")
        return float(group[self.tap])

    def _cut(
        self,
        session: SessionReader,
        alignment: Alignment,
        stream: str,
        column: str,
        centre: Seconds,
        corrected: bool,  # noqa: FBT001
    ) -> tuple[Floats, Floats]:
        """Return times in ms from the tap and the stream's values."""
        if column == AUDIO:
            track = session.audio
            time: Floats = track.time(np.arange(track.samples.shape[1]))
            values = track.samples[0].astype(np.float64)
        else:
            readings = session.readings(stream)
            time, values = reading_times(readings).time, readings.column(column)
        time = (alignment.correct(stream, time) if corrected else time) - centre
        shown = np.flatnonzero((time > -self.before) & (time < self.after))
        return 1e3 * time[shown], SHOWN[column][1] * values[shown]


def _rows(session: SessionReader) -> list[tuple[str, str]]:
    """Return the streams and columns to show."""
    feeds = session.description.feeds
    rows = [(feed.stream, column) for column in ("fz", "z") for feed in feeds if column in feed.columns]
    return [(AUDIO, AUDIO), *rows]


def _draw_row(axes: Axes, cut: tuple[Floats, Floats]) -> None:
    time, values = cut
    axes.axvline(0.0, color=_style.PALE, lw=0.8)
    few = time.size < 100
    axes.plot(time, values, color=_style.SEGMENTS[0], lw=0.8, marker="." if few else "", ms=3.0)


def _finite(value: float) -> float | None:
    """Return a finite number for JSON, else None."""
    return value if np.isfinite(value) else None
