"""Position and force from both segments: the lines of two channels, resolved into two harmonic series.

A driver sustains whichever mode its segment happens to lock to, so a strong line is n1 f1 or n2 f2 with
unknown numbers.
Physics resolves them: the open frequency f1 f2 / (f1 + f2) that a pair implies must be one that the string's
tension can have under an allowed force, and each microphone must hear its own segment the louder.
"""

from dataclasses import dataclass

import numpy as np

from monochord.dsp.spectrum import Analyser
from monochord.estimators._usable import why_unusable
from monochord.estimators.base import Estimates, Prepared
from monochord.physics.theory import (
    TensionLaw,
    force_from_tension,
    locate_from_segments,
    open_frequency,
    tension_from_force,
    tension_from_segments,
)
from monochord.types import Estimate, Floats, StringParams, Window
from monochord.units import Hertz, Metres, Newtons

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
MODES = 6
"""Highest mode that a driver is thought to lock to."""
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


@dataclass(frozen=True, slots=True)
class _Lines:
    """Strong spectral lines: frequency and its error in Hz, weight 0 to 1, channel 1's share of the power."""

    frequency: Floats
    std: Floats
    weight: Floats
    share_1: Floats
    tolerance: Hertz


@dataclass(frozen=True, slots=True)
class _Pairs:
    """Readings of two lines as modes of the two segments: (f1, f2) and their errors, each (readings, 2)."""

    frequency: Floats
    std: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoSegments:
    """Options of the two-sided form; see `monochord.estimators.closed_form.ClosedForm`."""

    string: StringParams
    law: TensionLaw
    most_force: Newtons

    def prepare(self, sample_rate: int, size: int) -> Prepared:
        """Return the function from a window of two channels to the estimates that `UNITS` names."""
        analyser = Analyser(sample_rate=sample_rate, size=size, top=TOP)
        untouched = open_frequency(self.string)
        most = tension_from_force(self.string, self.most_force, 0.5 * self.string.length, self.law)
        lowest = untouched * (1.0 - TENSION_DRIFT) ** 0.5
        highest = untouched * (most / self.string.tension * (1.0 + TENSION_DRIFT)) ** 0.5

        def estimate(window: Window) -> Estimates:
            why_not = why_unusable(window)
            if why_not:
                return _abstain(why_not)
            lines = _find_lines(analyser, window.samples.astype(np.float64), LOWEST_LINE * untouched)
            if lines.frequency.size == 0:
                return _abstain("no harmonic structure")
            return self._read(lines, _pairs(lines, lowest, highest), untouched)

        return estimate

    def _read(self, lines: _Lines, pairs: _Pairs, untouched: Hertz) -> Estimates:
        scores = _scores(lines, pairs.frequency)
        rest, frequency, std = _untouched(lines, untouched)
        if max(scores.max(initial=-np.inf), rest) < LEAD:
            return _abstain("no harmonic structure")
        if scores.size == 0 or rest >= scores.max():
            return _no_contact(frequency, std, rest - scores.max(initial=-np.inf))
        best = int(scores.argmax())
        share = pairs.frequency[:, 1] / pairs.frequency.sum(axis=1)
        rival = scores[np.abs(share - share[best]) > NEAR].max(initial=-np.inf)
        if scores[best] - max(rival, rest) < LEAD:
            return _abstain("two candidates")
        return self._locate(pairs.frequency[best], pairs.std[best], scores[best] - rest)

    def _locate(self, frequency: Floats, std: Floats, lead: float) -> Estimates:
        f1, f2 = frequency.tolist()
        length, total = self.string.length, f1 + f2
        position = locate_from_segments(length, f1, f2)
        tension = tension_from_segments(self.string, f1, f2)
        position_std = length * float(np.hypot(f1 * std[1], f2 * std[0])) / total**2
        tension_std = 2.0 * tension * float(np.hypot(f2 / f1 * std[0], f1 / f2 * std[1])) / total
        low = int(f2 < f1)
        values = {
            "contact": (1.0, _doubt(lead)),
            "frequency": (frequency[low], std[low]),
            "position": (position, position_std),
            "tension": (tension, tension_std),
            "frequency_1": (f1, std[0]),
            "frequency_2": (f2, std[1]),
        }
        told = {
            name: Estimate(value=float(value), std=float(error), unit=UNITS[name])
            for name, (value, error) in values.items()
        }
        return told | {"force": self._force(position, tension, tension_std)}

    def _force(self, position: Metres, tension: Newtons, tension_std: Newtons) -> Estimate:
        if self.law == "linear" and self.string.tension_per_force == 0.0:
            return Estimate.abstain("N", "the string's tension does not tell force")

        def force(pull: Newtons) -> Newtons:
            return force_from_tension(self.string, max(pull, self.string.tension), position, self.law)

        value = force(tension)
        std = max(force(tension + tension_std) - value, value - force(tension - tension_std))
        return Estimate(value=value, std=std, unit="N")


