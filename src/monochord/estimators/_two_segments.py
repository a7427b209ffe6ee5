"""Position and force from both segments: the lines of two channels, resolved into two harmonic series.

A driver sustains whichever mode its segment happens to lock to, so a strong line is n1 f1 or n2 f2 with
unknown numbers.
Physics resolves them: the open frequency f1 f2 / (f1 + f2) that a pair implies must be one that the string's
tension can have under an allowed force, and each microphone must hear its own segment the louder.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from monochord.dsp import spectrum
from monochord.estimators._usable import why_unusable
from monochord.physics.theory import (
    TensionLaw,
    force_from_tension,
    locate_from_segments,
    tension_from_segments,
    tension_pressed,
    tension_under,
    wave_speed,
)
from monochord.types import Estimate, Floats, StringParams, Window
from monochord.units import Hertz, Newtons

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
SHARP = 7.0
"""Least salience of a line, in nepers of power."""
FAINT = 40.0
"""Lines this many dB below the strongest no longer count."""
TOLERANCE = 2.5
"""How far a line may lie from its place in a series, in Hz."""
LINE_STD = 0.08
"""Standard deviation of a line's frequency, in Hz."""
TENSION_DRIFT = 0.02
"""Share by which the tension may lie below or above what the force explains."""
LEAD = 0.25
"""Least lead in score of the best reading over any that tells something else."""
NEAR = 0.01
"""Readings nearer than this share of the length tell the same position."""


@dataclass(frozen=True, slots=True)
class _Lines:
    """Strong spectral lines: frequency, weight 0 to 1, and channel 1's share of the power."""

    frequency: Floats
    weight: Floats
    share_1: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoSegments:
    """Options of the two-sided form; see `monochord.estimators.closed_form.ClosedForm`."""

    string: StringParams
    law: TensionLaw
    most_force: Newtons

    def prepare(self, sample_rate: int, size: int) -> Callable[[Window], dict[str, Estimate]]:
        """Return the function from a window of two channels to the estimates that `UNITS` names."""
        taper = np.hanning(size + 1)[:-1]
        padded = 1 << int(np.ceil(np.log2(3.0 * size)))
        open_frequency = wave_speed(self.string) / (2.0 * self.string.length)
        lowest, highest = self._open_range(open_frequency)

        def estimate(window: Window) -> dict[str, Estimate]:
            why_not = why_unusable(window)
            if why_not:
                return _abstain(why_not)
            lines = _find_lines(
                window.samples.astype(np.float64), taper, padded, sample_rate, 0.7 * open_frequency
            )
            if lines.frequency.size == 0:
                return _abstain("no harmonic structure")
            return self._read(lines, lowest, highest, open_frequency)

        return estimate

    def _open_range(self, open_frequency: Hertz) -> tuple[Hertz, Hertz]:
        """Return the lowest and highest open frequency that the tension allows."""
        tension = self.string.tension
        if self.law == "linear":
            most = tension_under(self.string, self.most_force)
        else:
            most = tension_pressed(self.string, 0.5 * self.string.length, self.most_force)
        ratio = np.array([1.0 - TENSION_DRIFT, most / tension * (1.0 + TENSION_DRIFT)])
        low, high = open_frequency * np.sqrt(ratio)
        return float(low), float(high)

    def _read(
        self, lines: _Lines, lowest: Hertz, highest: Hertz, open_frequency: Hertz
    ) -> dict[str, Estimate]:
        pairs = _pairs(lines, lowest, highest)
        scores = _scores(lines, pairs)
        untouched, frequency = _untouched(lines, open_frequency)
        if scores.size == 0 or untouched >= scores.max():
            if untouched < LEAD:
                return _abstain("no harmonic structure")
            return _no_contact(frequency)
        best = int(scores.argmax())
        share = pairs[:, 1] / pairs.sum(axis=1)
        rival = np.abs(share - share[best]) > NEAR
        second = max(scores[rival].max() if rival.any() else -np.inf, untouched)
        if scores[best] < LEAD:
            return _abstain("no harmonic structure")
        if scores[best] - second < LEAD:
            return _abstain("two candidates")
        return self._locate(*pairs[best])

    def _locate(self, f1: Hertz, f2: Hertz) -> dict[str, Estimate]:
        string, total = self.string, f1 + f2
        position = locate_from_segments(string.length, f1, f2)
        tension = tension_from_segments(string, f1, f2)
        position_std = string.length * LINE_STD * float(np.hypot(f1, f2)) / total**2
        open_std = LINE_STD * float(np.hypot(f1**2, f2**2)) / total**2
        tension_std = 2.0 * tension * open_std * total / (f1 * f2)
        values = {
            "contact": (1.0, 0.0),
            "frequency": (min(f1, f2), LINE_STD),
            "position": (position, position_std),
            "tension": (tension, tension_std),
            "frequency_1": (f1, LINE_STD),
            "frequency_2": (f2, LINE_STD),
        }
        told = {
            name: Estimate(value=value, std=std, unit=UNITS[name]) for name, (value, std) in values.items()
        }
        return told | {"force": self._force(position, tension, tension_std)}

    def _force(self, position: float, tension: Newtons, tension_std: Newtons) -> Estimate:
        if self.law == "linear" and self.string.tension_per_force == 0.0:
            return Estimate.abstain("N", "the string's tension does not tell force")
        at = None if self.law == "linear" else position

        def force(pull: Newtons) -> Newtons:
            return force_from_tension(self.string, max(pull, self.string.tension), at, self.law)

        value = force(tension)
        std = max(force(tension + tension_std) - value, value - force(tension - tension_std))
        return Estimate(value=value, std=std, unit="N")


