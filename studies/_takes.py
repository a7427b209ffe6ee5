"""Real recordings of instruments with known string and fret: a fret is a contact at a known position.

Takes with a known fret are cut into windows, and the position errors of the closed-form estimator and of
plain autocorrelation are measured on them, clean or with recorded music or speech mixed in.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Literal, TypeAlias

import numpy as np

from monochord.core.errors import InputError
from monochord.core.types import Audio, Estimate, Floats, Signal, Window
from monochord.core.units import Hertz, Metres, Samples, Seconds
from monochord.evaluation import RATE, REMEDY, SCALE, RealTake, takes
from monochord.perception.estimators import ESTIMATORS

POSITION_TOLERANCE: Metres = 5.0e-3
"""Largest error of an estimate that counts as right."""
SPAN_LIMITS: tuple[Seconds, Seconds] = (0.01, 60.0)
"""Allowed lengths and hops of windows."""
KnownTouches: TypeAlias = tuple[tuple[float, ...], ...]
"""Known touches in the closed-form estimator's form; the open note comes first."""
Mix: TypeAlias = Callable[[Audio], Audio]
"""Changes the samples (channels, n) of a take, as by adding interference."""
Reference: TypeAlias = Literal["window", "take"]


def onset(samples: Audio) -> Samples:
    """Return the first frame at which the first channel reaches a tenth of its peak.

    >>> onset(np.array([[0.0, 0.01, -0.5, 1.0]], np.float32))
    2
    """
    level = np.abs(samples[0])
    return int(np.argmax(level >= 0.1 * level.max()))


@dataclass(frozen=True, slots=True, kw_only=True)
class Protocol:
    """Which windows of a take are evaluated: from `first` to `last` after the onset, every `hop`, in s."""

    length: Seconds = 0.1
    first: Seconds = 0.15
    last: Seconds = 1.05
    hop: Seconds = 0.1

    def __post_init__(self) -> None:
        shortest, longest = SPAN_LIMITS
        for name, span in (("window", self.length), ("hop", self.hop)):
            if not shortest <= span <= longest:
                raise InputError(f"{name} {span:g} s", f"{shortest:g} to {longest:g} s")
        if not 0.0 <= self.first <= self.last - self.length <= longest:
            given = f"windows of {self.length:g} s from {self.first:g} s to {self.last:g} s"
            allowed = f"a first of 0 s or more, and a last one window or more after it, up to {longest:g} s"
            raise InputError(given, allowed)

    def windows(self, take: Audio, samples: Audio, rate: int) -> list[Window]:
        """Return the windows of `samples` that lie wholly in it, counted from the onset of `take`."""
        begin, size = onset(take), round(self.length * rate)
        seconds = np.arange(self.first, self.last - self.length + 1e-9, self.hop)
        starts = [begin + round(after * rate) for after in seconds.tolist()]
        return [
            Window(samples=samples[:, start : start + size].copy(), start=start, sample_rate=rate)
            for start in starts
            if start + size <= samples.shape[1]
        ]


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedStrings:
    """The strings with a recorded open note: by name, the open take and the fretted takes."""

    open_notes: dict[str, RealTake]
    fretted: dict[str, list[RealTake]]


@cache
def recorded_strings() -> RecordedStrings:
    """Return all plucked takes with known fret on strings whose open note was recorded.

    Raises
    ------
    InputError
        If there are no real recordings on this machine.
    """
    labelled = takes(kind="plucked", labelled=True)
    if not labelled:
        raise InputError("no real recordings", "a folder with manifest.csv", REMEDY)
    opens = {take.string_name: take for take in labelled if take.position == 0.0}
    fretted: dict[str, list[RealTake]] = {string: [] for string in opens}
    for take in labelled:
        if take.position > 0.0 and take.string_name in opens:
            fretted[take.string_name].append(take)
    return RecordedStrings(open_notes=opens, fretted=fretted)


def calibrated_strings(protocol: Protocol) -> Iterator[tuple[str, KnownTouches, list[RealTake]]]:
    """Yield each recorded string: its name, the calibration from its open note, and its fretted takes."""
    strings = recorded_strings()
    for name, take in strings.open_notes.items():
        yield name, open_note(take, protocol), strings.fretted[name]


def open_note(take: RealTake, protocol: Protocol) -> KnownTouches:
    """Return an open take as calibration: the median frequency and inharmonicity of its windows.

    Computed from the audio alone: ``((frequency in Hz, 0.0, inharmonicity),)``.

    Raises
    ------
    InputError
        If no window has a frequency, as where all begin after the note has decayed.
    """
    readings = [
        (estimates["frequency"].value, estimates["inharmonicity"].value)
        for estimates in located(take, ((take.frequency, 0.0),), protocol)
        if estimates["frequency"].valid
    ]
    if not readings:
        given = f"take {take.path.name} from {protocol.first:g} s to {protocol.last:g} s"
        raise InputError(given, "a stretch with a clear note in it", "begin earlier after the onset")
    frequency, stiffness = np.median(np.array(readings), axis=0).tolist()
    return ((frequency, 0.0, stiffness),)


