"""Spectral lines of single windows, and lasting lines, which a driven string sustains over many windows.

A partial of the untouched string exerts equal force on both ends, so both microphones record it equally loud,
up to their gains. A segment of a touched string is loud at its own microphone. Music and speech have lines
too, but not the same lines for seconds.
"""

import numpy as np
from numpy.typing import NDArray

from monochord.core.kernels import kernel, part
from monochord.core.types import Floats, Indices
from monochord.core.units import Hertz
from monochord.dsp.hann import LINES, hann_line
from monochord.dsp.spectrum import BLUR, FLOOR_WIDTH, MIN_FLOOR, block_floors
from monochord.perception.spectrum import Spectrum

MIN_SALIENCE = 5.0
"""Smallest height of a line above the noise floor, in nepers of power."""
SAME_LINE_BINS = 0.6
"""Lines of two windows or microphones that are closer than this many bins are one line."""
MIN_POWER = 1.0e-11
"""Smallest power of a line, in full scale: -110 dB, 20 dB below the rounding of 16 bits."""
BALANCE_FLOOR = 1.0e-30
"""Power that is added to both terms of a balance, because a dead microphone may record 0."""
FREQUENCY, POWER_1, POWER_2, GROWTH, BLURRED = range(5)
"""Columns of a window's lines: Hz, power at both microphones, growth in 1/s, standard error in Hz."""
LAST_FREQUENCY, LAST_STD, LAST_POWER_1, LAST_POWER_2, PRESENCE, LAST_GROWTH, GROWTH_STD = range(7)
BALANCE, BALANCE_STD = 7, 8
"""Columns of lasting lines. Presence is the share of the windows that contain the line. Balance is the
natural logarithm of the ratio of its power at microphone 2 to its power at microphone 1."""


def merged_lines(spectrum: Spectrum, spacing: Hertz) -> Floats:
    """Return the lines (n, 5) of a window of 1 or 2 channels, strongest first; at most 8 from each.

    The columns are `FREQUENCY` to `BLURRED`. With a single channel, the power at microphone 2 is 0.
    """
    _, transform, power, frequency, height = spectrum
    block = max(int(FLOOR_WIDTH / spacing), 8)
    floors = block_floors(power, block)
    return _merged(transform, power, floors, block, frequency, height, spacing)


@kernel()
def _merged(
    transform: NDArray[np.complex128],
    power: Floats,
    floors: Floats,
    block: int,
    frequency: Floats,
    height: Floats,
    spacing: Hertz,
) -> Floats:
    """Return the lines of all channels, the strongest first; of two records of one the louder counts."""
    channels = power.shape[0]
    lines = np.zeros((channels * LINES, 5))
    strength = np.zeros(channels * LINES)
    count = 0
    for c in range(channels):
        least = MIN_FLOOR * power[c].max()
        for i in range(LINES):
            f, h = frequency[c, i], height[c, i]
            k = int(np.rint(f / spacing))
            if f <= 0.0 or h < MIN_POWER:
                continue
            salience = np.log1p(power[c, k] / max(_floor(floors[c], block, k), least))
            if salience < MIN_SALIENCE:
                continue
            row = count
            for other in range(count):
                if abs(lines[other, FREQUENCY] - f) < SAME_LINE_BINS * spacing:
                    row = other
            if row < count and strength[row] >= h:
                continue
            count += row == count
            strength[row] = h
            lines[row, FREQUENCY] = f
            lines[row, POWER_1] = power[0, k]
            lines[row, POWER_2] = power[1, k] if channels > 1 else 0.0
            lines[row, GROWTH] = hann_line(transform, c, k, spacing)[1]
            lines[row, BLURRED] = BLUR * spacing * np.exp(-0.5 * salience)
    return lines[:count][np.argsort(-strength[:count], kind="mergesort")]


@part()
def _floor(floors: Floats, block: int, k: int) -> float:
    """Return the noise floor at a bin, between the middles of blocks by linear interpolation of decades."""
    at = min(max((k + 0.0) / block - 0.5, 0.0), floors.size - 1.0)
    b = min(int(at), max(floors.size - 2, 0))
    low, high = np.log(floors[b]), np.log(floors[min(b + 1, floors.size - 1)])
    return np.exp(low + (at - b) * (high - low))


def lasting_lines(windows: tuple[Floats, ...], spacing: Hertz) -> Floats:
    """Return the lines (n, 9) that windows have in common, the strongest first.

    Each window is given by its `merged_lines`. Frequency, growth and balance are medians over the windows
    that contain the line, with standard errors. Powers are means over all windows. The columns are
    `LAST_FREQUENCY` to `BALANCE_STD`.
    """
    if not windows:
        return np.zeros((0, 9))
    ends = np.cumsum([len(lines) for lines in windows])
    return _lasting(np.concatenate(windows), ends, SAME_LINE_BINS * spacing)


@kernel()
def _lasting(lines: Floats, ends: Indices, reach: Hertz) -> Floats:
    """Return the lasting lines of windows, each of which has the lines up to its one of `ends`."""
    group, groups = _groups(lines, ends, reach)
    windows, lasting = ends.size, np.zeros((groups, 9))
    for g in range(groups):
        members = lines[group == g].T.copy()  # of rows in one piece a median is compiled once
        count = members.shape[1]
        frequency, frequency_std = _median(members[FREQUENCY])
        growth, growth_std = _median(members[GROWTH])
        blurred = np.median(members[BLURRED]) / np.sqrt(count)
        lasting[g, LAST_FREQUENCY], lasting[g, LAST_STD] = frequency, np.hypot(frequency_std, blurred)
        lasting[g, LAST_POWER_1] = members[POWER_1].sum() / windows
        lasting[g, LAST_POWER_2] = members[POWER_2].sum() / windows
        lasting[g, PRESENCE] = count / windows
        lasting[g, LAST_GROWTH], lasting[g, GROWTH_STD] = growth, growth_std
        balance, balance_std = _median(
            np.log((members[POWER_2] + BALANCE_FLOOR) / (members[POWER_1] + BALANCE_FLOOR))
        )
        lasting[g, BALANCE], lasting[g, BALANCE_STD] = balance, balance_std
    return lasting[np.argsort(-lasting[:, LAST_POWER_1] - lasting[:, LAST_POWER_2], kind="mergesort")]


@part()
def _median(values: Floats) -> tuple[float, float]:
    """Return the median of values (n,) and its standard error, by their median deviation from it."""
    middle = np.median(values)
    return middle, 1.9 * np.median(np.abs(values - middle)) / np.sqrt(values.size)


@part()
def _groups(lines: Floats, ends: Indices, reach: Hertz) -> tuple[Indices, int]:
    """Return the group (n,) of each line, and their count.

    A group has one line of a window at most; the strongest begin one.

    A group follows its line as it drifts: a line joins the group whose newest member is nearest to it.
    """
    group = np.full(lines.shape[0], -1)
    newest, last = np.zeros(lines.shape[0]), np.full(lines.shape[0], -1)
    count = window = 0
    for i in range(lines.shape[0]):
        f, best, least = lines[i, FREQUENCY], -1, reach
        while i >= ends[window]:
            window += 1
        for g in range(count):
            distance = abs(newest[g] - f)
            if distance < least and last[g] != window:
                best, least = g, distance
        if best < 0:
            best, count = count, count + 1
        group[i], newest[best], last[best] = best, f, window
    return group, count
