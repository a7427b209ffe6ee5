"""Spectra of a window of two microphones: samples, transform, power, strongest lines, and their modes.

A line's frequency is precise however short the window. For a tone exp((m + i w0) t) and a taper h that is
zero at both ends, integration by parts gives X_h'(w) = -(m + i (w0 - w)) X_h(w), where X_h and X_h' are the
spectra under h and under its derivative. One bin of each gives frequency and growth of a lone tone exactly.
Of a Hann taper both follow from three bins of the plain transform R:
X_h[k] = R[k] / 2 - (R[k-1] + R[k+1]) / 4 and X_h'[k] = pi (R[k-1] - R[k+1]) / (2 i n).

Auger and Flandrin (1995), Improving the readability of time-frequency and time-scale representations by the
reassignment method, IEEE Trans. Signal Process. 43, 1068.
"""

from collections import OrderedDict
from dataclasses import dataclass, replace
from functools import lru_cache
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.kernels import kernel
from monochord.core.shapes import sound
from monochord.core.types import Audio, Floats, Signal, StringParams
from monochord.core.units import Hertz, Metres, Samples
from monochord.perception.closed_form import modes
from monochord.perception.closed_form.hypotheses import StringModel
from monochord.perception.closed_form.modes import ModeReading
from monochord.perception.closed_form.place_density import PlaceNetwork, place_network
from monochord.perception.closed_form.ranking import Ranking, mode_ranking
from monochord.physics.theory import open_frequency

MIN_BINS = 14
"""Fewest bins from 0 Hz to the open frequency; with fewer, lines overlap."""
LOWEST_LINE = 0.8
"""Lowest frequency of a line, as a share of the open frequency; below are rumble and hum."""
HIGHEST_LINE: Hertz = 20000.0
"""Highest frequency of a line."""
LINES = 8
"""Lines of each microphone, the strongest first."""
MAX_SAMPLE = 1.0e3
"""Largest sample in full scale; larger ones are clipped to it."""
REMEMBERED, KEY = 32, 16
"""Windows whose spectra are remembered, and their samples of each channel by which they are looked up."""


class Spectrum(NamedTuple):
    """One window of two microphones.

    `samples` (2, n) about their mean, `transform` (2, bins) without a taper, `power` (2, bins) under a Hann
    taper, frequencies and powers (2, `LINES`) of its strongest `peaks`, and `reading`, their modes.
    """

    samples: Floats
    transform: NDArray[np.complex128]
    power: Floats
    peaks: tuple[Floats, Floats]
    reading: ModeReading


