"""Position and force from both segments, by the modes that the lines of two microphones are.

Position is x = L f2 / (f1 + f2) and tension T = mu (2 L f1 f2 / (f1 + f2))^2, with f1 and f2 the fundamentals
of the segments without their stiffness; a tension law turns tension into force. Which modes the lines are,
`monochord.perception.closed_form.modes` reads.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from monochord.core.types import OUTSIDE_RANGE, Estimate, Estimates, Prepared, Signal, StringParams, Window
from monochord.core.units import Hertz, Metres, Newtons
from monochord.dsp.spectrum import BEAT, BLUR, FLOOR_WIDTH, noise_floor
from monochord.perception.closed_form.modes import ModeReading
from monochord.perception.closed_form.spectrum import Spectrum, SpectrumAnalyser
from monochord.perception.closed_form.usable import unusable_reason
from monochord.physics.theory import TensionLaw, force_from_tension, tension_from_force, tension_from_segments

UNITS = {
    "contact": "",
    "frequency": "Hz",
    "position": "m",
    "force": "N",
    "tension": "N",
    "frequency_1": "Hz",
    "frequency_2": "Hz",
}
MIN_SALIENCE = 7.0
"""Least height of a microphone's strongest line over the noise floor, in nepers of power."""
MIN_SCORE = 0.25
"""Least score of a reading, and least lead of contact over none or the other way round."""
MAX_OPEN_FALL = 0.025
"""Largest share by which the open pitch of a reading may lie below the string's own. A touch that gives way
lengthens both segments by a few millimetres at most; wrong modes may lower it by any amount."""
MIN_LEAD = 2.0
"""Least logarithm of the odds of a place, some 7 to 1; see docs/design/reader-of-modes.md."""
CLAMP_POSITION_STD, CLAMP_TENSION_STD = 2.5e-3, 2.5e-2
"""Standard deviations of what a clamp leaves out: of the position as a share of the length, of the tension
as a share of it. A compliant touch lengthens both segments, ends yield, drivers pull; on plausible builds of
the twin 68 % of positions are within 0.5 mm of 200, and of tensions within 2.3 %."""
SCORE_SCALE, MIN_CONTACT_STD = 0.1, 0.01
"""Lead in score that makes a reading e times as likely as its rival, and the least error; set by hand."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TwoSegments:
    """Options of the two-sided form; see `monochord.perception.estimators.closed_form.ClosedForm`."""

    string: StringParams
    law: TensionLaw
    most_force: Newtons
    sensing_range: tuple[Metres, Metres] | None = None

    def prepare(self, sample_rate: int, size: int) -> Prepared:
        """Return the function from a window of two channels to the estimates that `UNITS` names."""
        analyser = self.analyser(sample_rate, size)

        def estimate(window: Window) -> Estimates:
            why_not = unusable_reason(window)
            return abstain(why_not) if why_not else self.estimates(analyser, analyser.analyse(window.samples))

        return estimate

    def analyser(self, sample_rate: int, size: int) -> SpectrumAnalyser:
        """Return the analyser of windows of `size` frames, for the forces that are expected."""
        string = self.string
        largest = tension_from_force(string, self.most_force, 0.5 * string.length, self.law)
        rise = (largest / string.tension) ** 0.5 - 1.0
        signal = Signal(sample_rate=sample_rate, channels=2, string=string)
        return SpectrumAnalyser.of(signal, size, rise=rise)

    def tuned(self, string: StringParams) -> "TwoSegments":
        """Return the form of the same wire under another tension."""
        return replace(self, string=string)

    def estimates(self, analyser: SpectrumAnalyser, spectrum: Spectrum) -> Estimates:
        """Return the estimates from the spectra of a window that can be used."""
        reading, line_std = spectrum.reading, _LineErrors(analyser, spectrum)
        if line_std.salience < MIN_SALIENCE or max(reading.score, reading.untouched_score) < MIN_SCORE:
            return abstain("no harmonic structure")
        if reading.contact_lead <= 0.0:
            frequency = reading.untouched_frequency
            return abstain("no contact") | {
                "contact": Estimate(value=0.0, std=_contact_std(-reading.contact_lead), unit=""),
                "frequency": Estimate(value=frequency, std=line_std(frequency), unit="Hz"),
            }
        if reading.contact_lead < MIN_SCORE or reading.lead < MIN_LEAD:
            return abstain("two candidates")
        touched = {"contact": Estimate(value=1.0, std=_contact_std(reading.contact_lead), unit="")}
        low, high = self.sensing_range or (0.0, self.string.length)
        if not low <= reading.position <= high:
            return abstain(OUTSIDE_RANGE) | touched
        if reading.open_frequency < (1.0 - MAX_OPEN_FALL) * analyser.nominal:
            return abstain("two candidates") | touched
        std_1 = line_std(reading.line_1) / reading.mode_1
        return touched | self._located(reading, std_1, line_std(reading.line_2) / reading.mode_2)

    def _located(self, reading: ModeReading, std_1: Hertz, std_2: Hertz) -> dict[str, Estimate]:
        length, position = self.string.length, reading.position
        f1 = reading.open_frequency * length / position
        f2 = reading.open_frequency * length / (length - position)
        tension = tension_from_segments(self.string, f1, f2)
        noise = length * math.hypot(f1 * std_2, f2 * std_1) / (f1 + f2) ** 2
        position_std = math.hypot(noise, CLAMP_POSITION_STD * length)
        noise = 2.0 * tension * math.hypot(f2 / f1 * std_1, f1 / f2 * std_2) / (f1 + f2)
        tension_std = math.hypot(noise, CLAMP_TENSION_STD * tension)
        values = {
            "frequency": (f2, std_2) if f2 < f1 else (f1, std_1),
            "position": (position, position_std),
            "tension": (tension, tension_std),
            "frequency_1": (f1, std_1),
            "frequency_2": (f2, std_2),
        }
        estimates = {
            name: Estimate(value=value, std=std, unit=UNITS[name]) for name, (value, std) in values.items()
        }
        return estimates | {"force": self._force(position, tension, tension_std)}

    def _force(self, position: Metres, tension: Newtons, tension_std: Newtons) -> Estimate:
        if self.law == "linear" and self.string.tension_per_force == 0.0:
            return Estimate.abstain("N", "the string's tension does not tell force")

        # The force, and what it would be one standard error of the tension further down and up: half of the
        # range between, since a force cannot be negative and light ones hardly raise the tension.
        tension = max(tension, self.string.tension)
        tensions = np.array([tension, tension - tension_std, tension + tension_std])
        tensions = np.maximum(tensions, self.string.tension)
        forces = force_from_tension(self.string, tensions, np.full(3, position), self.law)
        value, low, high = forces.tolist()
        return Estimate(value=value, std=0.5 * (high - low), unit="N")


class _LineErrors:
    """Standard errors of the frequencies of a window's lines, from their height over the noise floor."""

    def __init__(self, analyser: SpectrumAnalyser, spectrum: Spectrum) -> None:
        self._spacing = analyser.bin_spacing
        block = max(int(FLOOR_WIDTH / self._spacing), 8)
        floor = np.stack([noise_floor(power, block) for power in spectrum.power])
        self._salience = np.log1p(spectrum.power / floor).max(axis=0)

    @property
    def salience(self) -> float:
        """Salience of the strongest line."""
        return float(self._salience.max())

    def __call__(self, frequency: Hertz) -> Hertz:
        salience = float(self._salience[round(frequency / self._spacing)])
        return self._spacing * math.hypot(BEAT, BLUR * math.exp(-0.5 * salience))


def abstain(why_not: str) -> dict[str, Estimate]:
    """Return an abstention from each of the two-sided form's estimates."""
    return {name: Estimate.abstain(unit, why_not) for name, unit in UNITS.items()}


def _contact_std(lead: float) -> float:
    """Return the standard deviation of a yes or no that leads its contrary by a score."""
    return max(MIN_CONTACT_STD, 0.5 / math.cosh(0.5 * min(lead, 10.0) / SCORE_SCALE))
