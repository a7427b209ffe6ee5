"""How many microphones two channels are: two, one in both, or one beside an input that carries nothing.

Both microphones of a sensor hear all of the string, and each its own end louder: no multiple of one channel
is the other. A copy is one, whatever its gain and polarity, but for noise. An input with nothing plugged in
has noise, hum of the mains, and perhaps a trace of its neighbour. Two inputs of unlike rates have no line in
common, and those of one are the other's, moved by the ratio of the rates.
"""

from collections.abc import Iterable
from functools import cache, cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from monochord.core.clock import RATE_RATIOS
from monochord.core.inputs import MIN_LOOKS, Inputs, InputState
from monochord.core.kernels import kernel, part
from monochord.core.shapes import sound
from monochord.core.silence import SILENT_LEVEL
from monochord.core.types import Audio, Flags, Floats, Indices, Window
from monochord.core.units import Hertz, Seconds
from monochord.dsp.levels import MAINS

LOOK: Seconds = 0.1
"""Length of the sound of one look."""
LOWEST: Hertz = 40.0
HIGHEST: Hertz = 12_000.0
"""Range of the lines that are compared."""
NEIGHBOURHOOD: Hertz = 400.0
"""Width of the bands whose median power is the noise beside a line."""
CLEAR = 100.0
"""Power over the noise from which a line is certain. Of noise alone, the largest line of a look is at 30. In
simulated sensors, what a microphone has beside the other's multiple has lines at 200 or more."""
STRONG = 1e-4
"""Least power of a line, as a share of its channel's strongest."""
UNUSED_RATIO = 1e-3
"""Ratio of the channels' levels below which the quieter one carries nothing: 60 dB. The string reaches both
ends."""
TRACE = 0.03
"""Largest multiple of the other channel that an unplugged input picks up."""
LEAST_CROSSTALK = 1e-3
"""Least share of a line's power that the other microphone of a sensor hears."""
MAX_REST = 0.02
"""Largest share of a copy's power, in its lines, that no multiple of the other channel explains: noise."""
MIN_LINES = 2
"""Fewest lines of a copy: of one line, any two channels are multiples."""
SAME_LINE = 0.3
"""Largest distance of one line's places in both channels, in bins."""
QUARTER_TO_MEDIAN = 2.41
"""Ratio of an exponential distribution's median to its lower quartile."""
PRESENT = 20.0
"""Power over the noise from which a channel may hear a line of the other."""
APART = 0.05
"""Largest share of the lines' power that two channels have in common which share no sound."""
ALIKE, SAME_RATIO = 0.8, 4e-3
"""Least share of the lines' power that two rates move alike, and largest relative distance from that."""
HUM_TOP: Hertz = 400.0
HUM_WIDTH: Hertz = 1.0
HUM_DRIFT = 2e-3
"""Hum's strongest line is below `HUM_TOP`; each is a multiple of the mains within `HUM_WIDTH` and a share."""
MAJORITY = 0.75
"""Least share of the looks at a recording, of those that tell, that decide."""
ONLY = (Inputs.FIRST, Inputs.SECOND)
"""What is there where only this channel, counted from 0, has a microphone."""


def compare_inputs(samples: Audio, sample_rate: int) -> Inputs:
    """Return what two channels carry, from one look at them.

    The multiple of one channel that is nearest to the other is subtracted. A channel has sound of its own
    where clear lines are left, other than hum. Silence and noise tell nothing, and neither do samples that
    are not numbers.

    Parameters
    ----------
    samples
        Sound (2, n) in full scale, some 0.1 s.
    sample_rate
        In Hz.

    Examples
    --------
    >>> time = np.arange(4410) / 44100
    >>> one, two = (np.sin(2.0 * np.pi * f * time) for f in (1000.0, 1500.0))
    >>> compare_inputs(np.stack((one + two, -0.3 * (one + two))), 44100).name
    'SAME'
    >>> compare_inputs(np.stack((one + two, one - two)), 44100).name
    'TWO'
    >>> compare_inputs(np.stack((one + two, np.ones(4410))), 44100).name
    'FIRST'
    """
    both, levels = _centred(sound(samples, 2))
    louder = int(levels.argmax())
    if not np.isfinite(levels).all() or levels[louder] < SILENT_LEVEL:
        return Inputs.UNKNOWN
    spectrum, quieter = _Spectrum(both, sample_rate), levels[1 - louder]
    is_unused = quieter < UNUSED_RATIO * levels[louder] and not spectrum.is_hum[louder]
    if is_unused or (quieter < SILENT_LEVEL and spectrum.has_string[louder]):
        return ONLY[louder]
    return _compared(spectrum)


