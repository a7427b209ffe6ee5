"""True labels of the latest frames of a simulated stream."""

from collections.abc import Mapping

import numpy as np

from monochord.core.labels import LabelTrack, one_window_labels
from monochord.core.types import Floats, Truth
from monochord.core.units import Samples, Seconds

LABEL_SECONDS: Seconds = 61.0
"""How long labels are stored, in s: one second more than the longest window."""
LABEL_STEP: Samples = 32
"""Frames between stored labels, 0.7 ms; each label is averaged over 5 ms."""


class LabelMemory:
    """Labels of the latest `seconds` of a stream by name, one every `LABEL_STEP` frames.

    `sample_rate` is in Hz.
    """

    def __init__(self, names: tuple[str, ...], sample_rate: int, seconds: Seconds = LABEL_SECONDS) -> None:
        frames = round(seconds * sample_rate)
        self._names = names
        self._rows = np.zeros((len(names), max(frames // LABEL_STEP, 1)), dtype=np.float32)
        self._sample_rate = sample_rate
        self._start: Samples = 0  # index of the next frame

    def add(self, columns: Mapping[str, Floats], count: Samples) -> None:
        """Store the labels (count,) of the next frames; 0 where a name is missing."""
        at = np.arange(-self._start % LABEL_STEP, count, LABEL_STEP)
        column = (self._start + at) // LABEL_STEP % self._rows.shape[1]
        self._rows[:, column] = 0.0
        for row, name in enumerate(self._names):
            if name in columns:
                self._rows[row, column] = columns[name][at]
        self._start += count

    def over(self, start: Samples, stop: Samples) -> Truth:
        """Return the labels of the window of frames [start, stop); empty where none are stored."""
        newest = -(-min(stop, self._start) // LABEL_STEP)
        oldest = max(-(-self._start // LABEL_STEP) - self._rows.shape[1], 0)
        rows = np.arange(max(min(start // LABEL_STEP, newest - 1), oldest), newest)
        if not rows.size:
            return {}
        stored = self._rows[:, rows % self._rows.shape[1]].astype(np.float64)
        columns: dict[str, Floats] = dict(zip(self._names, stored, strict=True))
        if "slip_across" in columns:
            columns["slip_velocity"] = np.hypot(columns["slip_across"], columns["slip_along"])
        rate = self._sample_rate
        track = LabelTrack(time=rows.astype(np.float64) * (LABEL_STEP / rate), columns=columns)
        return one_window_labels(track, start / rate, stop / rate)
