"""Position from the far segment alone: one fretted or pressed string, one note, its open note known."""

from dataclasses import dataclass, field

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Estimate, Estimates, Floats, Window
from monochord.core.units import Hertz, Metres
from monochord.dsp.pitch import PitchFinder, Series
from monochord.dsp.pitch_steadiness import SteadinessMeter
from monochord.perception.usable import unusable_reason
from monochord.physics.theory import position_from_far_segment

MAX_TAKE_DEVIATION = 8.0
"""Standard deviations from the expected position beyond which a calibration take is refused."""
NUT_DISTANCE = 1.0e-3
"""Calibration takes nearer to the nut than this, in m, are the open note itself."""
SETUP_STD = 0.004
"""Standard deviation of both departures of real instruments from the clamp; see `Setup`."""
TAKE_STD = 0.0008
"""Standard error of a calibration take's position, as a share of the length: 0.5 mm on 650 mm."""
SAME_POSITION = 0.006
"""Candidates nearer to each other than this share of the length are of the same position."""
SECOND_EVIDENCE, SECOND_POWER = 12.0, 0.25
"""Least evidence in nats, and least share of the power outside the best series, of a second string."""
OUTSIDE_MARGINS = 1.7
"""Lead, in multiples of `margin`, from which a note outside the string's range is accepted as one."""
EDGE_CENTS = 4.0
"""Distance in cents by which a fit may lie outside the searched range and still count as inside."""
MAX_GLIDE, MAX_SCATTER, MAX_MISSING = 0.125, 0.11, 0.45
"""Largest glide of a string's pitch and scatter of its partials, in 1/s, and share of them that do not hold;
chosen on 39 plucked takes, in quiet and with interference (docs/design/reader-of-modes.md)."""
MAX_FLAT_CENTS = 40.0
"""Largest distance in cents of a note below the open one: tunings drift."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """Departures of an instrument from the clamp, as estimated from calibration takes.

    Pressing raises the tension, so that the wave speed grows by a share e; and the string ends a share d of
    its length behind the bridge's nominal place (a maker moves the saddle back to compensate e). Then
    f = f_open (1 + e)(1 + d) / (1 + d - x/L), and with q = f_open / f, x/L = 1 - q + d - q a, where
    a = (1 + e)(1 + d) - 1. Before any take e and d are independent, of mean zero and of standard deviation
    `SETUP_STD`; takes with known x narrow (a, d) by linear regression.
    """

    shift: Floats = field(default_factory=lambda: np.zeros(2))
    covariance: Floats = field(default_factory=lambda: SETUP_STD**2 * np.array([[2.0, 1.0], [1.0, 1.0]]))

    def learn(self, ratio: float, position: float) -> "Setup":
        """Return the setup after a take with q = `ratio` at x/L = `position`; refuse an implausible one."""
        slope = np.array([-ratio, 1.0])
        spread = self.covariance @ slope
        variance = slope @ spread + TAKE_STD**2
        gain = spread / variance
        expected = 1.0 - ratio + slope @ self.shift
        error = position - expected
        if abs(error) > MAX_TAKE_DEVIATION * variance**0.5:
            given = f"calibration take at {100.0 * position:.1f} % of the length"
            allowed = (
                f"{100.0 * expected:.1f} % give or take {100.0 * MAX_TAKE_DEVIATION * variance**0.5:.1f}"
            )
            raise InputError(
                given, f"{allowed}, where its pitch puts it", "check its position and the open note"
            )
        return Setup(shift=self.shift + gain * error, covariance=self.covariance - np.outer(gain, spread))

    def correct(self, ratio: float) -> tuple[float, float]:
        """Return the correction of 1 - q to x/L, and its standard deviation."""
        slope = np.array([-ratio, 1.0])
        return float(slope @ self.shift), float(np.sqrt(slope @ self.covariance @ slope))


@dataclass(frozen=True, slots=True, kw_only=True)
class FarSegment:
    """Options of the far-segment form; see `monochord.perception.estimators.closed_form.ClosedForm`."""

    length: Metres
    open_frequency: Hertz
    calibration: tuple[tuple[float, ...], ...]
    reach: float
    margin: float
    evidence: float

    def __post_init__(self) -> None:
        if not 0.0 < self.length < np.inf:
            raise InputError(f"string length {self.length:g} m", "above 0 m", "give --length in metres")
        if not 10.0 <= self.open_frequency <= 5000.0:
            given = f"open frequency {self.open_frequency:g} Hz"
            raise InputError(given, "10 to 5000 Hz", "give the untouched string's pitch")
        if not 0.0 < self.reach < 1.0:
            raise InputError(f"reach {self.reach:g}", "a share of the length between 0 and 1", "0.8 is usual")
        for take in self.calibration:
            fits = 2 <= len(take) <= 3 and 0.0 < take[0] < np.inf and 0.0 <= take[1] < self.length
            if not (fits and all(0.0 <= b < 1.0 for b in take[2:])):
                form = f"[frequency in Hz, position from 0 to {self.length:g} m, inharmonicity B if known]"
                raise InputError(f"calibration {list(take)}", form)

    def prepare(self, sample_rate: int, size: int) -> "FarReader":
        """Return the function from a window to frequency, position and inharmonicity."""
        open_frequency, inharmonicity = self._open_note()
        setup = Setup()
        for frequency, position, *_ in self.calibration:
            if position >= NUT_DISTANCE:
                setup = setup.learn(open_frequency / frequency, position / self.length)
        finder = PitchFinder(
            sample_rate=sample_rate,
            size=size,
            lowest=open_frequency * 2.0 ** (-MAX_FLAT_CENTS / 1200.0),
            highest=min(open_frequency / (1.0 - self.reach), 0.2 * sample_rate),
            inharmonicity_prior=inharmonicity,
        )
        return FarReader(
            finder=finder,
            meter=SteadinessMeter(sample_rate=sample_rate, size=size),
            setup=setup,
            length=self.length,
            open_frequency=open_frequency,
            margin=self.margin,
            evidence=self.evidence,
        )

    def _open_note(self) -> tuple[Hertz, tuple[float, float]]:
        """Return the open frequency, and mean and standard deviation of B on the open string."""
        at_nut = [take for take in self.calibration if take[1] < NUT_DISTANCE]
        frequency = float(np.mean([take[0] for take in at_nut])) if at_nut else self.open_frequency
        measured = [take[2] * (frequency / take[0]) ** 2 for take in self.calibration if len(take) > 2]
        mean = max(float(np.median(measured)), 1.0e-5) if measured else 5.0e-5
        return frequency, (mean, 0.05 * mean if measured else 2.0e-4)


@dataclass(frozen=True, slots=True, kw_only=True)
class FarReader:
    """A prepared far-segment form: the function from a window to its estimates, in two steps.

    Parameters
    ----------
    finder
        Finds the series in a window.
    meter
        Measures how steady a series is.
    setup
        What pressing does on this instrument.
    length, open_frequency
        Of the string, in m and in Hz.
    margin, evidence
        Options of the form.
    """

    finder: PitchFinder
    meter: SteadinessMeter
    setup: Setup
    length: Metres
    open_frequency: Hertz
    margin: float
    evidence: float

    def __call__(self, window: Window) -> Estimates:
        """Return the estimates of a window."""
        why_not = unusable_reason(window)
        return abstain(why_not) if why_not else self.locate(window, self.series(window))

    def series(self, window: Window) -> list[Series]:
        """Return the series in a usable window, best first."""
        return self.finder.find(window.samples.astype(np.float64))

    def locate(self, window: Window, candidates: list[Series]) -> Estimates:
        """Return the estimates from the series in a window."""
        why_not = self._why_undecided(candidates)
        if why_not:
            return abstain(why_not)
        best = next(each for each in candidates if self.is_inside(each.frequency))
        why_not = self._why_unsteady(window, best)
        return abstain(why_not) if why_not else self._located(best)

    def _why_unsteady(self, window: Window, series: Series) -> str:
        steadiness = self.meter.measure(window.samples, series.frequency, series.inharmonicity)
        if abs(steadiness.glide) > MAX_GLIDE:
            return "the pitch glides as no held string's does"
        if steadiness.scatter > MAX_SCATTER or steadiness.missing > MAX_MISSING:
            return "partials that do not hold as a string's do"
        return ""

    @property
    def _inside(self) -> tuple[Hertz, Hertz]:
        edge = 2.0 ** (EDGE_CENTS / 1200.0)
        return self.finder.lowest / edge, self.finder.highest * edge

    def is_inside(self, frequency: Hertz) -> bool:
        """Return whether a note is in the string's range."""
        lowest, highest = self._inside
        return lowest <= frequency <= highest

    def _why_undecided(self, candidates: list[Series]) -> str:
        inside = self._inside
        allowed = [series for series in candidates if self.is_inside(series.frequency)]
        if not allowed or allowed[0].evidence < self.evidence:
            return "no harmonic structure"
        best, strongest = allowed[0], candidates[0]
        if strongest.evidence > best.evidence + OUTSIDE_MARGINS * self.margin:
            return f"a note of {strongest.frequency:.1f} Hz, outside {inside[0]:.1f} to {inside[1]:.1f} Hz"
        for other in allowed[1:]:
            distance = self.open_frequency * abs(1.0 / other.frequency - 1.0 / best.frequency)
            close = best.evidence - other.evidence < self.margin
            second = other.evidence > SECOND_EVIDENCE and other.beside(best) > SECOND_POWER
            if distance > SAME_POSITION and (close or second):
                return f"two candidates, {best.frequency:.1f} and {other.frequency:.1f} Hz"
        return ""

    def _located(self, series: Series) -> Estimates:
        ratio = self.open_frequency / series.frequency
        correction, correction_std = self.setup.correct(ratio)
        position = position_from_far_segment(series.frequency, self.open_frequency, self.length)
        position = min(max(position + self.length * correction, 0.0), self.length)
        noise = ratio * series.frequency_std / series.frequency
        return {
            "frequency": Estimate(value=series.frequency, std=series.frequency_std, unit="Hz"),
            "position": Estimate(
                value=position, std=self.length * float(np.hypot(noise, correction_std)), unit="m"
            ),
            "inharmonicity": Estimate(value=series.inharmonicity, std=series.inharmonicity_std, unit=""),
        }


def abstain(why_not: str) -> Estimates:
    """Return an abstention from each of the far-segment form's estimates."""
    units = {"frequency": "Hz", "position": "m", "inharmonicity": ""}
    return {name: Estimate.abstain(unit, why_not) for name, unit in units.items()}
