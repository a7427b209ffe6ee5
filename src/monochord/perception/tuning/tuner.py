"""The tuner: a fold over windows of untouched sound that measures the string's tuning."""

from dataclasses import dataclass, replace
from functools import cached_property
from math import gcd, hypot, inf, nan

import numpy as np

from monochord.core.errors import InputError
from monochord.core.reasons import Reason
from monochord.core.shapes import sound
from monochord.core.types import Estimate, Floats, Signal, StringParams, Window
from monochord.core.units import Hertz, Newtons, Samples, Seconds
from monochord.perception.spectrum import HIGHEST_LINE, LOWEST_LINE, MIN_BINS, Spectrum, spectrum_of
from monochord.perception.tuning.evidence import reason_against_a_string
from monochord.perception.tuning.lines import (
    FREQUENCY,
    LAST_FREQUENCY,
    POWER_1,
    POWER_2,
    PRESENCE,
    lasting_lines,
    merged_lines,
)
from monochord.perception.tuning.reading import RANGE, SUSTAINED_DECADES, TuningReading, read_tuning
from monochord.perception.usable import unusable_reason
from monochord.physics.theory import inharmonicity, open_frequency

MIN_SHARE = 0.12
"""Smallest share of a partial's power at either microphone. Both ends of an untouched string are equally
loud, and the gains of the microphones may differ by 8 dB. The far microphone has 3 % (-15 dB) of a segment's
line."""
MAX_GAIN, SAME_GAIN = 20.0, 4.0
"""Largest difference of the microphones' gains in dB that all lines of a window may show alike, and how far
the lines of one string may be apart in it. A segment alone shows 15 dB, so that more than 8 dB takes partials
without a common divisor."""
DEAD_SHARE = 1.0e-3
"""Share of all lines' power below which a microphone is dead."""
MIN_SCORE, MIN_LEAD, MIN_EXPLAINED = 0.25, 0.1, 0.5
"""Smallest score of a reading, smallest lead over a rival, and smallest share of the lines explained."""
SPLIT_PITCH_TOLERANCE = 0.01
"""Relative distance within which two readings are one pitch whose partials strong drivers shift apart. Half
of the distance counts as an error."""
COMMON_STD = 1.5e-3
"""Relative standard deviation of errors common to all partials of a string, from compliant ends and drivers.

With it, the error on 20 plausible builds of the prototype, 1.9 per mille, equals one standard error. In the
ideal world the error is half a standard error."""
MIN_WINDOWS = 3
"""Fewest windows of untouched sound that determine the pitch."""
STIFFNESS_STD = (0.5, 2.0e-5)
"""Standard deviation of B around the design's value: a share of this value, plus a constant."""
TIME_TOLERANCE: Seconds = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """The tuning of a string, measured from untouched sound.

    Parameters
    ----------
    frequency, frequency_std
        Open frequency without stiffness, f0 = sqrt(T / mu) / (2 L), and its standard error, in Hz.
    inharmonicity, inharmonicity_std
        B in f_n = n f0 sqrt(1 + B n^2), and its standard error; the design's value if no high partial is
        detected.
    decay, decay_std
        Decay rate of the amplitude of free partials in 1/s, and its standard error; NaN without a free
        partial.
    partials
        Numbers of the detected partials, the loudest first.
    windows
        Number of windows measured.
    channels
        Microphones used, counted from 1.
    """

    frequency: Hertz
    frequency_std: Hertz
    inharmonicity: float
    inharmonicity_std: float
    decay: float = nan
    decay_std: float = nan
    partials: tuple[int, ...] = ()
    windows: int = 0
    channels: tuple[int, ...] = (1, 2)

    @property
    def open_frequency(self) -> Estimate:
        """The open frequency with its standard error."""
        return Estimate(value=self.frequency, std=self.frequency_std, unit="Hz")

    def deviation(self, string: StringParams) -> float:
        """Return the relative deviation of the open frequency from a string's."""
        return self.frequency / open_frequency(string) - 1.0

    def tension(self, string: StringParams) -> tuple[Newtons, Newtons]:
        """Return the tension T = mu (2 L f0)^2 of a string at this pitch, and its standard error, in N."""
        tension = string.linear_density * (2.0 * string.length * self.frequency) ** 2
        return tension, 2.0 * tension * self.frequency_std / self.frequency

    def tuned(self, string: StringParams) -> StringParams:
        """Return the string with the tension that gives it this pitch."""
        return replace(string, tension=self.tension(string)[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class TunerState:
    """The state of a tuner on one stream of windows, passed in and out; initially ``TunerState()``.

    `start` is the first frame of the last window. `analysed` is the start time of the last analysed window,
    in s. `lines` holds the lines of each accepted window, the newest last, and `gain` how much louder
    microphone 1 was, in dB, before they were levelled; 0 up to 8 dB. `refused` is why the last analysed
    window was refused; empty if it was accepted. `refusals` counts the refused windows. `tuning` is the
    tuning from the lines; None, with a `reason`, if they determine none.
    """

    start: Samples = -1
    analysed: Seconds = -inf
    lines: tuple[Floats, ...] = ()
    gain: float = 0.0
    refused: str = Reason.NONE
    refusals: int = 0
    tuning: Tuning | None = None
    reason: str = Reason.NO_WINDOW


@dataclass(frozen=True, kw_only=True)
class Tuner:
    """Follows the pitch of an untouched string, within 10 % (1.6 semitones) of the nominal pitch.

    A window is accepted if each of its lines appears at both microphones, as for an untouched string, or if
    all are louder at one by the same gain. Create a tuner with `Tuner.of`, which refuses unsuitable signals.

    Parameters
    ----------
    string
        The string's design.
    size
        Frames of a window.
    sample_rate
        In Hz.
    channels
        Number of microphones, 1 or 2. A single working microphone cannot distinguish a line of a touched
        string's segment from a partial of the untouched string. The tuner then requires partials without a
        common divisor.
    keep
        Number of accepted windows that determine the pitch; the newest are kept.
    every
        Smallest time between the starts of two such windows, in s.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> signal = Signal(sample_rate=44100, channels=2, string=load_string("prototype").string)
    >>> tuner, state = Tuner.of(signal, 4410), TunerState()
    >>> tone = 0.1 * np.sin(2.0 * np.pi * 2 * 960.0 * np.arange(22050) / 44100.0).astype(np.float32)
    >>> for start in range(0, 22050, 4410):
    ...     samples = np.stack((tone, tone))[:, start : start + 4410]
    ...     state = tuner.step(state, Window(samples=samples, start=start, sample_rate=44100))
    >>> round(state.tuning.frequency), state.tuning.partials
    (960, (2,))
    """

    string: StringParams
    size: Samples
    sample_rate: int
    channels: int = 2
    keep: int = 40
    every: Seconds = 0.1

    @classmethod
    def of(cls, signal: Signal, size: Samples) -> "Tuner":
        """Return the compiled tuner for a signal of a known string in windows of `size` frames.

        Raises
        ------
        InputError
            If the string is unknown, there are more than two channels, or the window is too short.
        """
        if signal.string is None or signal.channels > 2:
            known = "an unknown" if signal.string is None else "a known"
            given = f"{signal.channels} channel(s) of {known} string"
            raise InputError(given, "one or two channels of a known string", "name the string with --string")
        shortest = int(np.ceil(MIN_BINS * signal.sample_rate / open_frequency(signal.string)))
        if size < shortest:
            raise InputError(f"a window of {size} frames", f"{shortest} frames or more for this string")
        tuner = cls(string=signal.string, size=size, sample_rate=signal.sample_rate, channels=signal.channels)
        tone = 0.1 * np.sin(2.0 * np.pi * 2.0 * tuner.nominal / signal.sample_rate * np.arange(size))
        samples = np.tile(tone.astype(np.float32), (signal.channels, 1))
        state = TunerState()
        for number in range(MIN_WINDOWS):
            window = Window(samples=samples, start=number * size, sample_rate=signal.sample_rate)
            state = tuner.step(state, window)
        return tuner

    @cached_property
    def nominal(self) -> Hertz:
        """Open frequency of the string's design, in Hz."""
        return open_frequency(self.string)

    @cached_property
    def stiffness(self) -> tuple[float, float]:
        """The inharmonicity of the string's design, and its standard deviation."""
        bend = inharmonicity(self.string)
        return bend, STIFFNESS_STD[0] * bend + STIFFNESS_STD[1]

    def step(self, state: TunerState, window: Window, spectrum: Spectrum | None = None) -> TunerState:
        """Return the state after one more window, which may be touched, silent or have a gap.

        A window that starts no later than its predecessor begins another stream.

        Parameters
        ----------
        state
            The state before the window.
        window
            The window.
        spectrum
            The window's spectrum; None to compute it where it is needed.

        Raises
        ------
        InputError
            If the window has another number of channels or frames.
        """
        state = state if window.start > state.start else TunerState()
        time = window.start / window.sample_rate
        if time - state.analysed < self.every - TIME_TOLERANCE:
            return replace(state, start=window.start)
        state = replace(state, start=window.start, analysed=time)
        refused, dead = unusable_reason(window), 0
        if refused in (Reason.NONE, Reason.CLIPPED):
            spacing = self.sample_rate / self.size
            if spectrum is None:
                samples = sound(window.samples, self.channels, self.size)
                spectrum = spectrum_of(samples, spacing, LOWEST_LINE * self.nominal, HIGHEST_LINE)
            lines, gain = _levelled(merged_lines(spectrum, spacing))
            refused, dead = _no_partials_reason(lines)
            same = abs(gain - state.gain) < SAME_GAIN
            if not refused and not same and state.tuning:
                refused = Reason.TOUCHED.with_detail(f"{lines[0, FREQUENCY]:.0f} Hz")
            if not refused:
                kept = (*(state.lines if same else ()), lines)[-self.keep :]
                tuning, reason = self._tuning(kept, dead, even=not gain)
                return replace(
                    state, lines=kept, gain=gain, refused=Reason.NONE, tuning=tuning, reason=reason
                )
        reason = state.reason if state.lines else refused
        return replace(state, refused=refused, refusals=state.refusals + 1, reason=reason)

    def reason_against(self, state: TunerState) -> str:
        """Return why the sound behind a state's tuning may not come from a string; empty if it does.

        `step` does not check this: a live estimator has 0.3 s to measure a string that is known to be there
        and may sound a single partial. Check it before saving a sensor's pitch.
        """
        if state.tuning is None:
            return state.reason
        return reason_against_a_string(
            lasting_lines(state.lines, self.sample_rate / self.size),
            state.tuning.frequency,
            state.tuning.inharmonicity,
            sample_rate=self.sample_rate,
            windows=len(state.lines),
            least_share=MIN_SHARE if len(state.tuning.channels) > 1 else 0.0,
        )

    def _tuning(self, windows: tuple[Floats, ...], dead: int, *, even: bool) -> tuple[Tuning | None, str]:
        if len(windows) < MIN_WINDOWS:
            return None, Reason.FEW_WINDOWS.with_detail(MIN_WINDOWS)
        lasting = lasting_lines(windows, self.sample_rate / self.size)
        least = 0.0 if dead or self.channels == 1 else MIN_SHARE
        reading = read_tuning(lasting, self.nominal, self.stiffness, least)
        reason = self._undecided_reason(reading, lasting)
        numbers = [int(number) for number in dict.fromkeys(reading.numbers.tolist()) if number > 0.0]
        reason = reason or _ambiguous_reason(numbers, one_microphone=least == 0.0 or not even)
        if reason:
            return None, reason
        apart = 0.5 * abs(reading.frequency - reading.rival_frequency) if _has_rival(reading) else 0.0
        tuning = Tuning(
            frequency=reading.frequency,
            frequency_std=hypot(reading.frequency_std, COMMON_STD * reading.frequency, apart),
            inharmonicity=reading.inharmonicity,
            inharmonicity_std=reading.inharmonicity_std,
            # One object stands for no decay, so that equal tunings are equal.
            decay=reading.decay if reading.decay > 0.0 else nan,
            decay_std=reading.decay_std if reading.decay > 0.0 else nan,
            partials=tuple(numbers),
            windows=len(windows),
            channels=tuple(channel for channel in range(1, self.channels + 1) if channel != dead),
        )
        return tuning, Reason.NONE

    def _undecided_reason(self, reading: TuningReading, lasting: Floats) -> str:
        if not len(lasting) or lasting[:, PRESENCE].max() < 0.5:
            return Reason.NO_LASTING_LINE
        reach = 100.0 * RANGE, self.nominal
        if not reading.frequency:
            return Reason.NO_PARTIAL.with_detail(float(lasting[0, LAST_FREQUENCY]), *reach)
        if reading.humming:
            return Reason.HUM_ALONE
        if reading.score < MIN_SCORE or reading.explained < MIN_EXPLAINED:
            return Reason.UNLIKE_PARTIALS.with_detail(*reach)
        if _has_rival(reading) and not _is_near(reading):
            return Reason.TWO_READINGS.with_detail(reading.frequency, reading.rival_frequency)
        return Reason.NONE


def _has_rival(reading: TuningReading) -> bool:
    """Return whether another reading explains the lines about as well."""
    return reading.score - reading.rival_score < MIN_LEAD


def _is_near(reading: TuningReading) -> bool:
    """Return whether that is one of nearly the same pitch."""
    return abs(reading.rival_frequency / reading.frequency - 1.0) < SPLIT_PITCH_TOLERANCE


def _levelled(lines: Floats) -> tuple[Floats, float]:
    """Return lines as of microphones of equal gain, and how much louder microphone 1 was in dB.

    Unchanged, with 0 dB, are lines that both hear, or that do not show one and the same difference.
    """
    power = lines[:, POWER_1] + lines[:, POWER_2]
    both = lines[power > power.max(initial=0.0) * 10.0**-SUSTAINED_DECADES][:, [POWER_1, POWER_2]]
    if not len(both) or not both.all():
        return lines, 0.0
    balance = 10.0 * np.log10(both[:, 0] / both[:, 1])
    gain = float(np.median(balance))
    even = (both >= MIN_SHARE * both.sum(axis=1, keepdims=True)).all()
    if even or abs(gain) > MAX_GAIN or np.abs(balance - gain).max() > SAME_GAIN:
        return lines, 0.0
    levelled = lines.copy()
    levelled[:, POWER_2] *= 10.0 ** (0.1 * gain)
    return levelled, gain


def _no_partials_reason(lines: Floats) -> tuple[str, int]:
    """Return why lines do not fit an untouched string (empty if they do), and the dead microphone or 0."""
    if not len(lines):
        return Reason.NO_LINE, 0
    rows: list[list[float]] = lines.tolist()
    both = [sum(row[power] for row in rows) for power in (POWER_1, POWER_2)]
    if min(both) < DEAD_SHARE * sum(both):
        return Reason.NONE, both.index(min(both)) + 1
    quiet = max(row[POWER_1] + row[POWER_2] for row in rows) * 10.0**-SUSTAINED_DECADES
    one_sided = [
        row[FREQUENCY]
        for row in rows
        if row[POWER_1] + row[POWER_2] > quiet
        and min(row[POWER_1], row[POWER_2]) < MIN_SHARE * (row[POWER_1] + row[POWER_2])
    ]
    if not one_sided:
        return Reason.NONE, 0
    return Reason.TOUCHED.with_detail(" and one at ".join(f"{each:.0f} Hz" for each in one_sided[:2])), 0


def _ambiguous_reason(numbers: list[int], *, one_microphone: bool) -> str:
    """Return why partials of these numbers may come from something shorter than the string.

    Partials with a common divisor are a series of their own, as of a segment, or of another string of a
    multiple of the pitch. A single one is taken for a partial if both microphones pick it up.
    """
    if gcd(*numbers) == 1:
        return Reason.NONE
    if len(numbers) > 1:
        return Reason.MULTIPLE_PITCH.with_detail(", ".join(map(str, sorted(numbers))), gcd(*numbers))
    if one_microphone:
        return Reason.ONE_SIDED_PARTIAL.with_detail(numbers[0])
    return Reason.NONE


def detuned(deviation: float, expected: str) -> str:
    """Return the reason for abstaining on a string whose pitch deviates by a share from the expected one.

    >>> detuned(-0.0412, "its known pitch")
    'the string sounds 4.1 % below its known pitch: run monochord tune'
    """
    side = "below" if deviation < 0.0 else "above"
    return Reason.DETUNED.with_detail(100.0 * abs(deviation), side, expected)
