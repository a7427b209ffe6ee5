"""What a touch may be by the strongest lines of two microphones, and measures of how well each explains them.

Two lines a, b and two mode numbers give a position x and an open frequency f,

    a = n1 f L / x s(n1 / x),  b = n2 f L / (L - x) s(n2 / (L - x)),  s(q) = sqrt(1 + beta q^2),

where beta = pi^3 E d^4 / (64 T) is the string's stiffness (Fletcher 1964). A hypothesis is allowed if f is
what the string's tension, and a touch that is no clamp, can make of it. Its measures are relative to the own
pitch, to the length, to the distance of two bins and to each microphone's strongest line, so they hold for
any string. docs/design/reader-of-modes.md says how the limits were set.
"""

from typing import NamedTuple

import numpy as np

from monochord.core.kernels import kernel, part
from monochord.core.types import Flags, Floats
from monochord.core.units import Hertz, Metres

MAX_MODE_1, MAX_MODE_2 = 6, 8
"""Highest modes that driver 1, tuned low, and driver 2, tuned high, lock to."""
CANDIDATE_LINES = 5
"""Strongest lines of each microphone that may be the sustained one."""
MAX_FALL, MAX_RISE = 0.09, 0.03
"""Largest shares by which the open frequency lies below, as touch and ends yield, and above expected."""
END_MARGIN = 0.04
"""Least distance of a touch from either end, as a share of the length."""
MAX_HYPOTHESES = 128
"""Hypotheses of a window; on 9,000 simulated windows the most were 129, and 98 in all but a hundredth."""
WEIGHT_DECADES = 4.0
"""Decades of power below the strongest line at which a line's weight is 0."""
TOLERANCE_BINS, TOLERANCE_SHARE = 1.2, 0.003
"""Largest distance of a line from a partial: so many bins plus such a share of its frequency."""
MIN_SHARE = 0.02
"""Least share of a line's power at a microphone that counts."""
TRAINED_RISE = 0.012
"""Share by which the forces of the training raise the open frequency; where `rise` is larger, that is 1."""

FREQUENCY, WEIGHT, SHARE_1, GAIN_1, GAIN_2 = range(5)
"""Columns of an array of lines: Hz, 0 to 1, the share of the power at microphone 1, and the logarithm of that
at either microphone over a half. Peaks have the first three."""
POSITION, OPEN, MODE_1, MODE_2, LINE_1, LINE_2, WEAKNESS_1, WEAKNESS_2 = range(8)
"""Columns of an array of hypotheses; lines are ranks by strength, from 0, and weakness is in decades."""
PARTIALS = 10
"""Partials of each segment whose level and prominence are measures."""
MAX_PEAKS, MIN_PROMINENCE = 64, 0.8
"""Peaks of both microphones that stand out most, and decades by which one stands out at least."""
HIGHEST_PEAK: Hertz = 20000.0
"""Highest frequency of a peak or a partial."""
TONES = 4
"""Highest multiples of the two lines whose sums and differences the drivers' distortion makes."""
LEVEL_DECADES = 8.0
"""Decades below a microphone's strongest line at which a partial's level is 0."""

COMMON = ("number", "own share", "miss", "fall", "rise", "strongest left", "tones", "left", "whole string")
OF_A_SEGMENT = (
    "explained",
    "left",
    "mode",
    "weakness",
    "below",
    "line",
    "side",
    "peaks",
    "peaks' share",
)
OF_A_PARTIAL = ("level", "other level", "prominence")
OF_THE_PLACE = ("probability", "greatest probability")
COMMON_MEASURES, SEGMENT_MEASURES = len(COMMON), len(OF_A_SEGMENT) + PARTIALS * len(OF_A_PARTIAL)
PLACE_MEASURES = COMMON_MEASURES + 2 * SEGMENT_MEASURES
"""First of the measures that `place_density` fills in."""
MEASURES = PLACE_MEASURES + len(OF_THE_PLACE)
"""Measures of a hypothesis: those of both segments, those of each, and how probable its place is."""
(_NUMBER, _OWN_SHARE, _MISS, _FALL, _RISE, _STRONGEST_LEFT, _TONES, _LEFT, _WHOLE) = range(COMMON_MEASURES)
(_EXPLAINED, _MIC_LEFT, _MODE, _WEAKNESS, _BELOW, _LINE_SHARE, _SIDE, _PEAKS, _PEAKS_SHARE) = range(9)


