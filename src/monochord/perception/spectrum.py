"""The spectrum of a window of two microphones: samples, transform, power and strongest lines."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.kernels import kernel
from monochord.core.shapes import sound
from monochord.core.types import Audio, Floats, Signal, StringParams
from monochord.core.units import Hertz, Samples
from monochord.dsp.hann import hann_power, strongest_lines
from monochord.physics.theory import inharmonicity, open_frequency

MIN_BINS = 14
"""Fewest bins from 0 Hz to the open frequency; with fewer, lines overlap."""
LOWEST_LINE = 0.8
"""Lowest frequency of a line, as a share of the open frequency; below are rumble and hum."""
HIGHEST_LINE: Hertz = 20000.0
"""Highest frequency of a line."""
MAX_SAMPLE = 1.0e3
"""Largest sample in full scale; larger ones are clipped to it."""


class Spectrum(NamedTuple):
    """The spectrum of one window.

    `samples` (channels, n) about their mean, `transform` (channels, bins) without a taper, `power` (channels,
    bins) under a Hann taper, and `frequency` in Hz and `height` (channels, `LINES`) of its strongest lines.
    """

    samples: Floats
    transform: NDArray[np.complex128]
    power: Floats
    frequency: Floats
    height: Floats


@dataclass(frozen=True, kw_only=True)
class SpectrumAnalyser:
    """Analyses windows of two microphones; `SpectrumAnalyser.of` makes it and refuses unsuitable signals.

    Parameters
    ----------
    string
        The string, whose pitch and stiffness say where partials lie.
    sample_rate
        In Hz.
    size
        Frames of a window.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> signal = Signal(sample_rate=44100, channels=2, string=load_string("prototype").string)
    >>> analyser = SpectrumAnalyser.of(signal, 4410)
    >>> time = np.arange(4410) / 44100.0
    >>> tones = np.stack([np.sin(2.0 * np.pi * f * time) for f in (2436.0, 1730.0)])
    >>> spectrum = analyser.analyse((np.array([[0.8, 0.2], [0.2, 0.8]]) @ tones).astype(np.float32))
    >>> spectrum.frequency[:, 0].round().tolist()
    [2436.0, 1730.0]
    """

    string: StringParams
    sample_rate: int
    size: Samples

    @property
    def bin_spacing(self) -> Hertz:
        """Distance of two bins."""
        return self.sample_rate / self.size

    @cached_property
    def nominal(self) -> Hertz:
        """Open frequency of the string."""
        return open_frequency(self.string)

    @cached_property
    def bending(self) -> float:
        """The string's inharmonicity B: partial n lies at n f0 sqrt(1 + B n^2)."""
        return inharmonicity(self.string)

    @classmethod
    def of(cls, signal: Signal, size: Samples) -> "SpectrumAnalyser":
        """Return the analyser of windows of `size` frames.

        Parameters
        ----------
        signal
            Two channels of a known string.
        size
            Frames of a window.

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
        return cls(string=string, sample_rate=rate, size=size)

    def analyse(self, window: Audio) -> Spectrum:
        """Return the spectrum of a window (2, size); raises `InputError` for another shape."""
        window = sound(window, 2, self.size)
        return spectrum_of(window, self.bin_spacing, LOWEST_LINE * self.nominal, HIGHEST_LINE)

    def relisted(self, spectrum: Spectrum) -> Spectrum:
        """Return a spectrum of the same window with the lines of this analyser's string."""
        lowest = LOWEST_LINE * self.nominal
        frequency, height = strongest_lines(
            spectrum.transform, spectrum.power, self.bin_spacing, lowest, HIGHEST_LINE
        )
        return spectrum._replace(frequency=frequency, height=height)


def spectrum_of(window: Audio, spacing: Hertz, lowest: Hertz, highest: Hertz) -> Spectrum:
    """Return the spectrum of a window (channels, size).

    Its bins are `spacing` apart, its lines between `lowest` and `highest`.
    """
    samples = centred_samples(sound(window))
    transform = np.fft.rfft(samples)
    power = hann_power(transform, samples.shape[1])
    frequency, height = strongest_lines(transform, power, spacing, lowest, highest)
    return Spectrum(samples, transform, power, frequency, height)


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