def _compared(spectrum: "_Spectrum") -> Inputs:
    """Return what two channels carry that may both be heard."""
    is_heard = [spectrum.has_own(channel) for channel in (0, 1)]
    if all(is_heard):
        if not (spectrum.is_deaf(0) and spectrum.is_deaf(1)):
            return Inputs.TWO
        return Inputs.APART if spectrum.has_two_rates() else Inputs.UNKNOWN
    for channel in (0, 1):
        quiet = 1 - channel
        if not spectrum.has_string[channel] or is_heard[quiet]:
            continue
        if spectrum.is_deaf(quiet) or (spectrum.explains(quiet) and spectrum.multiple(quiet) < TRACE):
            return ONLY[channel]
    is_same = not any(is_heard) and all(spectrum.is_copy(channel) for channel in (0, 1))
    return Inputs.SAME if is_same else Inputs.UNKNOWN


@cache
def compile_looks() -> None:
    """Take a look at two made-up microphones, so that none at a stream has to wait for a compiler."""
    time = np.arange(4410) / 44100
    one, two = (np.sin(2.0 * np.pi * frequency * time) for frequency in (1000.0, 1500.0))
    compare_inputs(np.stack((one + two, one - two)).astype(np.float32), 44100)


class Microphones:
    """What the channels of a stream carry, from a look every tenth of a second at most; see `InputState`.

    Examples
    --------
    >>> noise = np.random.default_rng(0).standard_normal((2, 4410)).astype(np.float32)
    >>> tone = np.sin(np.arange(4410)) + np.sin(0.5 * np.arange(4410)) + 0.001 * noise
    >>> microphones = Microphones()
    >>> pieces = enumerate((noise, tone, tone, tone))
    >>> windows = [Window(samples=each, start=4410 * k, sample_rate=44100) for k, each in pieces]
    >>> [microphones(window).name for window in windows]
    ['UNKNOWN', 'UNKNOWN', 'UNKNOWN', 'SAME']
    """

    def __init__(self) -> None:
        compile_looks()
        self._last = self._looked = -1
        self._state = InputState()

    def __call__(self, window: Window) -> Inputs:
        """Return what the channels carry up to a window.

        One without two channels, or with a gap, tells nothing. A window that starts no later than the last
        begins another stream.
        """
        start, step = window.start, round(LOOK * window.sample_rate)
        if start <= self._last or self._last < 0:
            self._looked, self._state = start - step, InputState()
        self._last = start
        if start - self._looked >= step and not window.has_gap and len(window.samples) == 2:
            self._looked = start
            self._state = self._state.after(compare_inputs(window.samples, window.sample_rate))
        return self.inputs

    @property
    def inputs(self) -> Inputs:
        """What the channels carry up to the last window."""
        return self._state.inputs


def inputs_of(pieces: Iterable[Audio], sample_rate: int) -> Inputs:
    """Return what the two channels of a recording carry, by nearly all looks at it that tell.

    `pieces` (2, n) are some 0.1 s each.

    >>> tone = np.sin(np.arange(44100, dtype=np.float32)) + np.sin(0.5 * np.arange(44100, dtype=np.float32))
    >>> inputs_of(np.split(np.stack((tone, tone)), 10, axis=1), 44100).value
    'both channels carry the same sound: there is one microphone'
    """
    seen = [each for piece in pieces if (each := compare_inputs(piece, sample_rate)) is not Inputs.UNKNOWN]
    most = max(seen, key=seen.count, default=Inputs.UNKNOWN)
    if len(seen) < MIN_LOOKS:
        return Inputs.UNKNOWN
    return most if seen.count(most) >= MAJORITY * len(seen) else Inputs.TWO