class StringModel(NamedTuple):
    """A string's length in m, nominal open frequency in Hz, stiffness beta in m^2, and what may raise it.

    `rise` is the share by which the largest expected force raises the open frequency, and `slack` the share
    by which it may be tuned off nominal, either way, at no cost: 0 for a string whose tuning is known.
    """

    length: Metres
    nominal: Hertz
    stiffness: float
    rise: float
    slack: float = 0.0


@kernel()
def weighted_lines(frequency: Floats, height: Floats, power: Floats, spacing: Hertz) -> Floats:
    """Return the lines (lines, 5) of either microphone whose weight is above 0."""
    lines = np.zeros((frequency.size, 5))
    count = 0
    for m in range(2):
        for i in range(frequency.shape[1]):
            if frequency[m, i] <= 0.0:
                break
            weight = 1.0 + np.log10(height[m, i] / height[m, 0]) / WEIGHT_DECADES
            if weight > 0.0:
                lines[count, FREQUENCY], lines[count, WEIGHT] = frequency[m, i], weight
                share = share_1(power, frequency[m, i], spacing)
                lines[count, SHARE_1] = share
                lines[count, GAIN_1] = np.log(2.0 * max(share, MIN_SHARE))
                lines[count, GAIN_2] = np.log(2.0 * max(1.0 - share, MIN_SHARE))
                count += 1
    return lines[:count]


@kernel()
def share_1(power: Floats, frequency: Hertz, spacing: Hertz) -> float:
    """Return the share of a line's power at microphone 1."""
    k = int(np.rint(frequency / spacing))
    return power[0, k] / (power[0, k] + power[1, k])


@kernel()
def find_hypotheses(frequency: Floats, height: Floats, string: StringModel) -> Floats:
    """Return the allowed hypotheses (n, 8) of the strongest lines (2, lines) in Hz and in power."""
    length = string.length
    hypotheses = np.zeros((MAX_HYPOTHESES, 8))
    flexible = (1.0 - 1.0e-9 - MAX_FALL - string.slack) * string.nominal
    count = 0
    for pair in range(CANDIDATE_LINES * CANDIDATE_LINES):
        i, j = pair // CANDIDATE_LINES, pair % CANDIDATE_LINES
        a, b = frequency[0, i], frequency[1, j]
        if a <= 0.0 or b <= 0.0:
            continue
        weakness = -np.log10(height[0, i] / height[0, 0]), -np.log10(height[1, j] / height[1, 0])
        if weakness[0] + weakness[1] > WEIGHT_DECADES:
            continue
        for modes in range(MAX_MODE_1 * MAX_MODE_2):
            n1, n2 = modes // MAX_MODE_2 + 1.0, modes % MAX_MODE_2 + 1.0
            # Without stiffness a pair is of a higher open frequency: most are too low even so.
            if a * b < flexible * (n2 * a + n1 * b):
                continue
            x, own = _located(a, n1, b, n2, string)
            off = own / string.nominal - 1.0
            if not -MAX_FALL - string.slack < off < string.rise + MAX_RISE + string.slack:
                continue
            if not END_MARGIN * length < x < (1.0 - END_MARGIN) * length or count == MAX_HYPOTHESES:
                continue
            row = (x, own, n1, n2, float(i), float(j), weakness[0], weakness[1])
            for k in range(len(row)):  # one assignment of a row compiles numba's messages about shapes: 6 s
                hypotheses[count, k] = row[k]
            count += 1
    return hypotheses[:count]


@part()
def _located(a: Hertz, n1: float, b: Hertz, n2: float, string: StringModel) -> tuple[Metres, Hertz]:
    """Return position and open frequency of a pair of modes, by fixed-point iteration over the stiffness."""
    length, beta_1, beta_2 = string.length, string.stiffness * n1**2, string.stiffness * n2**2
    f1, f2 = a / n1, b / n2
    x, stretch_1 = length * f2 / (f1 + f2), 1.0
    for _ in range(4):
        square_1, square_2 = x**2, (length - x) ** 2
        stretch_1 = 1.0 + beta_1 / square_1
        ratio = np.sqrt(stretch_1 * square_2 / (square_2 + beta_2))  # of the two segments' s(n / side)
        x = length * f2 * ratio / (f1 + f2 * ratio)
    return x, f1 / np.sqrt(stretch_1) * x / length


