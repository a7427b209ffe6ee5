"""Readings of spectral lines as modes of two segments, or of the untouched string, and how well each fits."""

from typing import NamedTuple

import numba
import numpy as np

from monochord.core.types import Floats
from monochord.core.units import Hertz

MODES = 6
"""Highest mode that a driver is thought to lock to."""
HIGH_MODE = 0.25
"""What a reading loses for each e times higher number of a line in its series: drivers favour low modes."""
OWN_EAR = 0.5
"""What it gains for each e times louder the segment's own microphone hears the line."""
LEAST_SHARE = 0.02
"""Least share of the power that a microphone is taken to hear."""


class Lines(NamedTuple):
    """Strong spectral lines: frequency and its error in Hz, weight 0 to 1, channel 1's share of the power."""

    frequency: Floats
    std: Floats
    weight: Floats
    share_1: Floats
    tolerance: Hertz


class Pairs(NamedTuple):
    """Readings of two lines as modes of the two segments: (f1, f2) and their errors, each (readings, 2)."""

    frequency: Floats
    std: Floats


@numba.njit(cache=True, error_model="numpy")
def pairs(lines: Lines, lowest: Hertz, highest: Hertz) -> Pairs:
    """Return all (f1, f2) whose open frequency is allowed, made of two lines and two mode numbers."""
    count = lines.frequency.size * MODES
    base, std = np.empty(count), np.empty(count)
    for i in range(count):
        mode = i % MODES + 1
        base[i], std[i] = lines.frequency[i // MODES] / mode, lines.std[i // MODES] / mode
    frequency, error = np.empty((count * count, 2)), np.empty((count * count, 2))
    found = 0
    for i in range(count):
        for j in range(count):
            if lowest <= base[j] * base[i] / (base[i] + base[j]) <= highest:
                frequency[found] = base[i], base[j]
                error[found] = std[i], std[j]
                found += 1
    return Pairs(frequency[:found].copy(), error[:found].copy())


def scores(lines: Lines, fundamentals: Floats) -> Floats:
    """Return how well each pair of series explains the lines: +1 a strong line explained, -1 one left over.

    High mode numbers cost, since drivers favour low modes and a dense series explains anything; a line that
    the other segment's microphone hears louder costs too.

    Parameters
    ----------
    lines
        What is there.
    fundamentals
        f1 and f2 of each pair in Hz, (readings, 2).
    """
    heard = np.stack((lines.share_1, 1.0 - lines.share_1), axis=1)
    gain = OWN_EAR * np.log(2.0 * np.maximum(heard, LEAST_SHARE))
    return _told(lines, fundamentals, gain) @ lines.weight / lines.weight.sum()


@numba.njit(cache=True, error_model="numpy")
def _told(lines: Lines, fundamentals: Floats, gain: Floats) -> Floats:
    """Return what each pair of series (readings) makes of each line, (readings, lines)."""
    told = np.full((fundamentals.shape[0], lines.frequency.size), -1.0)
    for i in range(fundamentals.shape[0]):
        for k in range(lines.frequency.size):
            for segment in range(2):
                fundamental = fundamentals[i, segment]
                number = max(np.rint(lines.frequency[k] / fundamental), 1.0)
                if abs(lines.frequency[k] - number * fundamental) < lines.tolerance:
                    told[i, k] = max(told[i, k], 1.0 - HIGH_MODE * np.log(number) + gain[k, segment])
    return told


def untouched(lines: Lines, frequency: Hertz, drift: float) -> tuple[float, Hertz, Hertz]:
    """Return the score of the untouched string, one series, and its frequency as measured with its error.

    Parameters
    ----------
    lines
        What is there.
    frequency, drift
        Of the untouched string in Hz, and the share by which it may lie off.
    """
    number = np.maximum(np.rint(lines.frequency / frequency), 1.0)
    near = np.abs(lines.frequency - number * frequency) < lines.tolerance + drift * number * frequency
    told = np.where(near, 1.0 - HIGH_MODE * np.log(number), -1.0)
    k = int(lines.weight.argmax())
    score = float((lines.weight * told).sum() / lines.weight.sum())
    return score, float(lines.frequency[k] / number[k]), float(lines.std[k] / number[k])