_LAST: OrderedDict[tuple[StringModel, int, bytes], tuple[Audio, Spectrum]] = OrderedDict()
"""The last windows of all analysers, by string, sample rate and first samples, and their spectra."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SpectrumAnalyser:
    """Analyses windows of one size; `SpectrumAnalyser.of` makes it and refuses unsuitable signals.

    There is one of each kind. Its last windows are remembered: features, the reference and the watch over the
    tuning look at the same one in turn, those of several strings after each other.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> signal = Signal(sample_rate=44100, channels=2, string=load_string("prototype").string)
    >>> analyser = SpectrumAnalyser.of(signal, 4410)
    >>> time = np.arange(4410) / 44100.0
    >>> tones = np.stack([np.sin(2.0 * np.pi * f * time) for f in (2436.0, 1730.0)])
    >>> window = np.array([[0.8, 0.2], [0.2, 0.8]]) @ tones
    >>> reading = analyser.analyse(window.astype(np.float32)).reading
    >>> round(reading.position, 3), reading.mode_1, reading.mode_2
    (0.083, 1.0, 1.0)
    """

    string: StringParams
    sample_rate: int
    size: Samples
    model: StringModel

    @property
    def bin_spacing(self) -> Hertz:
        """Distance of two bins."""
        return self.sample_rate / self.size

    @property
    def length(self) -> Metres:
        """Length of the string."""
        return self.model.length

    @property
    def nominal(self) -> Hertz:
        """Nominal open frequency of the string."""
        return self.model.nominal

    @classmethod
    def of(cls, signal: Signal, size: Samples, *, rise: float = 0.0) -> "SpectrumAnalyser":
        """Return the analyser of windows of `size` frames, its kernels compiled.

        Parameters
        ----------
        signal
            Two channels of a known string.
        size
            Frames of a window.
        rise
            Share by which the expected forces raise the open frequency.

        Raises
        ------
        InputError
            If the signal has another form, the rate is too low, or the window too short.
        """
        string = signal.string
        if signal.channels != 2 or string is None:
            given = f"{signal.channels} channel(s) of {'an unknown' if string is None else 'a known'} string"
            raise InputError(given, "two channels of a known string", "name it with --string")
        nominal, rate = open_frequency(string), signal.sample_rate
        if rate < 8.0 * nominal:
            raise InputError(f"sample rate {rate:g} Hz", f"from {8.0 * nominal:.0f} Hz on for this string")
        shortest = int(np.ceil(MIN_BINS * rate / nominal))
        if size < shortest:
            raise InputError(f"a window of {size} frames", f"from {shortest} frames on for this string")
        return _analyser(string, rate, size, rise)

    def analyse(self, window: Audio) -> Spectrum:
        """Return the spectra of a window (2, size) and the modes read from them.

        Raises `InputError` for a window of another shape.
        """
        window = sound(window, 2, self.size)
        key = (self.model, self.sample_rate, window[:, :KEY].tobytes())
        last = _LAST.get(key)
        if last is not None and np.array_equal(last[0], window):
            return last[1]
        samples, transform, power, peaks = self.transformed(window)
        reading = modes.read_modes(*peaks, power, self.bin_spacing, self.model, _networks())
        spectrum = Spectrum(samples, transform, power, peaks, reading)
        _LAST.pop(key, None)
        _LAST[key] = window.copy(), spectrum
        while len(_LAST) > REMEMBERED:
            _LAST.popitem(last=False)
        return spectrum

    def transformed(
        self, window: Audio
    ) -> tuple[Floats, NDArray[np.complex128], Floats, tuple[Floats, Floats]]:
        """Return samples, transform, power and strongest lines of a window (2, size); see `Spectrum`."""
        window = sound(window, 2, self.size)
        return spectrum_of(window, self.bin_spacing, LOWEST_LINE * self.nominal, HIGHEST_LINE)

    def read_at_any_tuning(self, spectrum: Spectrum, slack: float) -> ModeReading:
        """Return the modes that the lines are if the string may be tuned off nominal by a share `slack`."""
        model = self.model._replace(slack=slack)
        return modes.read_modes(*spectrum.peaks, spectrum.power, self.bin_spacing, model, _networks())

    def tuned(self, string: StringParams) -> "SpectrumAnalyser":
        """Return the analyser of the same wire under another tension."""
        return replace(self, string=string, model=string_model(string, rise=self.model.rise))

    def partials(self, fundamental: Hertz, segment: Metres, count: int) -> Floats:
        """Return the first partials in Hz of a segment, given its length in m and flexible fundamental."""
        number = np.arange(1.0, count + 1.0)
        return number * fundamental * np.sqrt(1.0 + self.model.stiffness * (number / segment) ** 2)

    def per_mille(self, frequency: Hertz) -> float:
        """Return how far a frequency lies above the nominal open one, in thousandths; 0 for none."""
        return 1000.0 * (frequency / self.nominal - 1.0) if frequency > 0.0 else 0.0


def _networks() -> tuple[PlaceNetwork, Ranking]:
    return place_network(), mode_ranking()


@lru_cache(maxsize=64)
def _analyser(string: StringParams, sample_rate: int, size: Samples, rise: float) -> SpectrumAnalyser:
    """Return the one analyser of windows of such a string, compiled."""
    model = string_model(string, rise=rise)
    analyser = SpectrumAnalyser(string=string, sample_rate=sample_rate, size=size, model=model)
    # Two segments at 0.4 of the string, so that every kernel runs.
    turns = np.outer((2.5, 5.0 / 3.0), 2.0 * pi * model.nominal / sample_rate * np.arange(size))
    analyser.analyse((np.array([[0.8, 0.2], [0.2, 0.8]]) @ np.sin(turns)).astype(np.float32))
    return analyser


def string_model(string: StringParams, *, rise: float = 0.0) -> StringModel:
    """Return what the reader of modes knows of a string; `rise` as in `SpectrumAnalyser.of`."""
    bending = pi**3 * string.young_modulus * string.core_diameter**4 / 64.0
    return StringModel(string.length, open_frequency(string), bending / string.tension, rise)


def spectrum_of(
    window: Audio, spacing: Hertz, lowest: Hertz, highest: Hertz
) -> tuple[Floats, NDArray[np.complex128], Floats, tuple[Floats, Floats]]:
    """Return samples, transform, power and strongest lines of a window (channels, size); see `Spectrum`.

    Its bins are `spacing` apart, its lines between `lowest` and `highest`.
    """
    samples = centred_samples(sound(window).copy())
    transform = np.fft.rfft(samples)
    power = hann_power(transform, samples.shape[1])
    return samples, transform, power, strongest_lines(transform, power, spacing, lowest, highest)


@kernel(fastmath={"reassoc"})
def centred_samples(window: Audio) -> Floats:
    """Return the samples of each channel about their mean; those that are not numbers become zero."""
    samples = np.empty(window.shape)
    for c in range(window.shape[0]):
        total = 0.0
        for i in range(window.shape[1]):
            sample = window[c, i] if np.isfinite(window[c, i]) else 0.0
            samples[c, i] = min(max(sample, -MAX_SAMPLE), MAX_SAMPLE)
            total += samples[c, i]
        for i in range(window.shape[1]):
            samples[c, i] -= total / window.shape[1]
    return samples


@kernel()
def hann_power(transform: NDArray[np.complex128], size: Samples) -> Floats:
    """Return the power under a Hann taper (channels, bins); a sine of amplitude a has a^2 / 2 at its bin.

    `transform` (channels, bins) is without a taper, of `size` frames.
    """
    channels, bins = transform.shape
    power = np.zeros((channels, bins))
    for c in range(channels):
        for k in range(1, bins - 1):
            value = 0.5 * transform[c, k] - 0.25 * (transform[c, k - 1] + transform[c, k + 1])
            power[c, k] = 8.0 / size**2 * (value.real * value.real + value.imag * value.imag)
    return power


@kernel()
def strongest_lines(
    transform: NDArray[np.complex128], power: Floats, spacing: Hertz, lowest: Hertz, highest: Hertz
) -> tuple[Floats, Floats]:
    """Return the strongest lines of each channel, frequency in Hz and power, each (channels, `LINES`).

    `transform` and `power` are (channels, bins), their bins `spacing` apart. Lines lie between `lowest` and
    `highest`, the strongest first; missing ones are 0 in both.
    """
    channels, bins = power.shape
    frequency, height = np.zeros((channels, LINES)), np.zeros((channels, LINES))
    first, last = max(int(lowest / spacing), 3), min(int(highest / spacing), bins - 3)
    for c in range(channels):
        for k in range(first, last):
            peak = power[c, k]
            if peak <= height[c, LINES - 1] or power[c, k - 1] >= peak or peak < power[c, k + 1]:
                continue
            if power[c, k - 2] >= peak or peak < power[c, k + 2]:
                continue
            rank = LINES - 1
            while rank > 0 and height[c, rank - 1] < peak:
                height[c, rank] = height[c, rank - 1]
                frequency[c, rank] = frequency[c, rank - 1]
                rank -= 1
            value = 0.5 * transform[c, k] - 0.25 * (transform[c, k - 1] + transform[c, k + 1])
            shift = 0.25 * ((transform[c, k - 1] - transform[c, k + 1]) / value).real
            height[c, rank] = peak
            frequency[c, rank] = (k + min(max(shift, -1.0), 1.0)) * spacing
    return frequency, height