@kernel()
def measure_hypotheses(
    hypotheses: Floats,
    frequency: Floats,
    height: Floats,
    power: Floats,
    prominence: Floats,
    spacing: Hertz,
    string: StringModel,
) -> Floats:
    """Return the measures (n, `MEASURES`) of hypotheses, those of the place left at 0.

    Parameters
    ----------
    hypotheses
        Hypotheses (n, 8), as `find_hypotheses` returns them.
    frequency, height
        Strongest lines (2, lines) in Hz and in power.
    power
        Power spectra (2, bins).
    prominence
        Decades (2, bins) by which each bin stands out of the floor, as `prominence.prominences` returns them.
    spacing
        Distance of two bins in Hz.
    string
        The string.
    """
    measures = np.zeros((hypotheses.shape[0], MEASURES))
    lines = weighted_lines(frequency, height, power, spacing)
    peaks = _prominent_peaks(power, prominence, spacing, string)
    others = np.empty_like(peaks)
    is_tone = np.zeros(power.shape[1], np.bool_)
    lowest = (1.0 - MAX_FALL - string.slack) * string.nominal
    numbers = np.arange(int(HIGHEST_PEAK / lowest) + 3.0)
    partials, log_number = np.zeros((3, numbers.size)), np.log(numbers)
    pair, count, tones = -1, 0, 0.0
    for k in range(hypotheses.shape[0]):
        i, j = int(hypotheses[k, LINE_1]), int(hypotheses[k, LINE_2])
        sustained = (frequency[0, i], frequency[1, j])
        if pair != i * CANDIDATE_LINES + j:  # hypotheses come pair by pair
            pair = i * CANDIDATE_LINES + j
            _mark_tones(is_tone, sustained, spacing)
            count, tones = _without_tones(peaks, is_tone, spacing, others)
        row = measures[k]
        row[_TONES] = tones
        _measure_tuning(row, hypotheses[k], string)
        _fill_partials(partials, numbers, hypotheses[k], string)
        _measure_lines(row, hypotheses[k], lines, sustained, spacing, partials, log_number, string.length)
        _measure_peaks(row, hypotheses[k], others[:count], spacing, partials, string.length)
        for segment in range(2):
            first = COMMON_MEASURES + segment * SEGMENT_MEASURES
            share = share_1(power, sustained[segment], spacing)
            row[first + _LINE_SHARE] = share if segment == 0 else 1.0 - share
            levels = row[first + len(OF_A_SEGMENT) : first + SEGMENT_MEASURES]
            _measure_partials(
                levels,
                int(hypotheses[k, MODE_1 + segment]),
                segment,
                sustained[segment],
                height,
                power,
                prominence,
                spacing,
                partials[segment],
            )
    return measures


@part()
def _measure_tuning(row: Floats, hypothesis: Floats, string: StringModel) -> None:
    off = hypothesis[OPEN] / string.nominal - 1.0
    row[_FALL] = max(-off - string.slack, 0.0)
    row[_RISE] = max(off - string.slack, 0.0) * min(1.0, TRAINED_RISE / max(string.rise, TRAINED_RISE))
    for segment in range(2):
        first = COMMON_MEASURES + segment * SEGMENT_MEASURES
        side = hypothesis[POSITION] if segment == 0 else string.length - hypothesis[POSITION]
        row[first + _SIDE] = side / string.length
        row[first + _MODE] = np.log(hypothesis[MODE_1 + segment])
        row[first + _WEAKNESS] = hypothesis[WEAKNESS_1 + segment]


@part()
def _fill_partials(partials: Floats, numbers: Floats, hypothesis: Floats, string: StringModel) -> None:
    """Fill in the stiff partials (3, numbers) in Hz of both segments and of the whole string."""
    x, own = hypothesis[POSITION], hypothesis[OPEN]
    for row, side in enumerate((x, string.length - x, string.length)):
        fundamental, beta = own * string.length / side, string.stiffness / side**2
        for n in range(numbers.size):
            partials[row, n] = numbers[n] * fundamental * np.sqrt(1.0 + beta * numbers[n] ** 2)


