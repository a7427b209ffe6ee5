"""Tells which spectral peaks are lines of mains hum: multiples of 50 or 60 Hz."""

import numpy as np

from monochord.core.types import Flags, Floats
from monochord.core.units import Hertz
from monochord.dsp.levels import MAINS
from monochord.dsp.spectrum import Peaks

GRID_TOLERANCE = 1.0e-3
"""Relative deviation of the grid's frequency."""
PEAK_TOLERANCE: tuple[Hertz, Hertz] = (0.2, 1.0)
"""Least and most by which a peak is off a multiple beyond that deviation, two standard deviations else."""
LEAK = 1.05
"""Amplitude of a Hann side lobe, relative to its line, times its distance in resolutions cubed."""
MOST_LEAK = 0.5
"""Share of a peak's amplitude that leaks from lines of hum, from which on it is none of its own."""
MAX_ORDER, CLEAR_ORDER, CLEAR_SALIENCE = 40, 12, 3.0
"""Highest multiple that is hum; highest multiple, and least salience, of the lines that show hum."""
MAX_COMMON = 2
"""Largest common divisor of the orders of hum, since rectifiers double the mains."""
OWN_NOTE = 0.1
"""Power over that of the strongest line below which the lines that are no multiples of it are weak."""


def mains_lines(peaks: Peaks, resolution: Hertz) -> Flags:
    """Return which peaks are lines of mains hum, or leak from them, (peaks,).

    Hum has lines at multiples of 50 or of 60 Hz, or of twice that. A note whose fundamental happens to be a
    higher multiple is none: it has only multiples of itself, or is much stronger than the other lines.

    Parameters
    ----------
    peaks
        The spectral peaks.
    resolution
        One over the window's duration, in Hz.

    Examples
    --------
    >>> def lines(*frequency):
    ...     n = np.ones(len(frequency))
    ...     return Peaks(np.array(frequency), 0.01 * n, n, n, 9.0 * n)
    >>> mains_lines(lines(60.02, 123.0, 179.9, 246.1), 10.0).tolist()
    [True, False, True, False]
    >>> mains_lines(lines(150.0, 300.1, 450.2), 10.0).tolist()
    [False, False, False]
    """
    hum = np.zeros(peaks.frequency.size, np.bool_)
    for base in MAINS:
        order = np.rint(peaks.frequency / base)
        off = np.abs(peaks.frequency - order * base)
        reach = np.clip(2.0 * np.sqrt(peaks.variance), *PEAK_TOLERANCE) + GRID_TOLERANCE * peaks.frequency
        counted = (order >= 1.0) & (order <= MAX_ORDER)
        at = counted & (off <= reach)
        if not _is_hum(order[at & (peaks.salience >= CLEAR_SALIENCE)]):
            continue
        leak = _leaked(peaks, at, resolution)
        at |= counted & (off <= reach + leak * resolution)
        hum |= (at & ~_is_note(order, peaks.power, at)) | (leak > MOST_LEAK)
    return hum


def _is_hum(order: Floats) -> bool:
    """Return whether lines of these orders are hum, and not one note."""
    clear = order[order <= CLEAR_ORDER].astype(np.int64)
    return bool(clear.size and np.gcd.reduce(clear) <= MAX_COMMON)


def _leaked(peaks: Peaks, lines: Flags, resolution: Hertz) -> Floats:
    """Return the amplitude that leaks from some lines to each peak, as a share of its own."""
    apart = np.abs(peaks.frequency[:, np.newaxis] - peaks.frequency[lines]) / resolution
    relative = np.sqrt(peaks.power[lines] / peaks.power[:, np.newaxis])
    return np.where(apart > 0.0, LEAK * relative / np.maximum(apart, 1.5) ** 3, 0.0).max(axis=1, initial=0.0)


def _is_note(order: Floats, power: Floats, lines: Flags) -> Flags:
    """Return which lines are of a note at a multiple of the mains, stronger than all other lines of hum."""
    strongest = order[np.where(lines, power, 0.0).argmax()]
    note = lines & (order % strongest == 0.0)
    weak = power[lines & ~note].max(initial=0.0) < OWN_NOTE * power[note].max()
    return note & bool(weak and strongest > MAX_COMMON)


def without(peaks: Peaks, lines: Flags) -> Peaks:
    """Return the peaks without some; the ranks of the others close up."""
    left = Peaks(*(column[~lines] for column in peaks))
    return left._replace(rank=1.0 + np.argsort(np.argsort(left.rank)).astype(np.float64))


def hidden(salience: Floats, lines: Floats, spacing: Hertz, reach: Hertz, value: float) -> Floats:
    """Return a salience (bins,) with `value` in the bins nearer than `reach` to a line; all in Hz."""
    bins = np.arange(salience.size) * spacing
    near = (
        np.abs(bins[:, np.newaxis] - lines).min(axis=1) < reach if lines.size else np.zeros(bins.size, bool)
    )
    return np.where(near, value, salience)
