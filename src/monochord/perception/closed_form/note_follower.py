"""Follows the note of one string over windows: the evidence of all windows of a note adds up.

A note has one pitch from its onset on, which may glide slowly. The state is a discrete posterior over
candidate notes and over no note. Each window updates it in a fixed number of operations: a note that sounds
on gains the window's evidence, and a new note may begin at any time (as in pYIN, Mauch & Dixon 2014, but over
fitted series instead of a grid).
"""

from typing import NamedTuple

import numpy as np

from monochord.core.types import Flags, Floats
from monochord.core.units import Seconds
from monochord.dsp.series import COLUMNS

NOTES = 24
"""Largest number of notes in the posterior."""
FRESH, FURTHER = 0.3, 0.25
"""Weight of a window's evidence at the onset of a note, and of further sound as long as a window. Below 1:
clutter is other music, and partials err together."""
CHANCE = 22.0
"""Evidence in nats that the best of all series reaches in noise."""
ABSENT = 15.0
"""Evidence in nats that noise has for a note that has ended."""
CHANGES = 1.0
"""Rate at which notes begin and end, in 1/s."""
GLIDE = 0.03
"""Usual change of a note's log frequency, in 1/s."""
RANGE = 1.6
"""Range of log frequency in which notes begin."""
MIN_STD = 2.0e-4
"""Smallest standard error of a window's log frequency: partials beat."""
FIT, REACH = 9.0, 40.0
"""Squared distance in standard errors within which a series is surely a note, and within which it may be."""
(FREQUENCY, FREQUENCY_STD, BEND, BEND_STD, EVIDENCE) = range(len(COLUMNS))


class Notes(NamedTuple):
    """Posterior over the note of a string.

    For each note (notes,), the most probable first: `log_frequency`, its `variance`, inharmonicity `bend` and
    its standard error `bend_std`, and log probability `weight`. `none` is the log probability of no note.
    """

    log_frequency: Floats
    variance: Floats
    bend: Floats
    bend_std: Floats
    weight: Floats
    none: float

    @property
    def guesses(self) -> Floats:
        """The frequencies in Hz and inharmonicities of the most probable notes, (notes, 2)."""
        return np.stack((np.exp(self.log_frequency), self.bend), axis=1)[: NOTES // 3]


NO_NOTES = Notes(*(np.empty(0) for _ in range(5)), none=0.0)
"""Before the first window."""


def follow(notes: Notes, rows: Floats, elapsed: Seconds, duration: Seconds) -> Notes:
    """Return the posterior after a window of a `duration` that follows the last one by `elapsed`.

    `rows` are its series, see `monochord.dsp.series.COLUMNS`. For the first window `elapsed` is infinite.
    """
    rows = rows[(rows[:, EVIDENCE] > 0.0) & np.isfinite(rows[:, FREQUENCY_STD])][:NOTES]
    log_frequency = np.log(rows[:, FREQUENCY])
    variance = np.maximum(rows[:, FREQUENCY_STD] / rows[:, FREQUENCY], MIN_STD) ** 2
    fresh = _fresh(rows[:, EVIDENCE])
    if not np.isfinite(elapsed):
        return _normal(log_frequency, variance, rows[:, BEND], rows[:, BEND_STD], fresh, 0.0)
    changed = -np.expm1(-elapsed * CHANGES)
    share = min(elapsed / duration, 1.0)
    grown = notes.variance + (GLIDE * elapsed) ** 2
    between = grown[:, np.newaxis] + variance
    distance = (log_frequency - notes.log_frequency[:, np.newaxis]) ** 2 / between
    likelihood = np.log(RANGE) - 0.5 * np.log(2.0 * np.pi * between) - 1.5 * np.log1p(0.5 * distance)
    kept = notes.weight + np.log1p(-changed)
    joint = np.where(distance < REACH, kept[:, np.newaxis] + share * likelihood, -np.inf)
    weight = _log_sum(joint) + FURTHER * share * rows[:, EVIDENCE]
    begun = np.log(changed) + fresh - _strongest_explained(notes, distance, rows[:, EVIDENCE])
    frequency = log_frequency
    if notes.weight.size:
        source = joint.argmax(axis=0)
        gain = np.where(weight > begun, grown[source] / (grown[source] + variance / share), 1.0)
        frequency = np.where(gain < 1.0, notes.log_frequency[source], log_frequency)
        frequency = frequency + gain * (log_frequency - frequency)
        variance = np.where(gain < 1.0, np.maximum((1.0 - gain) * grown[source], 1e-8), variance)
    lost = ~(distance < FIT).any(axis=1)
    return _normal(
        np.concatenate((frequency, notes.log_frequency[lost])),
        np.concatenate((variance, grown[lost])),
        np.concatenate((rows[:, BEND], notes.bend[lost])),
        np.concatenate((rows[:, BEND_STD], notes.bend_std[lost])),
        np.concatenate((np.logaddexp(weight, begun), kept[lost])),
        float(np.logaddexp(notes.none, np.log(changed))) + FURTHER * share * ABSENT,
    )


def _fresh(evidence: Floats) -> Floats:
    """Return the log odds of a note of a given evidence at its onset against none."""
    return FRESH * (evidence - CHANCE) - np.log(RANGE)


def _strongest_explained(notes: Notes, distance: Floats, evidence: Floats) -> float:
    """Return by how much the most probable note explains a window better than none does."""
    if not notes.weight.size or notes.none > notes.weight[0]:
        return 0.0
    at: Flags = distance[0] < FIT
    return max(float(_fresh(evidence[at].max())), 0.0) if at.any() else 0.0


def _log_sum(joint: Floats) -> Floats:
    """Return the logarithm of the sum of exponentials over the first axis, minus infinity for none."""
    if not joint.shape[0]:
        return np.full(joint.shape[1], -np.inf)
    most = np.maximum(joint.max(axis=0), -1e300)
    return most + np.log(np.maximum(np.exp(joint - most).sum(axis=0), 1e-300))


def _normal(
    log_frequency: Floats, variance: Floats, bend: Floats, bend_std: Floats, weight: Floats, none: float
) -> Notes:
    """Return the most probable notes, with probabilities that sum to 1."""
    best = np.argsort(-weight, kind="stable")[:NOTES]
    most = max(float(weight[best[0]]), none) if best.size else none
    total = most + np.log(np.exp(weight[best] - most).sum() + np.exp(none - most))
    columns = (log_frequency, variance, bend, bend_std)
    return Notes(*(column[best] for column in columns), weight=weight[best] - total, none=float(none - total))
