"""A summary of the positions in a recording: medians, their spread, and the reasons of abstentions."""

from array import array
from collections import Counter
from collections.abc import Generator
from contextlib import contextmanager

import numpy as np

from monochord.core.units import Metres
from monochord.live.sinks.base import Listener, Run, Update, Writer
from monochord.physics.theory import light_touch

CONTACT = "contact"
"""The estimate that only the two-segment form provides."""


class PositionTable(Listener):
    """A sink that collects the positions of a recording, 24 bytes per window, and summarises them as lines.

    Parameters
    ----------
    stopped
        Whether the string is stopped at one end, as on a guitar, so that positions count from the nut.
    by_pitch
        Whether position follows from pitch alone, which `lines` then says.
    """

    def __init__(self, *, stopped: bool, by_pitch: bool) -> None:
        self._origin = "the nut" if stopped else "pickup 1"
        self._positions, self._stds, self._frequencies = array("d"), array("d"), array("d")
        self._reasons: Counter[str] = Counter()
        self._stopped, self._by_pitch = stopped, by_pitch
        self._two_channels, self._one_note = False, 0
        self._length: Metres | None = None
        self._light_touches: Counter[int] = Counter()

    @contextmanager
    def open(self, run: Run) -> Generator[Writer]:
        """Take the number of channels, which says what positions count from."""
        signal = run.signal
        self._two_channels = signal.channels == 2
        self._length = run.length or (signal.string.length if signal.string else None)
        if signal.channels == 1:
            self._origin, self._stopped = "the nut", True
        yield self

    def write(self, update: Update) -> None:
        """Count one window."""
        position, frequency = (update.prediction.estimate(name) for name in ("position", "frequency"))
        if not position.valid:
            self._reasons[position.reason] += 1
            return
        if CONTACT not in update.prediction.estimates:
            self._one_note += 1
            n = light_touch(position.value, self._length, 2.0 * position.std) if self._length else None
            if n:
                self._light_touches[n] += 1
        self._positions.append(position.value)
        self._stds.append(position.std)
        self._frequencies.append(frequency.value)

    def lines(self) -> list[str]:
        """Return the medians as lines of text."""
        valid, total = len(self._positions), len(self._positions) + self._reasons.total()
        lines = [f"  windows with a position  {valid} of {total} ({100 * valid / max(total, 1):.1f} %)"]
        if valid:
            low, high = np.quantile(self._positions, [0.1, 0.9])
            median = 1e3 * np.median(self._positions)
            lines += [
                f"  position                 {median:.2f} mm from {self._origin} (median)",
                f"  standard error           {1e3 * np.median(self._stds):.2f} mm (median)",
                f"  middle four fifths       {1e3 * low:.2f} to {1e3 * high:.2f} mm",
            ]
        if np.isfinite(self._frequencies).any():
            lines.append(f"  frequency                {np.nanmedian(self._frequencies):.3f} Hz (median)")
        if valid and self._stopped and self._by_pitch:
            lines += self._assumptions(valid)
        reasons = self._reasons.most_common()
        return lines + [f"  no position              {count} windows: {why}" for why, count in reasons]

    def _assumptions(self, valid: int) -> list[str]:
        """Return the assumptions behind positions on a stopped string."""
        lines = ["  assumes                  the sound is this string's: position follows from its pitch"]
        for n, count in self._light_touches.most_common(1):
            place = 1e3 * (self._length or 0.0) / n
            lines.append(
                f"  or lightly touched       at 1/{n}, {place:.2f} mm: the same note, in {count} windows"
            )
        if self._two_channels:
            split = (
                f"one note in {self._one_note}, two segments in {valid - self._one_note} of {valid} windows"
            )
            lines.insert(0, f"  both channels carry      {split}")
        return lines