class _Spectrum:
    """The spectra (2, bins) of a look, and their lines."""

    def __init__(self, both: Floats, sample_rate: int) -> None:
        size = both.shape[1]
        self._spacing = sample_rate / size
        self._width = max(round(NEIGHBOURHOOD / self._spacing), 8)
        self._first = max(round(LOWEST / self._spacing), 3)
        bands = max(int((min(HIGHEST, 0.45 * sample_rate) - LOWEST) / NEIGHBOURHOOD), 1)
        bins = slice(self._first, self._first + bands * self._width)
        taper = _taper(size)
        self._values = np.fft.rfft(both * taper)[:, bins] * (2.0 / taper.sum())
        self._power = _power_of(self._values)
        lines = [_lines_of(power, self._width, CLEAR) for power in self._power]
        self._lines = [self._other_than_hum(*each) for each in zip(self._values, lines, strict=True)]
        self.has_string = [string.size > 0 for string in self._lines]
        self.is_hum = [every.size > string.size for every, string in zip(lines, self._lines, strict=True)]

    def has_own(self, channel: int) -> bool:
        """Return whether a channel has lines that no multiple of the other explains."""
        if not self.has_string[channel]:
            return False
        return all(self._has_rest(channel, multiple) for multiple in self._multiples(channel))

    def explains(self, channel: int) -> bool:
        """Return whether a multiple of the other channel is nearly all that is in this one's lines."""
        for bins in self._shared_bins:
            here, other = self._values[channel][bins], self._values[1 - channel][bins]
            rest = here - self._multiple(channel, bins) * other
            if _power_of(rest).sum() < MAX_REST * _power_of(here).sum():
                return True
        return False

    def is_copy(self, channel: int) -> bool:
        """Return whether a channel is a multiple of the other, by more than one line."""
        return self._lines[channel].size >= MIN_LINES and self.explains(channel)

    def multiple(self, channel: int) -> float:
        """Return the size of the multiple of the other channel that is in this one."""
        return min(map(abs, self._multiples(channel)))

    def is_deaf(self, channel: int) -> bool:
        """Return whether a channel does not hear the other's lines, though they are strong enough."""
        lines, power, heard = self._lines[1 - channel], self._power[1 - channel], self._power[channel]
        lines = lines[_would_stand_out(LEAST_CROSSTALK * power[lines], lines, heard, self._width, PRESENT)]
        if not lines.size:
            return False
        there = self._frequency(self._values[channel], _lines_of(heard, self._width, PRESENT))
        sent = self._frequency(self._values[1 - channel], lines)
        present = (np.abs(sent[:, None] - there) < SAME_LINE * self._spacing).any(axis=1)
        return float(power[lines][present].sum()) < APART * float(power[lines].sum())

    def has_two_rates(self) -> bool:
        """Return whether one channel's lines are the other's, moved by a ratio of sample rates."""
        one, two = (self._frequency(self._values[k], self._lines[k]) for k in (0, 1))
        power = self._power[0][self._lines[0]]
        for ratio in RATE_RATIOS:
            near = (np.abs(ratio * one[:, None] / two - 1.0) < SAME_RATIO).any(axis=1)
            if power[near].sum() > ALIKE * power.sum():
                return True
        return False

    @cached_property
    def _shared_bins(self) -> list[Indices]:
        """The bins of both channels' lines: all, and those above hum's strongest."""
        lines = np.union1d(self._lines[0], self._lines[1])
        near = np.unique(lines[:, None] + np.arange(-1, 2))
        high = near[near > HUM_TOP / self._spacing - self._first]
        return [bins for bins in (near, high) if bins.size]

    def _multiples(self, channel: int) -> list[float]:
        """Return multiples of the other channel that may explain a channel."""
        return [self._multiple(channel, bins) for bins in self._shared_bins] or [0.0]

    def _multiple(self, channel: int, bins: Indices) -> float:
        here, other = self._values[channel][bins], self._values[1 - channel][bins]
        return float(np.vdot(other, here).real / max(np.vdot(other, other).real, 1e-300))

    def _has_rest(self, channel: int, multiple: float) -> bool:
        rest = self._values[channel] - multiple * self._values[1 - channel]
        power = _power_of(rest)
        if power.max() < SILENT_LEVEL**2:
            return False
        return self._other_than_hum(rest, _lines_of(power, self._width, CLEAR)).size > 0

    def _frequency(self, values: NDArray[np.complex128], lines: Indices) -> Floats:
        """Return the frequencies of lines, between bins."""
        return (self._first + _places_of(values, lines)) * self._spacing

    def _other_than_hum(self, values: NDArray[np.complex128], lines: Indices) -> Indices:
        """Return the lines of a spectrum (bins,); none if all of them are hum."""
        if not lines.size:
            return lines
        frequency = self._frequency(values, lines)
        if frequency[np.abs(values[lines]).argmax()] >= HUM_TOP:
            return lines
        for mains in MAINS:
            off = np.abs(frequency - mains * np.round(frequency / mains))
            if (off < HUM_WIDTH + HUM_DRIFT * frequency).all():
                return lines[:0]
        return lines


