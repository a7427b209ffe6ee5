"""Sound unlike that of the training, and what is unlike: a reason for a model to abstain.

Distance from the training's features misses much, since what a model is trained on varies more than a fault
does. So a small network learns ordinary windows against windows of faults and of contacts that no model was
trained on (outlier exposure; Hendrycks, Mazeika and Dietterich, Deep anomaly detection with outlier exposure,
2019). It sees a window's features alone, not the reference of the untouched string, which the same fault may
have spoiled. One window tells little of some faults: what windows say is averaged, over seconds for a fault,
which lasts, and for less than a touch for one. A silent driver is detected while something touches: its
segment hardly rings then, where an untouched string of another design may sound the same.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from monochord.core.errors import InputError
from monochord.core.kernels import kernel
from monochord.core.types import Audio, Flags, Floats
from monochord.core.units import Seconds
from monochord.perception.model.definition import DETECTOR, AnomalyRecord, Definition
from monochord.perception.model.network import Layers

UNLIKE = "sound unlike what this model learned"
"""The reason where none of those that were learned is likely."""
MAX_ODDS = 10.0
"""Largest log odds of a window, so that a fault that was plain is forgotten soon after it ends."""
MIN_SHARE = 0.5
"""Least probability of a reason, among all reasons, to be named."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AnomalyState:
    """The detector on one stream: averaged log odds (reasons,) of each reason, after the window at `time`.

    Both are None before any window. `weight` (reasons,) is that of the windows so far that count for the
    reason, of which one that lasted for ever has 1; it is NaN where that is the first window of the stream
    alone, since how far windows are apart shows in the second.
    """

    odds: Floats | None = None
    weight: Floats | None = None
    time: Seconds = -math.inf


INITIAL_STATE = AnomalyState()


@dataclass(frozen=True, kw_only=True)
class Detector:
    """The layers of the detector, as in a head, and its record."""

    record: AnomalyRecord
    layers: Layers

    @classmethod
    def of(cls, definition: Definition, weights: Mapping[str, Audio]) -> "Detector | None":
        """Return the detector of a model, None where it has none."""
        if definition.known is None:
            return None
        numbers = range(len(definition.known.hidden) + 1)
        layers = [(weights[f"{DETECTOR}.{n}.weight"], weights[f"{DETECTOR}.{n}.bias"]) for n in numbers]
        return cls(record=definition.known, layers=Layers.of(definition.detector_columns, layers))

    def step(self, state: AnomalyState, logits: Floats, time: Seconds, *, touched: bool) -> AnomalyState:
        """Return the state after a window of logits (1 + reasons,) that begins at a time.

        `touched` says whether something touches there.
        """
        return step(state, logits, time, self.record.memory, self._counts[touched])

    def anomaly_reason(self, state: AnomalyState) -> str:
        """Return why sound is unlike the training after its last window, empty where it is like it."""
        return "" if state.odds is None else reason(state.odds, self.record)

    def logits(self, rows: Audio) -> Floats:
        """Return the outputs (n, 1 + reasons) for scaled features (n, d), or more columns after them."""
        return self.layers.outputs(rows).astype(np.float64)

    @cached_property
    def _counts(self) -> tuple[Flags, Flags]:
        """The reasons (reasons,) that a window counts for, of an untouched one and of a touched one."""
        always = np.array([reason not in self.record.touched for reason in self.record.reasons])
        return always, np.ones_like(always)


def step(
    state: AnomalyState, logits: Floats, time: Seconds, memory: Sequence[Seconds], counts: Flags | None = None
) -> AnomalyState:
    """Return the state after a window of logits (1 + reasons,) that begins at a time.

    The log odds are averaged over windows, with weights that fall by e in the time in `memory` (reasons,),
    whatever the hop; the first windows of a stream, which may be of drivers that only start, count as the
    others do. The average of a reason for which the window does not count (reasons,) stays as it is.

    >>> state = step(AnomalyState(), np.array([0.0, 2.0, 2.0]), 0.0, (0.5, 0.0))
    >>> step(state, np.array([0.0, 0.0, 0.0]), 0.5, (0.5, 0.0)).odds.round(3).tolist()
    [0.538, 0.0]
    >>> step(state, np.zeros(3), 0.5, (0.5, 0.0), np.array([True, False])).odds.round(3).tolist()
    [0.538, 2.0]
    """
    counts = np.ones(len(memory), bool) if counts is None else counts
    if not len(logits) - 1 == len(memory) == len(counts):
        raise InputError(f"{len(logits)} logits", f"one and those of {len(memory)} reasons")
    if state.odds is None or state.weight is None:
        odds = np.clip(logits[1:] - logits[0], -MAX_ODDS, MAX_ODDS)
        return AnomalyState(
            odds=np.where(counts, odds, -MAX_ODDS), weight=np.where(counts, np.nan, 0.0), time=time
        )
    elapsed = max(time - state.time, 1e-9)
    odds, weight = _averaged(state.odds, state.weight, logits, elapsed, np.array(memory), counts)
    return AnomalyState(odds=odds, weight=weight, time=time)


@kernel()
def _averaged(
    odds: Floats, weight: Floats, logits: Floats, elapsed: Seconds, memory: Floats, counts: Flags
) -> tuple[Floats, Floats]:
    """Return the averaged log odds and their weights once one more window counts."""
    odds, weight = odds.copy(), weight.copy()
    for k in range(odds.size):
        if counts[k]:
            own = min(max(logits[1 + k] - logits[0], -MAX_ODDS), MAX_ODDS)
            share = np.exp(-elapsed / max(memory[k], 1e-12))
            before = share * (1.0 - share if np.isnan(weight[k]) else weight[k])
            weight[k] = before + 1.0 - share
            odds[k] = (before * odds[k] + (1.0 - share) * own) / weight[k]
    return odds, weight


def score(odds: Floats) -> Floats:
    """Return the log odds (...,) of all reasons together, by those of each (..., reasons).

    >>> round(float(score(np.array([0.0, 0.0]))), 3)
    0.693
    """
    return np.logaddexp.reduce(odds, axis=-1)


def reason(odds: Floats, record: AnomalyRecord) -> str:
    """Return the reason to abstain at the log odds (reasons,) of each, empty for none.

    >>> reasons = "microphone 2 is silent", "two things seem to touch"
    >>> record = AnomalyRecord(reasons=reasons, memory=(2.0, 0.2))
    >>> [reason(np.array(each), record) for each in ([-3.0, -3.0], [3.0, 0.0], [3.0, 3.0])]
    ['', 'microphone 2 is silent', 'sound unlike what this model learned']
    """
    total = score(odds)
    if not total > record.limit:
        return ""
    share = np.exp(odds - total)
    best = int(share.argmax())
    return record.reasons[best] if share[best] > MIN_SHARE else UNLIKE
