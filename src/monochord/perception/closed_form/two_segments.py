"""Position and force from both segments: the lines of two channels, resolved into two harmonic series.

A driver sustains whichever mode its segment happens to lock to, so a strong line is n1 f1 or n2 f2 with
unknown numbers.
Physics resolves them: the open frequency f1 f2 / (f1 + f2) that a pair implies must be one that the string's
tension can have under an allowed force, and each microphone must hear its own segment the louder.
"""

import math
from dataclasses import dataclass

import numpy as np

from monochord.core.types import Audio, Estimate, Estimates, Prepared, StringParams, Window
from monochord.core.units import Hertz, Metres, Newtons
from monochord.dsp.spectrum import Analyser
from monochord.perception.closed_form._readings import Lines, Pairs, pairs, scores, untouched
from monochord.perception.closed_form.usable import why_unusable
from monochord.physics.theory import (
    TensionLaw,
    force_from_tension,
    locate_from_segments,
    open_frequency,
    tension_from_force,
    tension_from_segments,
)

UNITS = {
    "contact": "",
    "frequency": "Hz",
    "position": "m",
    "force": "N",
    "tension": "N",
    "frequency_1": "Hz",
    "frequency_2": "Hz",
}
LINES = 10
"""Strongest lines looked at."""
TOP: Hertz = 6000.0
"""Highest frequency looked at."""
LOWEST_LINE = 0.7
"""Lines below this share of the open frequency are rumble and hum."""
SHARP = 7.0
"""Least salience of a line, in nepers of power."""
FAINT = 40.0
"""Lines this many dB below the strongest no longer count."""
TOLERANCE = 0.25
"""How far a line may lie from its place in a series, as a share of the resolution."""
TENSION_DRIFT = 0.02
"""Share by which the tension may lie below or above what the force explains."""
LEAD = 0.25
"""Least lead in score of the best reading over any that tells something else."""
SCORE_SCALE, LEAST_DOUBT = 0.1, 0.01
"""Lead in score that makes a reading e times as likely as its rival, and the least doubt: judged by eye."""
NEAR = 0.01
"""Readings nearer than this share of the length tell the same position."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoSegments:
    """Options of the two-sided form; see `monochord.perception.estimators.closed_form.ClosedForm`."""

    string: StringParams
    law: TensionLaw
    most_force: Newtons

    def prepare(self, sample_rate: int, size: int) -> Prepared:
        """Return the function from a window of two channels to the estimates that `UNITS` names."""
        analyser = Analyser(sample_rate=sample_rate, size=size, top=TOP)
        own = open_frequency(self.string)
        most = tension_from_force(self.string, self.most_force, 0.5 * self.string.length, self.law)
        lowest = own * (1.0 - TENSION_DRIFT) ** 0.5
        highest = own * (most / self.string.tension * (1.0 + TENSION_DRIFT)) ** 0.5

        def estimate(window: Window) -> Estimates:
            why_not = why_unusable(window)
            if why_not:
                return _abstain(why_not)
            lines = _find_lines(analyser, window.samples, LOWEST_LINE * own)
            if lines.frequency.size == 0:
                return _abstain("no harmonic structure")
            return self._read(lines, pairs(lines, lowest, highest), own)

        return estimate

    def _read(self, lines: Lines, read: Pairs, own: Hertz) -> Estimates:
        score = scores(lines, read.frequency)
        most = float(score.max(initial=-np.inf))
        rest, frequency, std = untouched(lines, own, 0.5 * TENSION_DRIFT)
        if max(most, rest) < LEAD:
            return _abstain("no harmonic structure")
        if rest >= most:
            return _no_contact(frequency, std, rest - most)
        best = int(score.argmax())
        share = read.frequency[:, 1] / read.frequency.sum(axis=1)
        rival = score[np.abs(share - share[best]) > NEAR].max(initial=-np.inf)
        if most - max(rival, rest) < LEAD:
            return _abstain("two candidates")
        (f1, f2), (std_1, std_2) = read.frequency[best].tolist(), read.std[best].tolist()
        return self._locate(f1, f2, std_1, std_2, most - rest)

    def _locate(self, f1: Hertz, f2: Hertz, std_1: Hertz, std_2: Hertz, lead: float) -> Estimates:
        length, total = self.string.length, f1 + f2
        position = locate_from_segments(length, f1, f2)
        tension = tension_from_segments(self.string, f1, f2)
        position_std = length * math.hypot(f1 * std_2, f2 * std_1) / total**2
        tension_std = 2.0 * tension * math.hypot(f2 / f1 * std_1, f1 / f2 * std_2) / total
        values = {
            "contact": (1.0, _doubt(lead)),
            "frequency": (f2, std_2) if f2 < f1 else (f1, std_1),
            "position": (position, position_std),
            "tension": (tension, tension_std),
            "frequency_1": (f1, std_1),
            "frequency_2": (f2, std_2),
        }
        told = {
            name: Estimate(value=value, std=error, unit=UNITS[name])
            for name, (value, error) in values.items()
        }
        return told | {"force": self._force(position, tension, tension_std)}

    def _force(self, position: Metres, tension: Newtons, tension_std: Newtons) -> Estimate:
        if self.law == "linear" and self.string.tension_per_force == 0.0:
            return Estimate.abstain("N", "the string's tension does not tell force")

        # The force, and what it would be one standard error of the tension further down and up.
        pulls = np.array([tension, tension - tension_std, tension + tension_std])
        pulls = np.maximum(pulls, self.string.tension)
        forces = force_from_tension(self.string, pulls, np.full(3, position), self.law)
        value, low, high = forces.tolist()
        return Estimate(value=value, std=max(high - value, value - low), unit="N")


def _abstain(why_not: str) -> dict[str, Estimate]:
    return {name: Estimate.abstain(unit, why_not) for name, unit in UNITS.items()}


def _no_contact(frequency: Hertz, std: Hertz, lead: float) -> Estimates:
    return _abstain("no contact") | {
        "contact": Estimate(value=0.0, std=_doubt(lead), unit=""),
        "frequency": Estimate(value=frequency, std=std, unit="Hz"),
    }


def _doubt(lead: float) -> float:
    """Return the standard deviation of a yes or no that leads its contrary by a score."""
    return max(LEAST_DOUBT, 0.5 / math.cosh(0.5 * min(lead, 10.0) / SCORE_SCALE))


def _find_lines(analyser: Analyser, samples: Audio, lowest: Hertz) -> Lines:
    each = analyser.powers(samples)
    power = each.mean(axis=0)
    peaks = analyser.peaks(power, analyser.salience(power), SHARP)
    high = np.flatnonzero(peaks.frequency > lowest)
    chosen = high[np.argsort(-peaks.power[high])[:LINES]]
    frequency, height = peaks.frequency[chosen], peaks.power[chosen]
    heard = each[:, np.rint(frequency / analyser.spacing).astype(int)]
    return Lines(
        frequency=frequency,
        std=np.sqrt(peaks.variance[chosen]),
        weight=np.maximum(1.0 + 10.0 * np.log10(height / height.max(initial=1e-30)) / FAINT, 0.0),
        share_1=heard[0] / heard.sum(axis=0),
        tolerance=TOLERANCE * analyser.resolution,
    )
