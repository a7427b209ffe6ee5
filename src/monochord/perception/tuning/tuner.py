"""The tuner: a fold over windows of untouched sound, and what it says of the string."""

from dataclasses import dataclass, replace
from math import gcd, hypot, inf, nan

import numpy as np

from monochord.core.errors import InputError
from monochord.core.shapes import sound
from monochord.core.types import Estimate, Floats, Signal, StringParams, Window
from monochord.core.units import Hertz, Newtons, Samples, Seconds
from monochord.perception.closed_form.spectrum import LOWEST_LINE, MIN_BINS
from monochord.perception.closed_form.usable import unusable_reason
from monochord.perception.tuning.evidence import reason_against_a_string
from monochord.perception.tuning.lines import (
    FREQUENCY,
    GROWTH_STD,
    LAST_FREQUENCY,
    LAST_GROWTH,
    LAST_POWER_1,
    LAST_POWER_2,
    POWER_1,
    POWER_2,
    PRESENCE,
    lasting_lines,
    window_lines,
)
from monochord.perception.tuning.reading import RANGE, SUSTAINED_DECADES, TuningReading, read_tuning
from monochord.physics.theory import inharmonicity, open_frequency

MIN_SHARE = 0.12
"""Least share of a partial's power at either microphone: both ends of an untouched string are equally loud,
and the gains of the microphones may differ by 8 dB. Of a segment's line the far one has 3 % (-15 dB)."""
DEAD_SHARE = 1.0e-3
"""Share of all lines' power below which a microphone is dead."""
MIN_SCORE, MIN_LEAD, MIN_EXPLAINED = 0.25, 0.1, 0.5
"""Least score of a reading, least lead over another, and least share of the lines that it explains."""
SPLIT_PITCH_TOLERANCE = 0.01
"""Share within which two readings are of one pitch whose partials are pulled apart, as strong drivers do:
half of their distance counts as an error."""
COMMON_STD = 1.5e-3
"""Standard deviation, as a share, of what all partials of a string have in common: yielding ends and drivers.

With it the errors on 20 plausible builds of the prototype, 1.9 per mille, are one standard error; in the
ideal world they are half of one."""
MIN_DECAY = 2.0
"""Least rate in 1/s at which a partial dies away that no driver sustains."""
MIN_WINDOWS = 3
"""Fewest windows of untouched sound that tell the pitch."""
STIFFNESS_STD = (0.5, 2.0e-5)
"""Standard deviation of B about the design's: this share of it, and that much more."""
TIME_TOLERANCE: Seconds = 1e-6
NOT_DRIVEN = "nothing drives the string"
"""How a reason ends where there is sound, and no line in it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuning:
    """What untouched sound says of a string.

    Parameters
    ----------
    frequency, frequency_std
        Open frequency without stiffness, f0 = sqrt(T / mu) / (2 L), and its standard error, in Hz.
    inharmonicity, inharmonicity_std
        B of f_n = n f0 sqrt(1 + B n^2); where no high partial is detected, that of the design.
    decay, decay_std
        Rate in 1/s at which the amplitude of its free partials falls, NaN where none is measured.
    partials
        Numbers of the partials that were detected, the loudest first.
    windows
        How many windows it was taken from.
    channels
        The microphones that it was taken from, from 1 on.
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
        """Return the share by which the open frequency lies above a string's own."""
        return self.frequency / open_frequency(string) - 1.0

    def tension(self, string: StringParams) -> tuple[Newtons, Newtons]:
        """Return the tension T = mu (2 L f0)^2 of a string of this length and density, and its std."""
        tension = string.linear_density * (2.0 * string.length * self.frequency) ** 2
        return tension, 2.0 * tension * self.frequency_std / self.frequency

    def tuned(self, string: StringParams) -> StringParams:
        """Return a string with the tension that brings it to this pitch; all else stays."""
        return replace(string, tension=self.tension(string)[0])


