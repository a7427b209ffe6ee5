"""What a twin knew to be true of its latest minute, kept thinly enough to be asked for every window."""

import math

import numpy as np

from monochord.core.types import Truth
from monochord.core.units import Samples
from monochord.physics.twin import Labels

EVERY: Samples = 32
"""Frames from one kept label to the next, 0.7 ms: the labels themselves are averages over 5 ms."""
CONTACT, POSITION, FORCE, SLIP, ACROSS, ALONG, SETTLED = range(7)


class LabelMemory:
    """Labels of the latest `frames` frames of a stream with at most one touch."""

    def __init__(self, frames: Samples) -> None:
        self._kept = np.zeros((7, max(frames // EVERY, 1)), dtype=np.float32)
        self._start: Samples = 0  # index of the next frame

    def add(self, labels: Labels) -> None:
        """Take the labels of the frames that follow those taken so far."""
        count = labels.settled.size
        at = np.arange(-self._start % EVERY, count, EVERY)
        column = (self._start + at) // EVERY % self._kept.shape[1]
        self._kept[:, column] = 0.0
        if labels.contact.shape[0]:
            told = labels.contact, labels.position, labels.force, labels.slip, labels.across, labels.along
            for row, label in enumerate(told):
                self._kept[row, column] = label[0, at]
        self._kept[SETTLED, column] = labels.settled[at]
        self._start += count

    def over(self, start: Samples, stop: Samples) -> Truth:
        """Return what is true over the frames [start, stop), as far as that is remembered.

        See `monochord.capture.sources.twin.TwinSource` for what it tells; empty where nothing is remembered.
        """
        last = -(-min(stop, self._start) // EVERY)
        oldest = max(-(-self._start // EVERY) - self._kept.shape[1], 0)
        first = max(min(-(-start // EVERY), last - 1), oldest)
        if last <= first:
            return {}
        seen = self._kept[:, np.arange(first, last) % self._kept.shape[1]].astype(np.float64)
        touched = seen[:, seen[CONTACT] > 0.0]
        contact = 2 * touched.shape[1] >= seen.shape[1]
        calm = bool(seen[SETTLED].all()) and touched.shape[1] in (0, seen.shape[1])
        known = {"contact": float(contact), "settled": float(calm)}
        if not contact:
            return known
        mean = touched.mean(axis=1).tolist()
        return known | {
            "position": mean[POSITION],
            "force": mean[FORCE],
            "slip": float(mean[SLIP] >= 0.5),
            "slip_velocity": math.hypot(mean[ACROSS], mean[ALONG]),
            "slip_across": mean[ACROSS],
            "slip_along": mean[ALONG],
        }