@part()
def _measure_lines(
    row: Floats,
    hypothesis: Floats,
    lines: Floats,
    sustained: tuple[Hertz, Hertz],
    spacing: Hertz,
    partials: Floats,
    log_number: Floats,
    length: Metres,
) -> None:
    """Of the strongest lines: whose stiff partial each is, or multiple of a sustained line."""
    x, own = hypothesis[POSITION], hypothesis[OPEN]
    per_hertz = (x / (own * length), (length - x) / (own * length))
    total = lines[:, WEIGHT].sum()
    for q in range(lines.shape[0]):
        f, weight, share = lines[q, FREQUENCY], lines[q, WEIGHT] / total, lines[q, SHARE_1]
        tolerance = TOLERANCE_BINS * spacing + TOLERANCE_SHARE * f
        best, number, gain, off, of = -9.0, 1, 0.0, 0.0, -1
        for segment in range(2):
            n = max(int(np.rint(f * per_hertz[segment])), 1)
            miss = min(abs(f - partials[segment, n]), abs(f - n * sustained[segment]))
            if miss < tolerance:
                own_share = lines[q, GAIN_1 + segment]
                score = own_share - 0.6 * log_number[n]  # which of two segments: the louder, the lower
                if score > best:
                    best, number, gain, off, of = score, n, own_share, miss / tolerance, segment
        if of < 0:
            row[COMMON_MEASURES + (0 if share > 0.5 else 1) * SEGMENT_MEASURES + _MIC_LEFT] += weight
            row[_STRONGEST_LEFT] = max(row[_STRONGEST_LEFT], weight * total)
            continue
        first = COMMON_MEASURES + of * SEGMENT_MEASURES
        row[first + _EXPLAINED] += weight
        row[_NUMBER] += weight * log_number[number]
        row[_OWN_SHARE] += weight * gain
        row[_MISS] += weight * off * off
        if number < hypothesis[MODE_1 + of]:
            row[first + _BELOW] += weight


@part()
def _measure_peaks(
    row: Floats, hypothesis: Floats, peaks: Floats, spacing: Hertz, partials: Floats, length: Metres
) -> None:
    """Of all peaks that are no distortion, strong and weak: whether of a segment, or of the whole string.

    No condition on a peak can be predicted, so nothing branches on it.
    """
    x, own = hypothesis[POSITION], hypothesis[OPEN]
    per_hertz = (x / (own * length), (length - x) / (own * length), 1.0 / own)
    weight_1 = weight_2 = own_1 = own_2 = left = whole = 0.0
    for q in range(peaks.shape[0]):
        f, weight, share = peaks[q, FREQUENCY], peaks[q, WEIGHT], peaks[q, SHARE_1]
        tolerance = spacing + TOLERANCE_SHARE * f
        fits_1 = abs(f - partials[0, max(int(np.rint(f * per_hertz[0])), 1)]) < tolerance
        fits_2 = abs(f - partials[1, max(int(np.rint(f * per_hertz[1])), 1)]) < tolerance
        fits_whole = abs(f - partials[2, max(int(np.rint(f * per_hertz[2])), 1)]) < tolerance
        of_1 = weight * (fits_1 & ((share >= 0.5) | (not fits_2)))
        of_2 = weight * (fits_2 & ((share < 0.5) | (not fits_1)))
        weight_1 += of_1
        weight_2 += of_2
        own_1 += of_1 * share
        own_2 += of_2 * (1.0 - share)
        left += weight - of_1 - of_2
        whole += (weight - of_1 - of_2) * fits_whole
    row[_LEFT], row[_WHOLE] = left, whole
    row[COMMON_MEASURES + _PEAKS], row[COMMON_MEASURES + _PEAKS_SHARE] = weight_1, own_1
    other = COMMON_MEASURES + SEGMENT_MEASURES
    row[other + _PEAKS], row[other + _PEAKS_SHARE] = weight_2, own_2