@dataclass(frozen=True, slots=True, kw_only=True)
class TunerState:
    """The state of a tuner on one stream of windows, passed in and out; it begins as ``TunerState()``.

    `start` is the first frame of the last window, and `looked` the time of the last one that was looked at.
    `lines` are those of the windows that count, the newest last. `refused` is why the last window that was
    looked at did not count, empty if it did, and `refusals` how many did not. `tuning` is what the lines say;
    where they say nothing it is None, for the reason `reason`.
    """

    start: Samples = -1
    looked: Seconds = -inf
    lines: tuple[Floats, ...] = ()
    refused: str = ""
    refusals: int = 0
    tuning: Tuning | None = None
    reason: str = "no sound"


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuner:
    """Follows the pitch of an untouched string, within 10 % (1.6 semitones) of the nominal one.

    A window counts where its lines are those of an untouched string: each at both microphones. `Tuner.of`
    makes it and refuses unsuitable signals.

    Parameters
    ----------
    string
        The string as designed.
    size
        Frames of a window.
    sample_rate
        In Hz.
    channels
        Microphones, 1 or 2. With one, or where the other is dead, a line of a touched string's segment is
        like a partial of the untouched one, so that partials without a common divisor have to be detected.
    keep
        How many windows the pitch is taken from, the newest.
    every
        Least distance of their starts in s.

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
        """Return the tuner for windows of `size` frames of a signal of a known string, compiled.

        Raises
        ------
        InputError
            If the string is not known, there are more than two channels, or the window is too short.
        """
        if signal.string is None or signal.channels > 2:
            known = "an unknown" if signal.string is None else "a known"
            given = f"{signal.channels} channel(s) of {known} string"
            raise InputError(given, "one or two channels of a known string", "name it with --string")
        shortest = int(np.ceil(MIN_BINS * signal.sample_rate / open_frequency(signal.string)))
        if size < shortest:
            raise InputError(f"a window of {size} frames", f"from {shortest} frames on for this string")
        tuner = cls(string=signal.string, size=size, sample_rate=signal.sample_rate, channels=signal.channels)
        tone = 0.1 * np.sin(2.0 * np.pi * 2.0 * tuner.nominal / signal.sample_rate * np.arange(size))
        samples = np.tile(tone.astype(np.float32), (signal.channels, 1))
        state = TunerState()
        for number in range(MIN_WINDOWS):
            window = Window(samples=samples, start=number * size, sample_rate=signal.sample_rate)
            state = tuner.step(state, window)
        return tuner

    @property
    def nominal(self) -> Hertz:
        """Open frequency of the string as designed."""
        return open_frequency(self.string)

    def step(self, state: TunerState, window: Window) -> TunerState:
        """Return the state after one more window, which may be touched, silent or torn.

        A window that does not begin after the one before it is the first of another stream. Raises
        `InputError` for a window of other channels or another length.
        """
        state = state if window.start > state.start else TunerState()
        time = window.start / window.sample_rate
        if time - state.looked < self.every - TIME_TOLERANCE:
            return replace(state, start=window.start)
        state = replace(state, start=window.start, looked=time)
        refused, dead = unusable_reason(window), 0
        if refused in ("", "clipped"):
            lowest = LOWEST_LINE * self.nominal
            samples = sound(window.samples, self.channels, self.size)
            lines = window_lines(samples, lowest, self.sample_rate)
            refused, dead = _no_partials_reason(lines)
            if not refused:
                kept = (*state.lines, lines)[-self.keep :]
                tuning, reason = self._tuning(kept, dead)
                return replace(state, lines=kept, refused="", tuning=tuning, reason=reason)
        reason = state.reason if state.lines else refused
        return replace(state, refused=refused, refusals=state.refusals + 1, reason=reason)

    def reason_against(self, state: TunerState) -> str:
        """Return why what a state has of a tuning may be a tone and no string; empty where it is one.

        `step` does not ask: a running estimator has 0.3 s to find the pitch of a string that it knows to be
        there, and that may sound a single partial. Who writes a sensor's pitch down asks.
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

    def _tuning(self, windows: tuple[Floats, ...], dead: int) -> tuple[Tuning | None, str]:
        if len(windows) < MIN_WINDOWS:
            return None, f"less than {MIN_WINDOWS} windows of untouched sound"
        lasting = lasting_lines(windows, self.sample_rate / self.size)
        bend = inharmonicity(self.string)
        stiffness = (bend, STIFFNESS_STD[0] * bend + STIFFNESS_STD[1])
        least = 0.0 if dead or self.channels == 1 else MIN_SHARE
        reading = read_tuning(lasting, self.nominal, stiffness, least)
        reason = self._undecided_reason(reading, lasting)
        numbers = list(dict.fromkeys(reading.numbers[reading.numbers > 0.0].astype(int).tolist()))
        reason = reason or _ambiguous_reason(numbers, one_microphone=least == 0.0)
        if reason:
            return None, reason
        decay, decay_std = _decay(lasting, reading)
        apart = 0.5 * abs(reading.frequency - reading.rival_frequency) if _has_rival(reading) else 0.0
        tuning = Tuning(
            frequency=reading.frequency,
            frequency_std=hypot(reading.frequency_std, COMMON_STD * reading.frequency, apart),
            inharmonicity=reading.inharmonicity,
            inharmonicity_std=reading.inharmonicity_std,
            decay=decay,
            decay_std=decay_std,
            partials=tuple(numbers),
            windows=len(windows),
            channels=tuple(channel for channel in range(1, self.channels + 1) if channel != dead),
        )
        return tuning, ""

    def _undecided_reason(self, reading: TuningReading, lasting: Floats) -> str:
        if not len(lasting) or lasting[:, PRESENCE].max() < 0.5:
            return f"no line lasts: {NOT_DRIVEN}"
        reach = f"{100.0 * RANGE:.0f} % of {self.nominal:.1f} Hz"
        if not reading.frequency:
            strongest = lasting[0, LAST_FREQUENCY]
            return f"the strongest line, {strongest:.1f} Hz, is no partial of a string within {reach}"
        if reading.humming:
            return "hum alone"
        if reading.score < MIN_SCORE or reading.explained < MIN_EXPLAINED:
            return f"too many lines that are no partials of one string within {reach}"
        if _has_rival(reading) and not _is_near(reading):
            return f"two readings, {reading.frequency:.1f} and {reading.rival_frequency:.1f} Hz"
        return ""