def _abstain(why_not: str) -> dict[str, Estimate]:
    return {name: Estimate.abstain(unit, why_not) for name, unit in UNITS.items()}


def _no_contact(frequency: Hertz) -> dict[str, Estimate]:
    return _abstain("no contact") | {
        "contact": Estimate(value=0.0, std=0.0, unit=""),
        "frequency": Estimate(value=frequency, std=LINE_STD, unit="Hz"),
    }


def _find_lines(samples: Floats, taper: Floats, padded: int, sample_rate: int, lowest: Hertz) -> _Lines:
    spacing = sample_rate / padded
    bins = int(min(6000.0, 0.45 * sample_rate) / spacing)
    each = np.stack(
        [spectrum.power_spectrum(channel[np.newaxis], taper, padded)[:bins] for channel in samples]
    )
    power = each.mean(axis=0)
    salience = np.log1p(power / spectrum.noise_floor(power, max(int(500.0 / spacing), 8)))
    found, height, _ = spectrum.find_peaks(power, salience, spacing, taper.size / sample_rate, SHARP)
    inside = found > lowest
    found, height = found[inside], height[inside]
    strongest = np.argsort(-height)[:LINES]
    frequency, height = found[strongest], height[strongest]
    weight = np.clip(1.0 + 10.0 * np.log10(height / height.max(initial=1e-30)) / FAINT, 0.0, 1.0)
    at = np.rint(frequency / spacing).astype(int)
    share_1 = each[0, at] / each[:, at].sum(axis=0) if len(each) == 2 else np.full(at.shape, 0.5)
    return _Lines(frequency=frequency, weight=weight, share_1=share_1)


def _pairs(lines: _Lines, lowest: Hertz, highest: Hertz) -> Floats:
    """Return all (f1, f2) whose open frequency is allowed, made of two lines and two mode numbers."""
    mode = np.arange(1, MODES + 1)
    base = (lines.frequency[:, np.newaxis] / mode).ravel()
    f1, f2 = (grid.ravel() for grid in np.meshgrid(base, base))
    open_frequency = f1 * f2 / (f1 + f2)
    allowed = (lowest <= open_frequency) & (open_frequency <= highest)
    return np.stack((f1[allowed], f2[allowed]), axis=1)


def _scores(lines: _Lines, pairs: Floats) -> Floats:
    """Return how well each pair of series explains the lines: +1 a strong line explained, -1 one left over.

    High mode numbers cost, since drivers favour low modes and a dense series explains anything; a line that
    the other segment's microphone hears louder costs too.
    """
    best = np.full((len(pairs), lines.frequency.size), -1.0)
    for fundamental, share in zip(pairs.T, (lines.share_1, 1.0 - lines.share_1), strict=True):
        number = np.maximum(np.rint(lines.frequency / fundamental[:, np.newaxis]), 1.0)
        hit = np.abs(lines.frequency - number * fundamental[:, np.newaxis]) < TOLERANCE
        told = 1.0 - 0.25 * np.log(number) + 0.5 * np.log(2.0 * np.maximum(share, 0.02))
        best = np.where(hit, np.maximum(best, told), best)
    return best @ lines.weight / lines.weight.sum()


def _untouched(lines: _Lines, open_frequency: Hertz) -> tuple[float, Hertz]:
    """Return the score of the untouched string, one series, and its frequency as measured."""
    number = np.maximum(np.rint(lines.frequency / open_frequency), 1.0)
    drift = 0.5 * TENSION_DRIFT * number * open_frequency
    hit = np.abs(lines.frequency - number * open_frequency) < TOLERANCE + drift
    told = np.where(hit, 1.0 - 0.25 * np.log(number), -1.0)
    strongest = int(lines.weight.argmax())
    measured = float(lines.frequency[strongest] / number[strongest])
    return float((lines.weight * told).sum() / lines.weight.sum()), measured
