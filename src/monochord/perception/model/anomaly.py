"""The anomaly detector: it finds sound unlike the training data, and gives the reason to abstain.

A distance from the training's features misses most faults, because the training data vary more than a fault
changes the sound. So a small network learns to separate ordinary windows from windows of faults and of
untrained contacts (outlier exposure; Hendrycks, Mazeika and Dietterich, Deep anomaly detection with outlier
exposure, 2019). Its input is the window's features only, because a fault may have spoiled the untouched
reference too.

One window is not enough for some faults. Therefore the detector averages its outputs: over seconds for a
lasting fault, and over less than the length of a touch for an unusual touch. A silent driver is detected
during a touch, when its segment hardly rings. Without a touch, a string of another design may sound the same.
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
"""The reason if no learned reason is likely enough."""
MAX_ODDS = 10.0
"""Largest log odds of a window; the limit lets the average fall soon after a clear fault ends."""
MIN_SHARE = 0.5
"""Smallest probability among all reasons at which a reason is named."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AnomalyState:
    """The detector's state on one stream, after the window that starts at `time` (s).

    `odds` (reasons,) are the averaged log odds of each reason; None before the first window. `weight`
    (reasons,) is the total weight of the windows that count for each reason; it approaches 1 in a long
    stream. It is NaN after the first window, because the hop is unknown until the second window; None before
    any window.
    """

    odds: Floats | None = None
    weight: Floats | None = None
    time: Seconds = -math.inf


INITIAL_STATE = AnomalyState()


@dataclass(frozen=True, kw_only=True)
class Detector:
    """The anomaly detector: its layers and its record."""

    record: AnomalyRecord
    layers: Layers

    @classmethod
    def of(cls, definition: Definition, weights: Mapping[str, Audio]) -> "Detector | None":
        """Return the detector of a model; None if the model has none."""
        if definition.known is None:
            return None
        numbers = range(len(definition.known.hidden) + 1)
        layers = [(weights[f"{DETECTOR}.{n}.weight"], weights[f"{DETECTOR}.{n}.bias"]) for n in numbers]
        return cls(record=definition.known, layers=Layers.of(definition.detector_columns, layers))

    def step(self, state: AnomalyState, logits: Floats, time: Seconds, *, touched: bool) -> AnomalyState:
        """Return the state after a window with logits (1 + reasons,) that starts at `time` in s.

        `touched` says whether something touches the string in the window.
        """
        return step(state, logits, time, self.record.memory, self._counts[touched])

    def anomaly_reason(self, state: AnomalyState) -> str:
        """Return why the sound is unlike the training data after the last window; empty if it is not."""
        return "" if state.odds is None else reason(state.odds, self.record)

    def logits(self, rows: Audio) -> Floats:
        """Return the outputs (n, 1 + reasons) for scaled features (n, d); further columns are ignored."""
        return self.layers.outputs(rows).astype(np.float64)

    @cached_property
    def _counts(self) -> tuple[Flags, Flags]:
        """The reasons (reasons,) that a window counts for, of an untouched one and of a touched one."""
        always = np.array([reason not in self.record.touched for reason in self.record.reasons])
        return always, np.ones_like(always)


def step(
    state: AnomalyState, logits: Floats, time: Seconds, memory: Sequence[Seconds], counts: Flags | None = None
) -> AnomalyState:
    """Return the state after a window with logits (1 + reasons,) that starts at `time` in s.

    The log odds are averaged over windows. Weights fall by a factor e in the time in `memory` (reasons,), at
    any hop. The first windows of a stream count like all others, although the drivers may only be starting.
    `counts` (reasons,) says for which reasons the window counts; the other averages do not change.

    >>> state = step(AnomalyState(), np.array([0.0, 2.0, 2.0]), 0.0, (0.5, 0.0))
    >>> step(state, np.array([0.0, 0.0, 0.0]), 0.5, (0.5, 0.0)).odds.round(3).tolist()
    [0.538, 0.0]
    >>> step(state, np.zeros(3), 0.5, (0.5, 0.0), np.array([True, False])).odds.round(3).tolist()
    [0.538, 2.0]
    """
    counts = np.ones(len(memory), bool) if counts is None else counts
    if not len(logits) - 1 == len(memory) == len(counts):
        raise InputError(f"{len(logits)} logits", f"{1 + len(memory)} for {len(memory)} reasons")
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
    """Return the log odds (...,) that any reason applies, from the log odds (..., reasons) of each.

    >>> round(float(score(np.array([0.0, 0.0]))), 3)
    0.693
    """
    return np.logaddexp.reduce(odds, axis=-1)


def reason(odds: Floats, record: AnomalyRecord) -> str:
    """Return the reason to abstain from the log odds (reasons,) of each reason; empty for none.

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