def _has_rival(reading: TuningReading) -> bool:
    """Return whether another reading explains the lines about as well."""
    return reading.score - reading.rival_score < MIN_LEAD


def _is_near(reading: TuningReading) -> bool:
    """Return whether that is one of nearly the same pitch."""
    return abs(reading.rival_frequency / reading.frequency - 1.0) < SPLIT_PITCH_TOLERANCE


def _no_partials_reason(lines: Floats) -> tuple[str, int]:
    """Return why lines are not those of an untouched string, and which microphone is dead."""
    if not len(lines):
        return f"no line stands out: {NOT_DRIVEN}", 0
    power = lines[:, [POWER_1, POWER_2]]
    share = power.sum(axis=0) / power.sum()
    dead = int(np.argmin(share)) + 1 if share.min() < DEAD_SHARE else 0
    if dead:
        return "", dead
    loud = power.sum(axis=1) > power.sum(axis=1).max() * 10.0**-SUSTAINED_DECADES
    least = (power / power.sum(axis=1, keepdims=True))[loud].min(axis=1)
    if (least < MIN_SHARE).any():
        one, *others = lines[loud][least < MIN_SHARE][:, FREQUENCY]
        also = f" and one at {others[0]:.0f} Hz" if others else ""
        return f"touched: a line at {one:.0f} Hz{also} is at one microphone alone", 0
    return "", 0


def _ambiguous_reason(numbers: list[int], *, one_microphone: bool) -> str:
    """Return why partials of these numbers may be those of something shorter than the string.

    Partials with a common divisor are a series of their own, as of a segment, or of another string of a
    multiple of the pitch. A single one is taken for a partial if both microphones pick it up.
    """
    if gcd(*numbers) == 1:
        return ""
    if len(numbers) > 1:
        partials = ", ".join(map(str, sorted(numbers)))
        return f"partials {partials} alone are those of {gcd(*numbers)} times the pitch: another string"
    if one_microphone:
        return f"partial {numbers[0]} at one microphone: it may be that of a touched string's segment"
    return ""


def _decay(lasting: Floats, reading: TuningReading) -> tuple[float, float]:
    """Return the rate in 1/s at which free partials die away, and its standard error; NaN for none."""
    power = lasting[:, LAST_POWER_1] + lasting[:, LAST_POWER_2]
    growth, std = lasting[:, LAST_GROWTH], lasting[:, GROWTH_STD]
    free = (reading.numbers > 0.0) & (power < power.max(initial=0.0) * 10.0**-SUSTAINED_DECADES)
    free &= (growth < -MIN_DECAY) & (growth < -3.0 * std)
    if not free.any():
        return nan, nan
    weight = 1.0 / (std[free] ** 2 + (0.1 * growth[free]) ** 2)
    mean = float(-np.average(growth[free], weights=weight))
    spread = float(np.average((growth[free] + mean) ** 2, weights=weight)) / free.sum()
    return mean, float(np.hypot(weight.sum() ** -0.5, spread**0.5))
