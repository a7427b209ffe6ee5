"""Whether a pitch keeps still as a string's does, or moves as a voice's does, over windows of a stream."""

from typing import NamedTuple

import numpy as np

from monochord.core.types import Floats
from monochord.core.units import Seconds

LOG_ODDS = 4.0
"""Log odds of a string against a voice before any sound: the sound is said to be a string's."""
APART: Seconds = 0.05
"""Least time between two windows whose pitches are compared."""
STRING_GLIDE, VOICE_GLIDE = 0.012, 0.35
"""Half of a string's windows glide by less than the first, in 1/s of log frequency (Cauchy law); the second
is the mean glide of a voice (exponential law). From 112 takes of strings, and read speech."""
MAX_STEP = 0.12
"""Largest change of log frequency that is a glide; a larger one is another note."""
LEAST_LOG_ODDS = -3.0
"""Least log odds of one comparison: strings are bent, too."""
INDEPENDENT = 0.5
"""Share of a comparison that is news after the one before."""
MIN_EVIDENCE, EVIDENCE_SHARE = 20.0, 0.5
"""Least evidence in nats of a series that is compared, and least share of the note's evidence."""
CHANGES = 0.3
"""Rate at which voices and strings take turns, in 1/s."""


class Steadiness(NamedTuple):
    """The log odds of a string against a voice; log frequency and evidence of the series compared with next.

    `age` is the time since those sounded, in s.
    """

    log_odds: float = LOG_ODDS
    log_frequency: Floats = np.empty(0)
    evidence: Floats = np.empty(0)
    age: Seconds = np.inf

    @property
    def probability(self) -> float:
        """The probability of a string."""
        return float(1.0 / (1.0 + np.exp(-self.log_odds)))


def compare(
    before: Steadiness, note: int | None, log_frequency: Floats, evidence: Floats, elapsed: Seconds
) -> Steadiness:
    """Return the steadiness after a window that follows the last one by `elapsed`, infinite for the first.

    `log_frequency` and `evidence` (series,) are of the series in the window. `note` is the index of the one
    that is the followed note; None if the window has none.
    """
    age = before.age + elapsed
    if age < APART - 1e-9:
        return before._replace(age=age)
    clear = evidence > MIN_EVIDENCE
    after = Steadiness(before.log_odds, log_frequency[clear], evidence[clear], 0.0)
    if note is None or evidence[note] <= MIN_EVIDENCE or not np.isfinite(age):
        return after
    rivals = before.log_frequency[before.evidence > EVIDENCE_SHARE * evidence[note]]
    step = float(np.abs(rivals - log_frequency[note]).min()) if rivals.size else np.inf
    gain = _log_odds(step / age) if step < MAX_STEP else 0.0
    usual = 1.0 / (1.0 + np.exp(-LOG_ODDS))
    string = usual + (before.probability - usual) * np.exp(-age * CHANGES)
    log_odds = np.log(string / (1.0 - string)) + INDEPENDENT * min(age / 0.1, 1.0) * gain
    return after._replace(log_odds=float(log_odds))


def _log_odds(glide: float) -> float:
    """Return the log odds of a string against a voice for a glide in 1/s."""
    string = np.log(2.0 / (np.pi * STRING_GLIDE)) - np.log1p((glide / STRING_GLIDE) ** 2)
    return float(max(string + np.log(VOICE_GLIDE) + glide / VOICE_GLIDE, LEAST_LOG_ODDS))
