"""Measures of the harmonics of several series, and of each channel as a whole."""

from math import log2

import numpy as np
from numpy.typing import NDArray

from monochord.core.kernels import kernel, part
from monochord.core.types import Floats
from monochord.core.units import Hertz
from monochord.dsp.hann import hann_bin, hann_line
from monochord.perception.reader.measures import MODE_1, MODE_2, OPEN, POSITION, REST
from monochord.perception.spectrum import SpectrumAnalyser

HARMONICS = 8
"""Harmonics of a series."""
LEVEL, OFFSET, SIDE, GROWTH, LIKENESS = range(5)
"""Quantities of a harmonic, in the order of the last axis."""
QUANTITIES = 5
SEARCH_BINS, SEARCH_SHARE = 1.5, 0.004
"""Half width of the search for a harmonic: so many bins plus such a share of its frequency."""
SIDEBAND_FIRST, SIDEBAND_END = 3, 9
"""Distances in bins from a line at which its sidebands begin and end."""
MIN_CHANNEL_SHARE = 1.0e-7
"""Least power of a harmonic as a share of the channel's; below is only hiss."""
MIN_POWER = 1.0e-13
"""Least power in full scale."""
MIN_SIDEBAND_SHARE = 1.0e-5
"""Least power of sidebands as a share of their line's; a Hann taper leaks more."""
MAX_OFFSET, MAX_GROWTH = 5.0, 30.0
"""Largest offsets, in thousandths, and growths, in 1/s."""
RUMBLE_BANDS = np.array([[20.0, 150.0], [150.0, 500.0]])
"""Bands in Hz whose power is measured."""
GAP_BANDS = np.array([[500.0, 2000.0], [2000.0, 6000.0], [6000.0, 12000.0], [12000.0, 20000.0]])
"""Bands in Hz whose mean logarithm of power is measured, which is that of the gaps between lines."""
FLATNESS_BAND = np.array([4000.0, 15000.0])
"""Band in Hz whose flatness is measured."""
STRETCHES = 10
"""Stretches of a window whose levels measure how steady it is."""
CHANNEL_QUANTITIES = 10
"""Quantities of a channel as a whole."""


def expected_harmonics(analyser: SpectrumAnalyser, measures: Floats, *, touched: bool) -> Floats:
    """Return the expected harmonics of both segments and of the untouched string, (3, `HARMONICS`) in Hz.

    They are the stiff partials, and in a segment the multiples of its sustained line where a mode is one.
    Those of the segments are 0 unless something touches the string. `measures` are the reader's of the
    window.
    """
    number = np.arange(1.0, HARMONICS + 1.0)
    partials = np.zeros((3, HARMONICS))
    position = measures[POSITION]
    for s, (side, mode) in enumerate(((position, measures[MODE_1]), (1.0 - position, measures[MODE_2]))):
        if not touched or side <= 0.0:
            continue
        fundamental = analyser.nominal * (1.0 + 0.001 * measures[OPEN]) / side
        partials[s] = number * fundamental * np.sqrt(1.0 + analyser.bending * (number / side) ** 2)
        if mode > 0.0:
            line = mode * fundamental * np.sqrt(1.0 + analyser.bending * (mode / side) ** 2)
            partials[s] = np.where(number % mode == 0.0, line * number / mode, partials[s])
    rest = analyser.nominal * (1.0 + 0.001 * measures[REST])
    partials[2] = number * rest * np.sqrt(1.0 + analyser.bending * number**2)
    return partials


@kernel()
def measure_harmonics(
    transform: NDArray[np.complex128], power: Floats, partials: Floats, spacing: Hertz
) -> Floats:
    """Return the quantities of each harmonic, (channels, series, harmonics, `QUANTITIES`).

    Level: log10 of the power of three bins in full scale. Offset: of the line from the expected partial, in
    thousandths. Side: log10 of the sidebands' power over the line's. Growth: of its amplitude, in 1/s.
    Likeness: 2 Re(A B*) / (|A|^2 + |B|^2) of this channel and the next. Offset, growth and likeness are
    scaled down where the line does not stand out of its sidebands.

    The `transform` is without a taper and the `power` under Hann's, (channels, bins). `partials` (series,
    harmonics) are expected frequencies in Hz; a harmonic at 0 or too high is left out.
    """
    channels = power.shape[0]
    measured = np.zeros((channels, *partials.shape, QUANTITIES))
    for c in range(channels):
        least = MIN_POWER + MIN_CHANNEL_SHARE * power[c, 2:].sum() / 1.5
        measured[c, :, :, LEVEL] = np.log10(least)
        for s in range(partials.shape[0]):
            for n in range(partials.shape[1]):
                expected = partials[s, n] / spacing
                peak, line, side = _line_near(power[c], expected)
                if peak == 0:
                    continue
                clarity = line / (line + 3.0 * side + least)
                value = hann_bin(transform, c, peak)
                other = hann_bin(transform, (c + 1) % channels, peak)
                found, growth = hann_line(transform, c, peak, spacing)
                offset = 1000.0 * (found / expected - 1.0)
                cross = 2.0 * (value * other.conjugate()).real
                likeness = cross / (abs(value) ** 2 + abs(other) ** 2 + MIN_POWER)
                measured[c, s, n, LEVEL] = np.log10(line / 1.5 + least)
                measured[c, s, n, OFFSET] = clarity * min(max(offset, -MAX_OFFSET), MAX_OFFSET)
                beside = side + MIN_SIDEBAND_SHARE * line + least
                measured[c, s, n, SIDE] = np.log10(beside / (line + least))
                measured[c, s, n, GROWTH] = clarity * min(max(growth, -MAX_GROWTH), MAX_GROWTH)
                measured[c, s, n, LIKENESS] = clarity * likeness
    return measured