def _abstain(why_not: str) -> dict[str, Estimate]:
    return {name: Estimate.abstain(unit, why_not) for name, unit in UNITS.items()}


def _no_contact(frequency: Hertz, std: Hertz, lead: float) -> Estimates:
    return _abstain("no contact") | {
        "contact": Estimate(value=0.0, std=_doubt(lead), unit=""),
        "frequency": Estimate(value=frequency, std=std, unit="Hz"),
    }


def _doubt(lead: float) -> float:
    """Return the standard deviation of a yes or no that leads its contrary by a score."""
    return max(LEAST_DOUBT, float(0.5 / np.cosh(0.5 * min(lead, 10.0) / SCORE_SCALE)))


def _find_lines(analyser: Analyser, samples: Floats, lowest: Hertz) -> _Lines:
    each = analyser.powers(samples)
    power = each.mean(axis=0)
    peaks = analyser.peaks(power, analyser.salience(power), SHARP)
    strongest = np.argsort(-np.where(peaks.frequency > lowest, peaks.power, -np.inf))[:LINES]
    chosen = strongest[peaks.frequency[strongest] > lowest]
    height = peaks.power[chosen]
    at = np.rint(peaks.frequency[chosen] / analyser.spacing).astype(int)
    return _Lines(
        frequency=peaks.frequency[chosen],
        std=np.sqrt(peaks.variance[chosen]),
        weight=np.clip(1.0 + 10.0 * np.log10(height / height.max(initial=1e-30)) / FAINT, 0.0, 1.0),
        share_1=each[0, at] / each[:, at].sum(axis=0),
        tolerance=TOLERANCE * analyser.resolution,
    )


def _pairs(lines: _Lines, lowest: Hertz, highest: Hertz) -> _Pairs:
    """Return all (f1, f2) whose open frequency is allowed, made of two lines and two mode numbers."""
    mode = np.arange(1, MODES + 1)
    base = (lines.frequency[:, np.newaxis] / mode).ravel()
    std = (lines.std[:, np.newaxis] / mode).ravel()
    together = base * base[:, np.newaxis] / (base + base[:, np.newaxis])
    first, second = np.nonzero((lowest <= together) & (together <= highest))
    return _Pairs(
        frequency=np.stack((base[first], base[second]), axis=1),
        std=np.stack((std[first], std[second]), axis=1),
    )


def _scores(lines: _Lines, pairs: Floats) -> Floats:
    """Return how well each pair of series explains the lines: +1 a strong line explained, -1 one left over.

    High mode numbers cost, since drivers favour low modes and a dense series explains anything; a line that
    the other segment's microphone hears louder costs too.
    """
    best = np.full((len(pairs), lines.frequency.size), -1.0)
    for fundamental, share in zip(pairs.T, (lines.share_1, 1.0 - lines.share_1), strict=True):
        number = np.maximum(np.rint(lines.frequency / fundamental[:, np.newaxis]), 1.0)
        hit = np.abs(lines.frequency - number * fundamental[:, np.newaxis]) < lines.tolerance
        told = 1.0 - 0.25 * np.log(number) + 0.5 * np.log(2.0 * np.maximum(share, 0.02))
        best = np.where(hit, np.maximum(best, told), best)
    return best @ lines.weight / lines.weight.sum()


def _untouched(lines: _Lines, frequency: Hertz) -> tuple[float, Hertz, Hertz]:
    """Return the score of the untouched string, one series, and its frequency as measured with its error."""
    number = np.maximum(np.rint(lines.frequency / frequency), 1.0)
    drift = 0.5 * TENSION_DRIFT * number * frequency
    hit = np.abs(lines.frequency - number * frequency) < lines.tolerance + drift
    told = np.where(hit, 1.0 - 0.25 * np.log(number), -1.0)
    k = int(lines.weight.argmax())
    score = float((lines.weight * told).sum() / lines.weight.sum())
    return score, float(lines.frequency[k] / number[k]), float(lines.std[k] / number[k])