def located(
    take: RealTake, calibration: KnownTouches, protocol: Protocol, mix: Mix | None = None
) -> list[Mapping[str, Estimate]]:
    """Return the estimates of the closed-form estimator for every window of a take.

    Parameters
    ----------
    take
        A take of known string.
    calibration
        Of that string; begins with its open note.
    protocol
        Which windows.
    mix
        Applied to the samples of the take first, as to add interference.
    """
    samples, rate = take.read()
    mixed = samples if mix is None else mix(samples)
    options = {"length": SCALE, "open_frequency": calibration[0][0], "calibration": calibration}
    estimator = ESTIMATORS.build("closed_form", options)
    signal = Signal(sample_rate=rate, channels=mixed.shape[0])
    estimate = estimator.prepare(signal, round(protocol.length * rate))
    return [estimate(window) for window in protocol.windows(samples, mixed, rate)]


def position_errors(take: RealTake, estimates: list[Mapping[str, Estimate]]) -> Floats:
    """Return estimate minus fret position in m for every window (n,), NaN where the estimator abstained."""
    return np.array([window["position"].value for window in estimates]) - take.position


def autocorrelation_errors(
    take: RealTake, open_frequency: Hertz, protocol: Protocol, mix: Mix | None = None
) -> Floats:
    """Return the position errors in m of plain autocorrelation on a take's windows (n,); it never abstains.

    This is the baseline for estimators of pitch. The period is the lag of the first peak that reaches nine
    tenths of the largest, refined by a parabola.
    """
    samples, rate = take.read()
    mixed = samples if mix is None else mix(samples)
    shortest, longest = rate / (5.0 * open_frequency), rate / (0.977 * open_frequency)
    periods = [period(window, shortest, longest) for window in protocol.windows(samples, mixed, rate)]
    return np.array([SCALE * (1.0 - open_frequency * p / rate) - take.position for p in periods])


def period(window: Window, shortest: float, longest: float) -> float:
    """Return the period in frames of a window's first channel, between two bounds in frames."""
    samples = window.samples[0].astype(np.float64)
    size = samples.size
    power = np.abs(np.fft.rfft(samples - samples.mean(), 4 * size)) ** 2
    curve = np.fft.irfft(power)[:size] / (size - np.arange(size))
    lags = np.arange(int(shortest), min(int(longest) + 2, size - 2))
    peaks = lags[(curve[lags] > curve[lags - 1]) & (curve[lags] >= curve[lags + 1])]
    if peaks.size == 0:
        lag = int(lags[np.argmax(curve[lags])])
        return float(lag)
    lag = int(peaks[np.argmax(curve[peaks] >= 0.9 * curve[peaks].max())])
    before, at, after = curve[lag - 1 : lag + 2]
    return lag + 0.5 * (before - after) / (before - 2.0 * at + after)


@dataclass(frozen=True, slots=True, kw_only=True)
class Interferer:
    """A recording that is added to takes.

    Parameters
    ----------
    sound
        The recording (n,) at `RATE`.
    ratio
        Signal-to-noise ratio in dB.
    per
        What the ratio refers to: every "window" by itself, or the whole "take" from its onset, so that the
        later windows of a plucked string, which have decayed, have a lower ratio.
    """

    sound: Audio
    ratio: float
    per: Reference = "window"

    def mixer(self, offset: float, protocol: Protocol) -> Mix:
        """Return a function that adds the stretch of the recording that begins at a share `offset` of it."""

        def mix(samples: Audio) -> Audio:
            frames = samples.shape[1]
            begin = int(offset * max(self.sound.size - frames, 0))
            noise = np.resize(self.sound[begin:], frames).astype(np.float64)[np.newaxis]
            signal = samples.astype(np.float64)
            if self.per == "take":
                after = onset(samples)
                levels = [np.sqrt(np.mean(x[:, after:] ** 2, axis=1)) for x in (signal, noise)]
                gain = (levels[0] / levels[1])[:, np.newaxis]
            else:
                gain = _level(signal, protocol) / (_level(noise, protocol) + 1e-9)
            return (signal + 10.0 ** (-self.ratio / 20.0) * gain * noise).astype(np.float32)

        return mix


def _level(samples: Floats, protocol: Protocol) -> Floats:
    """Return the root mean square over the window around every frame."""
    size = round(protocol.length * RATE)
    power = np.cumsum(np.pad(samples**2, ((0, 0), (size // 2 + 1, size - size // 2 - 1)), "edge"), axis=1)
    return np.sqrt(np.maximum(power[:, size:] - power[:, :-size], 0.0) / size)


def errors_under(interferer: Interferer, protocol: Protocol, seed: int) -> tuple[Floats, Floats]:
    """Return the position errors in m on all fretted takes, of the closed form and of autocorrelation.

    The open notes that calibrate both are clean; the closed form's errors are NaN where it abstained. `seed`
    determines where in the recording each take's interference begins.
    """
    rng = np.random.default_rng(seed)
    closed_form: list[Floats] = []
    plain: list[Floats] = []
    for _, calibration, fretted in calibrated_strings(protocol):
        for take in fretted:
            mix = interferer.mixer(float(rng.uniform()), protocol)
            closed_form.append(position_errors(take, located(take, calibration, protocol, mix)))
            plain.append(autocorrelation_errors(take, calibration[0][0], protocol, mix))
    return np.concatenate(closed_form), np.concatenate(plain)
