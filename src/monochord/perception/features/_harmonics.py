"""What is measured around the harmonics of three series, and of each channel as a whole."""

import numba
import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats
from monochord.core.units import Hertz

HARMONICS = 8
"""Harmonics of a series."""
LEVEL, OFFSET, SIDE, GROWTH, LIKENESS = range(5)
"""What is measured of a harmonic, in this order."""
QUANTITIES = 5
REACH_BINS, REACH_SHARE = 1.5, 0.004
"""How far from its place a harmonic is looked for, in bins and as a share of its frequency, added up."""
NEAR, FAR = 3, 9
"""Bins from the line between which its sidebands are."""
DEEP = 1.0e-7
"""Powers below this share of a channel's count as it: there is nothing but hiss to be told."""
QUIET = 1.0e-13
"""Power that counts as none at all, in full scale."""
SIDE_LEAST = 1.0e-5
"""Sidebands below this share of their line count as it; a Hann taper leaks more."""
OFFSET_MOST, GROWTH_MOST = 5.0, 30.0
"""Largest offsets told, in thousandths, and growths, in 1/s."""
RUMBLES = np.array([[20.0, 150.0], [150.0, 500.0]])
"""Bands in Hz of which power is told."""
GAPS = np.array([[500.0, 2000.0], [2000.0, 6000.0], [6000.0, 12000.0], [12000.0, 20000.0]])
"""Bands in Hz of which the mean of the logarithm of power is told."""
FLAT = np.array([4000.0, 15000.0])
"""Band in Hz whose flatness is told."""
PARTS = 10
"""Stretches whose levels tell how steady a window is."""
WHOLES = 10
"""What is measured of a channel as a whole."""


@numba.njit(cache=True, error_model="numpy")
def harmonics(plain: NDArray[np.complex128], power: Floats, places: Floats, spacing: Hertz) -> Floats:
    """Return what is measured at each place, (channels, series, harmonics, quantities).

    Level: log10 of the power of three bins in full scale. Offset: of the line from its place, in
    thousandths. Side: log10 of the sidebands' power over the line's. Growth: of its amplitude, in 1/s.
    Likeness: 2 Re(A B*) / (|A|^2 + |B|^2) of this channel and the next. Offset, growth and likeness count
    the less, the less the line stands out of its sidebands.

    `plain` and `power` are transform and Hann power (channels, bins) and `spacing` is the distance of
    two bins. `places` (series, harmonics) are in Hz; where one is 0, or too high, nothing is there.
    """
    channels, bins = power.shape
    told = np.zeros((channels, *places.shape, QUANTITIES))
    for c in range(channels):
        deep = QUIET + DEEP * power[c, 2:].sum() / 1.5
        told[c, :, :, LEVEL] = np.log10(deep)
        for s in range(places.shape[0]):
            for n in range(places.shape[1]):
                place = places[s, n] / spacing
                reach = REACH_BINS + REACH_SHARE * place
                first, last = int(np.ceil(place - reach)), int(np.floor(place + reach))
                if first <= FAR or last >= bins - FAR:
                    continue
                peak = first + int(power[c, first : last + 1].argmax())
                line = power[c, peak - 1 : peak + 2].sum()
                side = (
                    power[c, peak - FAR + 1 : peak - NEAR + 1].sum()
                    + power[c, peak + NEAR : peak + FAR].sum()
                )
                clear = line / (line + 3.0 * side + deep)
                value, turned = _hann(plain, c, peak)
                other, _ = _hann(plain, (c + 1) % channels, peak)
                offset = 1000.0 * ((peak + min(max(0.25 * turned.real, -1.0), 1.0)) / place - 1.0)
                growth = -0.5 * np.pi * spacing * turned.imag
                alike = 2.0 * (value * other.conjugate()).real / (abs(value) ** 2 + abs(other) ** 2 + QUIET)
                told[c, s, n, LEVEL] = np.log10(line / 1.5 + deep)
                told[c, s, n, OFFSET] = clear * min(max(offset, -OFFSET_MOST), OFFSET_MOST)
                told[c, s, n, SIDE] = np.log10((side + SIDE_LEAST * line + deep) / (line + deep))
                told[c, s, n, GROWTH] = clear * min(max(growth, -GROWTH_MOST), GROWTH_MOST)
                told[c, s, n, LIKENESS] = clear * alike
    return told


@numba.njit(cache=True, error_model="numpy")
def _hann(plain: NDArray[np.complex128], channel: int, k: int) -> tuple[complex, complex]:
    """Return a bin under a Hann taper, and the difference of its neighbours over it."""
    below, above = plain[channel, k - 1], plain[channel, k + 1]
    value = 0.5 * plain[channel, k] - 0.25 * (below + above)
    return value, (below - above) / (value + 1e-30)


@numba.njit(cache=True, error_model="numpy")
def wholes(samples: Floats, power: Floats, spacing: Hertz) -> Floats:
    """Return what is measured of each channel as a whole, (channels, `WHOLES`).

    log10 of its mean square; of its power in `RUMBLES`; the mean log10 of its power in `GAPS`; how flat it is
    in `FLAT`, log10 of geometric over arithmetic mean; by how much log10 of its mean square grows from the
    first half to the second; and how much that deviates over `PARTS` stretches.
    """
    told = np.zeros((samples.shape[0], WHOLES))
    length = samples.shape[1] // PARTS
    for c in range(samples.shape[0]):
        parts = np.full(PARTS, QUIET)
        for p in range(PARTS):
            for i in range(p * length, (p + 1) * length):
                parts[p] += samples[c, i] ** 2 / length
        told[c, 0] = np.log10(parts.mean())
        for b in range(2):
            told[c, 1 + b] = np.log10(QUIET + _within(power[c], RUMBLES[b], spacing).sum() / 1.5)
        for b in range(4):
            told[c, 3 + b] = _mean_log(_within(power[c], GAPS[b], spacing))
        flat = _within(power[c], FLAT, spacing)
        told[c, 7] = _mean_log(flat) - np.log10(QUIET + flat.sum() / max(flat.size, 1))
        told[c, 8] = np.log10(parts[PARTS // 2 :].sum() / parts[: PARTS // 2].sum())
        told[c, 9] = np.log10(parts).std()
    return told


@numba.njit(cache=True, error_model="numpy")
def _within(power: Floats, band: Floats, spacing: Hertz) -> Floats:
    first, last = int(np.ceil(band[0] / spacing)), int(np.ceil(band[1] / spacing))
    return power[min(max(first, 2), power.size) : min(last, power.size)]


@numba.njit(cache=True, error_model="numpy")
def _mean_log(power: Floats) -> float:
    """Return the mean log10 of powers; four are multiplied before a logarithm is taken, which is slow."""
    total, product = 0.0, 1.0
    for k in range(power.size):
        product *= power[k] + QUIET
        if k % 4 == 3:
            total += np.log10(product)
            product = 1.0
    return (total + np.log10(product)) / power.size if power.size else np.log10(QUIET)