@kernel()
def _centred(samples: Audio) -> tuple[Floats, Floats]:
    """Return the samples of each channel about their mean, and their standard deviation (channels,)."""
    centred, levels = np.empty(samples.shape), np.empty(samples.shape[0])
    for c in range(samples.shape[0]):
        total = square = 0.0
        for i in range(samples.shape[1]):
            total += samples[c, i]
        for i in range(samples.shape[1]):
            centred[c, i] = samples[c, i] - total / samples.shape[1]
            square += centred[c, i] ** 2
        levels[c] = np.sqrt(square / samples.shape[1])
    return centred, levels


@part()
def _stands_out(level: float, power: Floats, k: int, width: int, least: float) -> bool:
    """Return whether a power is above the noise beside bin k by a factor.

    Noise, as a median, is known from the lower quarter of a band, between lines.
    """
    first, below = k // width * width, 0
    for quiet in power[first : first + width]:
        below += level > least * (quiet * QUARTER_TO_MEDIAN)
    return below > width // 4


@kernel()
def _lines_of(power: Floats, width: int, least: float) -> Indices:
    """Return the bins of lines that stand out of the noise, in bands of `width` bins, by a factor."""
    is_line = np.zeros(power.size, np.bool_)
    lowest = STRONG * power.max()
    for k in range(1, power.size - 1):
        is_peak = power[k] > lowest and power[k] > power[k - 1] and power[k] >= power[k + 1]
        is_line[k] = is_peak and _stands_out(power[k], power, k, width, least)
    return np.flatnonzero(is_line)


@kernel()
def _would_stand_out(level: Floats, lines: Indices, power: Floats, width: int, least: float) -> Flags:
    """Return whether lines (n,) of such powers (n,) would stand out of a channel's noise by a factor."""
    would = np.empty(lines.size, np.bool_)
    for n in range(lines.size):
        would[n] = _stands_out(level[n], power, lines[n], width, least)
    return would


@kernel()
def _places_of(values: NDArray[np.complex128], lines: Indices) -> Floats:
    """Return where lines lie, in bins: the highest point of a parabola through the logarithms of three."""
    places = np.empty(lines.size)
    for k, line in enumerate(lines):
        below, peak, above = np.log(np.abs(values[line - 1 : line + 2]) + 1e-300)
        bend = below - 2.0 * peak + above
        shift = 0.5 * (below - above) / bend if bend < 0.0 else 0.5 * (above - below)
        places[k] = line + min(max(shift, -0.5), 0.5)
    return places


@lru_cache(maxsize=8)
def _taper(size: int) -> Floats:
    return np.hanning(size)


def _power_of(values: NDArray[np.complex128]) -> Floats:
    return values.real**2 + values.imag**2