@part()
def _measure_partials(
    row: Floats,
    mode: int,
    segment: int,
    sustained: Hertz,
    height: Floats,
    power: Floats,
    prominence: Floats,
    spacing: Hertz,
    partials: Floats,
) -> None:
    """Level at the own and at the other microphone, and prominence, of a segment's first partials.

    `partials` are the stiff ones, from 1 on. Where `mode`, which is sustained, divides their number, they are
    overwritten with multiples of the line.
    """
    last = power.shape[1] - 2
    for n in range(mode, min(PARTIALS + 1, partials.size), mode):
        partials[n] = sustained * n / mode
    own, other = segment, 1 - segment
    per_own, per_other = 1.0 / height[own, 0], 1.0 / height[other, 0]
    per_level = 1.0 / (np.log(10.0) * LEVEL_DECADES)
    for n in range(1, min(PARTIALS + 1, partials.size)):
        k = partials[n] / spacing
        if k >= last - 6 or partials[n] >= HIGHEST_PEAK:
            break
        half = 0.8 + TOLERANCE_SHARE * k
        low, high = max(int(k - half + 0.5), 1), min(int(k + half + 0.5), last)
        loudest = loudest_other = most = 0.0
        for q in range(low, high + 1):
            loudest, loudest_other = max(loudest, power[own, q]), max(loudest_other, power[other, q])
            most = max(most, prominence[0, q], prominence[1, q])
        row[3 * n - 3] = max(1.0 + np.log(loudest * per_own + 1.0e-12) * per_level, 0.0)
        row[3 * n - 2] = max(1.0 + np.log(loudest_other * per_other + 1.0e-12) * per_level, 0.0)
        row[3 * n - 1] = most


@part()
def _mark_tones(is_tone: Flags, sustained: tuple[Hertz, Hertz], spacing: Hertz) -> None:
    """Mark the bins (bins,) nearer than one bin to a sum or difference of multiples of the two lines."""
    is_tone[:] = False
    for p in range(TONES + 1):
        for q in range(-TONES, TONES + 1):
            k = int(abs(p * sustained[0] + q * sustained[1]) / spacing)
            if k + 1 < is_tone.size:
                is_tone[k] = is_tone[k + 1] = True


@part()
def _without_tones(peaks: Floats, is_tone: Flags, spacing: Hertz, others: Floats) -> tuple[int, float]:
    """Fill in the peaks that are no tones, weights as shares; return their count, and the tones' share."""
    total = peaks[:, WEIGHT].sum() + 1.0e-9
    count, tones = 0, 0.0
    for q in range(peaks.shape[0]):
        if is_tone[int(np.rint(peaks[q, FREQUENCY] / spacing))]:
            tones += peaks[q, WEIGHT] / total
            continue
        others[count, FREQUENCY], others[count, SHARE_1] = peaks[q, FREQUENCY], peaks[q, SHARE_1]
        others[count, WEIGHT] = peaks[q, WEIGHT] / total
        count += 1
    return count, tones


@part()
def _prominent_peaks(power: Floats, prominence: Floats, spacing: Hertz, string: StringModel) -> Floats:
    """Return the peaks (n, 3) of either microphone that stand out most; a weight is in decades."""
    bins = power.shape[1]
    peaks = np.zeros((MAX_PEAKS, 3))
    count = 0
    for k in range(max(int(0.8 * string.nominal / spacing), 3), min(int(HIGHEST_PEAK / spacing), bins - 3)):
        if max(prominence[0, k], prominence[1, k]) <= MIN_PROMINENCE:
            continue  # as most
        weight = 0.0
        for c in range(2):
            peak = power[c, k]
            below, above = max(power[c, k - 2], power[c, k - 1]), max(power[c, k + 1], power[c, k + 2])
            if prominence[c, k] > MIN_PROMINENCE and below <= peak and peak > above:
                weight = max(weight, prominence[c, k])
        if weight == 0.0:
            continue
        q = count if count < MAX_PEAKS else peaks[:, WEIGHT].argmin()
        if count == MAX_PEAKS and peaks[q, WEIGHT] >= weight:
            continue
        peaks[q, FREQUENCY], peaks[q, WEIGHT] = k * spacing, weight
        peaks[q, SHARE_1] = power[0, k] / (power[0, k] + power[1, k])
        count = min(count + 1, MAX_PEAKS)
    return peaks[:count]
