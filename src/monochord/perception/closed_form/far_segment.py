"""Position from the far segment alone: one fretted or pressed string, one note, its open note known."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from monochord.core.errors import InputError
from monochord.core.reasons import Reason
from monochord.core.types import Estimate, Estimates, Flags, Floats, Window
from monochord.core.units import Hertz, Metres, Samples
from monochord.dsp.pitch import PitchFinder, Series
from monochord.perception.closed_form.note_follower import EVIDENCE, FREQUENCY, NO_NOTES, Notes, follow
from monochord.perception.closed_form.steadiness import Steadiness, compare
from monochord.perception.usable import unusable_reason

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
EDGE_CENTS = 4.0
"""Distance in cents by which a fit may lie outside the searched range and still count as inside."""
OUTSIDE = 0.01
"""Prior odds of a note outside the string's range to one inside it: the sound is said to be this string's."""
LEAST_PROBABILITY = 0.95
"""Least probability of a position that is stated."""
SAME_SERIES = 0.01
"""Largest distance in log frequency of a window's series from the note that it is."""
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
        return FarReader(finder=finder, setup=setup, length=self.length, open_frequency=open_frequency)

    def _open_note(self) -> tuple[Hertz, tuple[float, float]]:
        """Return the open frequency, and mean and standard deviation of B on the open string."""
        at_nut = [take for take in self.calibration if take[1] < NUT_DISTANCE]
        frequency = float(np.mean([take[0] for take in at_nut])) if at_nut else self.open_frequency
        measured = [take[2] * (frequency / take[0]) ** 2 for take in self.calibration if len(take) > 2]
        mean = max(float(np.median(measured)), 1.0e-5) if measured else 5.0e-5
        return frequency, (mean, 0.05 * mean if measured else 2.0e-4)


class FarState(NamedTuple):
    """State of the far form after a window.

    `start` is the first frame of the last usable window, -1 before any; `strongest` is its best series, which
    may be outside the string's range.
    """

    start: Samples = -1
    notes: Notes = NO_NOTES
    steadiness: Steadiness = Steadiness()
    strongest: Series | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FarReader:
    """A prepared far-segment form, from a state and a window to the next state and the estimates.

    `setup` is what pressing does on this instrument; length and open frequency are those of its string.
    """

    finder: PitchFinder
    setup: Setup
    length: Metres
    open_frequency: Hertz

    def step(self, state: FarState, window: Window) -> tuple[FarState, Estimates]:
        """Return the state and the estimates after a window; one no later than the last begins a stream."""
        reason = unusable_reason(window)
        if window.start <= state.start:
            state = FarState()
        if reason:
            return state._replace(strongest=None), abstain(reason)
        rate = self.finder.sample_rate
        elapsed = (window.start - state.start) / rate if state.start >= 0 else np.inf
        rows = self.finder.rows(window.samples.astype(np.float64), state.notes.guesses)
        notes = follow(state.notes, rows, elapsed, self.finder.size / rate)
        inside = self._is_inside(notes)
        log_frequency = np.log(rows[:, FREQUENCY])
        note = _nearest(log_frequency, notes.log_frequency[inside])
        steadiness = compare(state.steadiness, note, log_frequency, rows[:, EVIDENCE], elapsed)
        strongest = Series(*rows[0].tolist()) if rows.size else None
        state = FarState(window.start, notes, steadiness, strongest)
        return state, self._estimates(notes, inside, steadiness)

    def is_inside(self, frequency: Hertz) -> bool:
        """Return whether a note is in the string's range."""
        lowest, highest = self._range
        return lowest <= frequency <= highest

    @property
    def _range(self) -> tuple[Hertz, Hertz]:
        edge = 2.0 ** (EDGE_CENTS / 1200.0)
        return self.finder.lowest / edge, self.finder.highest * edge

    def _is_inside(self, notes: Notes) -> Flags:
        lowest, highest = self._range
        return (notes.log_frequency >= np.log(lowest)) & (notes.log_frequency <= np.log(highest))

    def _estimates(self, notes: Notes, inside: Flags, steadiness: Steadiness) -> Estimates:
        """Return the estimates, or abstentions where no position is probable enough."""
        probability = np.exp(notes.weight) * np.where(inside, 1.0, OUTSIDE)
        probability /= probability.sum() + np.exp(notes.none)
        ratio = self.open_frequency / np.exp(notes.log_frequency)
        if not inside.any():
            return abstain(self._reason(notes, inside))
        best = int(inside.argmax())
        near = inside & (np.abs(ratio - ratio[best]) < SAME_POSITION)
        share = float(probability[near].sum())
        if share * steadiness.probability < LEAST_PROBABILITY:
            moves = steadiness.probability < min(share, LEAST_PROBABILITY)
            return abstain(Reason.VOICE if moves else self._reason(notes, inside))
        spread = float(probability[near] @ (ratio[near] - ratio[best]) ** 2) / share
        return self._located(notes, best, spread)

    def _reason(self, notes: Notes, inside: Flags) -> str:
        """Return why no position is probable enough."""
        outside = ~inside
        if np.exp(notes.none) > 0.5 or not inside.size:
            return Reason.NO_STRUCTURE
        frequency = np.exp(notes.log_frequency)
        if OUTSIDE * np.exp(notes.weight[outside]).sum() > np.exp(notes.weight[inside]).sum():
            return Reason.OTHER_NOTE.with_detail(float(frequency[outside][0]), *self._range)
        best = int(inside.argmax())
        apart = (
            np.abs(self.open_frequency / frequency - self.open_frequency / frequency[best]) > SAME_POSITION
        )
        if not apart.any():
            return Reason.NO_STRUCTURE
        return Reason.TWO_NOTES.with_detail(float(frequency[best]), float(frequency[apart][0]))

    def _located(self, notes: Notes, best: int, spread: float) -> Estimates:
        frequency = float(np.exp(notes.log_frequency[best]))
        relative_std = float(np.sqrt(notes.variance[best]))
        ratio = self.open_frequency / frequency
        correction, correction_std = self.setup.correct(ratio)
        position = self.length * min(max(1.0 - ratio + correction, 0.0), 1.0)
        std = self.length * float(np.sqrt((ratio * relative_std) ** 2 + spread + correction_std**2))
        bend, bend_std = float(notes.bend[best]), float(notes.bend_std[best])
        return {
            "frequency": Estimate(value=frequency, std=relative_std * frequency, unit="Hz"),
            "position": Estimate(value=position, std=std, unit="m"),
            "inharmonicity": Estimate(value=bend, std=bend_std, unit=""),
        }


def _nearest(log_frequency: Floats, notes: Floats) -> int | None:
    """Return the index of a window's series that is the first of the notes, None if there is none."""
    if not log_frequency.size or not notes.size:
        return None
    distance = np.abs(log_frequency - notes[0])
    return int(distance.argmin()) if distance.min() < SAME_SERIES else None


class FollowedNote:
    """The far form on one stream of windows."""

    def __init__(self, reader: FarReader) -> None:
        self.reader = reader
        self._state = FarState()

    def __call__(self, window: Window) -> Estimates:
        """Return the estimates of a window."""
        self._state, estimates = self.reader.step(self._state, window)
        return estimates

    @property
    def strongest(self) -> Series | None:
        """The best series in the last window."""
        return self._state.strongest


def abstain(reason: str) -> Estimates:
    """Return an abstention from each of the far-segment form's estimates."""
    units = {"frequency": "Hz", "position": "m", "inharmonicity": ""}
    return {name: Estimate.abstain(unit, reason) for name, unit in units.items()}