@part()
def _line_near(power: Floats, expected: float) -> tuple[int, float, float]:
    """Return the bin of the line at an expected one, its power and that of its sidebands; bin 0 of none.

    The line is the strongest bin in reach; none is where the reach or the sidebands end beyond the spectrum.
    """
    reach = SEARCH_BINS + SEARCH_SHARE * expected
    first, last = int(np.ceil(expected - reach)), int(np.floor(expected + reach))
    if first <= SIDEBAND_END or last >= power.size - SIDEBAND_END:
        return 0, 0.0, 0.0
    peak = first + int(power[first : last + 1].argmax())
    line = power[peak - 1 : peak + 2].sum()
    below = power[peak - SIDEBAND_END + 1 : peak - SIDEBAND_FIRST + 1].sum()
    above = power[peak + SIDEBAND_FIRST : peak + SIDEBAND_END].sum()
    return peak, line, below + above


@kernel()
def measure_channels(samples: Floats, power: Floats, spacing: Hertz) -> Floats:
    """Return the quantities of each channel as a whole, (channels, `CHANNEL_QUANTITIES`).

    log10 of its mean square; of its power in `RUMBLE_BANDS`; the mean log10 of its power in `GAP_BANDS`; its
    flatness in `FLATNESS_BAND`, log10 of geometric over arithmetic mean; the growth of log10 of its mean
    square from the first half to the second; and that level's deviation over `STRETCHES`.
    """
    measured = np.zeros((samples.shape[0], CHANNEL_QUANTITIES))
    length = samples.shape[1] // STRETCHES
    for c in range(samples.shape[0]):
        squares = np.full(STRETCHES, MIN_POWER)
        for p in range(STRETCHES):
            total = 0.0
            for i in range(p * length, (p + 1) * length):
                total += samples[c, i] * samples[c, i]
            squares[p] += total / length
        measured[c, 0] = np.log10(squares.mean())
        for b in range(2):
            measured[c, 1 + b] = np.log10(MIN_POWER + _within(power[c], RUMBLE_BANDS[b], spacing).sum() / 1.5)
        for b in range(4):
            measured[c, 3 + b] = _mean_log(_within(power[c], GAP_BANDS[b], spacing))
        band = _within(power[c], FLATNESS_BAND, spacing)
        measured[c, 7] = _mean_log(band) - np.log10(MIN_POWER + band.sum() / max(band.size, 1))
        measured[c, 8] = np.log10(squares[STRETCHES // 2 :].sum() / squares[: STRETCHES // 2].sum())
        measured[c, 9] = np.log10(squares).std()
    return measured


@part()
def _within(power: Floats, band: Floats, spacing: Hertz) -> Floats:
    first, last = int(np.ceil(band[0] / spacing)), int(np.ceil(band[1] / spacing))
    return power[min(max(first, 2), power.size) : min(last, power.size)]


@part()
def _mean_log(power: Floats) -> float:
    """Return the mean log10 of powers; sixteen are multiplied before a logarithm is taken, which is slow."""
    total, product = 0.0, 1.0
    for k in range(power.size):
        product *= power[k] + MIN_POWER  # of sixteen it is between 1e-208 and 1e92
        if k % 16 == 15:
            total += np.log10(product)
            product = 1.0
    return (total + np.log10(product)) / power.size if power.size else np.log10(MIN_POWER)


def of_microphones(each: Floats, whole: Floats, place: float) -> tuple[Floats, Floats]:
    """Return the columns of both microphones, of their difference and of their likeness, and the timbre.

    `each` is of `measure_harmonics` for three series, and `whole` of `measure_channels`, both of two
    channels. `place` is the position over the string's length, 0 of no touch.
    """
    octaves = np.array([-log2(side) if place > 0.0 else 0.0 for side in (place, 1.0 - place)])
    difference, likeness = each[0] - each[1], each[0, :, :, LIKENESS]
    columns = (
        each[0, 0::2, :, :LIKENESS],
        whole[0],
        octaves[0],
        each[1, 1:, :, :LIKENESS],
        whole[1],
        octaves[1],
        difference[:, :, LEVEL],
        difference[:, :, SIDE],
        difference[:2, :, GROWTH],
        whole[0] - whole[1],
        octaves[0] - octaves[1],
        likeness,
    )
    timbre = np.stack((each[0, 0, :, LEVEL], each[1, 1, :, LEVEL]))
    return np.hstack([np.ravel(column) for column in columns]), timbre - timbre.max(axis=1, keepdims=True)
