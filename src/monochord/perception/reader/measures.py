"""The measures of a window that heads see: the network's outputs, the nearest pair of lines, and levels.

A line f at microphone 1 is mode n of its segment, so f / n is the segment's fundamental f1; likewise f2 at
microphone 2. Then the touch is at x = L f2 / (f1 + f2), and the open pitch under it is f1 f2 / (f1 + f2). The
pair nearest to the network's position refines it.
"""

import numpy as np
from numpy.typing import NDArray

from monochord.core.kernels import kernel, part
from monochord.core.types import Floats

PAIR_REACH, PAIR_WIDTH, MAX_MODE = 0.012, 0.004, 12.0
"""Largest and usual distance of a pair of lines from the densest position, over the length; largest mode."""
MIN_OPEN, MAX_OPEN = 0.965, 1.1
"""Open pitch under a touch, over the string's, that a pair of lines may have: what a give of 1e4 N/m at both
segments and a pitch of 1.5 % below the known one make of it, and a press of 8 N."""
NEAREST_END = 0.02
"""Smallest share of the length that is told from an end."""
DENSE_REACH, RIVAL_DISTANCE = 2, 6
"""Positions to either side of the densest that count as the same, and from which on another is a rival."""
LEAST = 1.0e-6
"""Added to probabilities before their logarithm."""
LEAST_OF_ODDS = 1.0e-3
"""Added to both probabilities of log odds before their logarithms: no window is surer than 1000 to 1."""
MIN_POWER = 1.0e-16
"""Added to powers before their logarithm."""
MAX_DETUNING, SAME_PITCH, MAX_PARTIAL, AUDIBLE = 0.04, 0.002, 8.0, 1.0e-3
"""Partials of the untouched string: largest share off, and largest disagreement, of those that are read;
largest number; least power over that of the strongest line."""
RUMBLE = np.array(((20.0, 150.0), (150.0, 500.0)))
"""Bands in Hz in which sliding and handling sound."""
VIEWS, APART, REACH_BINS = 5, 0.125, 6
"""Narrower views of a window by which a line's glide is measured, their distance as a share of the window,
and the bins to either side of a line that a view is made of."""
GLIDE_SCALE = 5.0e-3
"""Glide in 1/s up to which its column is linear."""
LINES = tuple(f"line {line} mic {mic}" for line in (1, 2) for mic in (1, 2))
TONES = ("1 + 2", "1 - 2", "2 x 1 - 2", "2 x 2 - 1", "2 x 1", "2 x 2", "3 x 1", "3 x 2")
COLUMNS = (
    *("place", "mass", "spread", "rival", "untouched"),
    *("position", "shift", "paired", "open", "mode 1", "mode 2"),
    *("rest", "agreement", "lowest", "lowest number", "held 1", "held 2"),
    *(f"level {line}" for line in LINES),
    *(f"tone {tone} mic {mic}" for tone in TONES for mic in (1, 2)),
    *(f"mic {mic} {what}" for what in ("level", "rumble 20 Hz", "rumble 150 Hz") for mic in (1, 2)),
    *("glide 1", "glide 2", "glide position", "glide pitch"),
)
"""Names of the measures in the order of `measure`."""
(PLACE, MASS, SPREAD, RIVAL, UNTOUCHED, POSITION, SHIFT, PAIRED, OPEN, MODE_1, MODE_2) = range(11)
(REST, AGREEMENT, LOWEST_PARTIAL, LOWEST_NUMBER, HELD_1, HELD_2, FIRST_LEVEL) = range(11, 18)
MICROPHONES, GLIDES = COLUMNS.index("mic 1 level"), COLUMNS.index("glide 1")


def _views() -> NDArray[np.complex128]:
    """Return the weights of the bins in each view, a Hann taper of half the window, (`VIEWS`, bins)."""
    bins = np.arange(-REACH_BINS, REACH_BINS + 1)
    taper = 0.5 * np.sinc(bins / 2.0) + 0.25 * (np.sinc(bins / 2.0 - 1.0) + np.sinc(bins / 2.0 + 1.0))
    centres = 0.5 + APART * (np.arange(VIEWS) - VIEWS // 2)
    return (taper * np.exp(2.0j * np.pi * centres[:, np.newaxis] * bins)).astype(np.complex128)


_VIEWS = _views()


@kernel()
def measure(
    logits: Floats,
    positions: Floats,
    samples: Floats,
    transform: NDArray[np.complex128],
    power: Floats,
    frequency: Floats,
    height: Floats,
    pitch: tuple[float, float, float],
) -> Floats:
    """Return the measures (`COLUMNS`,) of a window; positions are over the length, pitches in thousandths.

    - `place`, `mass`: the densest position, and the probability near it; `spread`: the density's entropy;
      `rival`: the highest probability elsewhere; `untouched`: logarithm of the probability of no touch.
    - `position`: of the pair of lines nearest to the place, else the place; `shift`: how far it is off the
      place; `paired`: whether there is a pair; `open`: its open pitch above the string's; both modes.
    - `rest`: the pitch above the string's on which most lines agree as partials of the untouched string;
      `agreement`: their share; `lowest`, `lowest number`: the same of the lowest partial; `held 1`, `held 2`:
      number of the strongest line at each microphone.
    - `level`, `tone`: log10 of the power at both lines, and at their combination tones, over the loudest.
    - `mic`: log10 of the mean square, and of the power in the bands `RUMBLE`.
    - `glide`: asinh of the speed at which both lines change, in 1/s over `GLIDE_SCALE`, and of how the
      position and the pitch change with them; 0 without a pair.

    Parameters
    ----------
    logits
        Of no touch and of `positions`, (1 + positions,).
    positions
        Positions over the length.
    samples, transform, power, frequency, height
        The window's spectrum; see `monochord.perception.spectrum.Spectrum`.
    pitch
        Distance of two bins and open frequency, in Hz, and inharmonicity B.
    """
    spacing, nominal, bending = pitch
    row = np.zeros(len(COLUMNS))
    _measure_partials(row, frequency, height, nominal, bending)
    _measure_microphones(row[MICROPHONES:], samples, power, spacing)
    _measure_place(row, logits, positions, transform, power, frequency, height, pitch)
    return row


@kernel()
def measured_again(
    measures: Floats,
    logits: Floats,
    positions: Floats,
    transform: NDArray[np.complex128],
    power: Floats,
    frequency: Floats,
    height: Floats,
    pitch: tuple[float, float, float],
) -> Floats:
    """Return the measures of the same window for other logits; arguments are as in `measure`."""
    row = measures.copy()
    row[:REST] = 0.0
    row[GLIDES:] = 0.0
    _measure_place(row, logits, positions, transform, power, frequency, height, pitch)
    return row


@kernel()
def touch_near(logits: Floats, positions: Floats, place: float, reach: float) -> tuple[float, float]:
    """Return the log odds of a touch, and the probability of one within reach of a place.

    Arguments are as in `measure`.
    """
    probability = np.exp(logits - logits.max())
    probability /= probability.sum()
    touched = np.log(probability[1:].sum() + LEAST_OF_ODDS) - np.log(probability[0] + LEAST_OF_ODDS)
    return touched, probability[1:][np.abs(positions - place) <= reach].sum()


@part()
def _measure_place(
    row: Floats,
    logits: Floats,
    positions: Floats,
    transform: NDArray[np.complex128],
    power: Floats,
    frequency: Floats,
    height: Floats,
    pitch: tuple[float, float, float],
) -> None:
    """Fill in all that depends on where something touches."""
    spacing, nominal, bending = pitch
    _measure_density(row, logits, positions)
    line_1, line_2 = _measure_pair(row, frequency, height, nominal, bending)
    _measure_levels(row, power, line_1 / spacing, line_2 / spacing)
    if row[PAIRED] > 0.0:
        _measure_glides(row[GLIDES:], transform, line_1, line_2, spacing, row[POSITION])


@part()
def _measure_microphones(row: Floats, samples: Floats, power: Floats, spacing: float) -> None:
    """Fill in the level of each microphone, and its power in the bands `RUMBLE`."""
    square_1 = square_2 = 0.0
    for i in range(samples.shape[1]):  # both in one loop: a sum in order waits for each of its terms
        square_1 += samples[0, i] ** 2
        square_2 += samples[1, i] ** 2
    for c, square in enumerate((square_1, square_2)):
        row[c] = np.log10(square / samples.shape[1] + 1.0e-12)
        for b in range(2):
            first, last = int(np.ceil(RUMBLE[b, 0] / spacing)), int(np.ceil(RUMBLE[b, 1] / spacing))
            row[2 + 2 * b + c] = np.log10(power[c, first:last].sum() + 1.0e-14)


@part()
def _measure_density(row: Floats, logits: Floats, positions: Floats) -> None:
    probability = np.exp(logits - logits.max())
    probability /= probability.sum()
    row[UNTOUCHED] = np.log(probability[0] + LEAST)
    density = probability[1:] / max(probability[1:].sum(), 1.0e-30)
    best = 0
    for k in range(density.size):
        near = density[max(k - DENSE_REACH, 0) : k + DENSE_REACH + 1].sum()
        if near > row[MASS]:
            row[MASS], best = near, k
        row[SPREAD] -= density[k] * np.log(density[k] + 1.0e-9)
    first, last = max(best - DENSE_REACH, 0), best + DENSE_REACH + 1
    row[PLACE] = (density[first:last] * positions[first:last]).sum() / row[MASS]
    for k in range(density.size):
        if abs(k - best) > RIVAL_DISTANCE:
            row[RIVAL] = max(row[RIVAL], density[k])


@part()
def _measure_pair(
    row: Floats, frequency: Floats, height: Floats, nominal: float, bending: float
) -> tuple[float, float]:
    """Fill in the loudest pair of lines near the place; return the lines' frequencies in Hz.

    Without a pair, these are the fundamentals of both segments at the place.
    """
    place, best = row[PLACE], -np.inf
    row[POSITION] = place
    line_1, line_2 = nominal / max(place, NEAREST_END), nominal / max(1.0 - place, NEAREST_END)
    for i in range(frequency.shape[1]):
        mode_1, one = _mode(frequency[0, i] / nominal, max(place, NEAREST_END), bending)
        if one == 0.0:
            continue
        for k in range(frequency.shape[1]):
            mode_2, two = _mode(frequency[1, k] / nominal, max(1.0 - place, NEAREST_END), bending)
            if two == 0.0:
                continue
            position, pitch = two / (one + two), one * two / (one + two)
            off = position - place
            if abs(off) >= PAIR_REACH or not MIN_OPEN < pitch < MAX_OPEN:
                continue
            score = np.log(height[0, i] * height[1, k]) - 0.5 * (off / PAIR_WIDTH) ** 2
            if score > best:
                best, line_1, line_2 = score, frequency[0, i], frequency[1, k]
                row[POSITION], row[SHIFT], row[PAIRED] = position, off, 1.0
                row[OPEN], row[MODE_1], row[MODE_2] = 1000.0 * (pitch - 1.0), mode_1, mode_2
    if row[PAIRED] > 0.0:  # the segments' stiffness, of the position now known
        one = line_1 / nominal / (row[MODE_1] * _stretch(row[MODE_1], row[POSITION], bending))
        two = line_2 / nominal / (row[MODE_2] * _stretch(row[MODE_2], 1.0 - row[POSITION], bending))
        row[POSITION], row[OPEN] = two / (one + two), 1000.0 * (one * two / (one + two) - 1.0)
    return line_1, line_2


@part()
def _mode(ratio: float, side: float, bending: float) -> tuple[float, float]:
    """Return the mode of a line in a segment, and the segment's flexible fundamental; 0 for none.

    `ratio` is the line over the open pitch, and `side` the segment over the length.
    """
    mode = max(np.round(ratio * side), 1.0)
    if ratio <= 0.0 or mode > MAX_MODE:
        return 0.0, 0.0
    return mode, ratio / (mode * _stretch(mode, side, bending))


@part()
def _stretch(mode: float, side: float, bending: float) -> float:
    """Return by what stiffness raises a partial of a segment, `side` over the length."""
    return np.sqrt(1.0 + bending * (mode / side) ** 2)


@part()
def _measure_partials(row: Floats, frequency: Floats, height: Floats, nominal: float, bending: float) -> None:
    count = frequency.shape[1]
    off, weight = np.zeros(2 * count), np.zeros(2 * count)
    lowest = MAX_PARTIAL + 1.0
    for c in range(2):
        for i in range(count):
            ratio = frequency[c, i] / nominal
            number = max(np.round(ratio), 1.0)
            share = ratio / (number * np.sqrt(1.0 + bending * number**2)) - 1.0
            if i == 0:
                row[HELD_1 + c] = number
            is_partial = ratio > 0.0 and number <= MAX_PARTIAL and abs(share) < MAX_DETUNING
            if not is_partial or height[c, i] < AUDIBLE * height[c, 0]:
                continue
            off[c * count + i], weight[c * count + i] = share, np.sqrt(height[c, i] / height[c, 0])
            if number < lowest:
                lowest = number
                row[LOWEST_PARTIAL], row[LOWEST_NUMBER] = 1000.0 * share, number
    total = weight.sum()
    for k in range(off.size):
        if weight[k] > 0.0:
            near = weight * (np.abs(off - off[k]) < SAME_PITCH)
            if near.sum() > row[AGREEMENT] * total:
                row[AGREEMENT] = near.sum() / total
                row[REST] = 1000.0 * (near * off).sum() / near.sum()


@part()
def _measure_levels(row: Floats, power: Floats, one: float, two: float) -> None:
    """Fill in the levels at both lines, in bins, and at their combination tones."""
    tones = np.array((one, two, one + two, one - two, 2.0 * one - two, 2.0 * two - one, 0.0, 0.0, 0.0, 0.0))
    tones[6:8], tones[8:] = 2.0 * tones[:2], 3.0 * tones[:2]
    loudest, at = -np.inf, FIRST_LEVEL
    for tone in np.abs(tones):
        k = min(max(int(np.round(tone)), 2), power.shape[1] - 3)
        for c in range(2):
            row[at] = np.log10(power[c, k - 1 : k + 2].max() + MIN_POWER)
            if at < FIRST_LEVEL + 4:
                loudest = max(loudest, row[at])
            at += 1
    row[FIRST_LEVEL:MICROPHONES] -= loudest


@part()
def _measure_glides(
    glides: Floats, transform: NDArray[np.complex128], one: float, two: float, spacing: float, position: float
) -> None:
    rate = np.zeros(2)
    for c, line in enumerate((one, two)):
        peak = int(np.round(line / spacing))
        if REACH_BINS < peak < transform.shape[1] - REACH_BINS:
            rate[c] = _glide(transform[c], peak, 1.0 / spacing) / line
    common = rate[0] * position + rate[1] * (1.0 - position)
    apart = (rate[1] - rate[0]) * position * (1.0 - position)
    for k, value in enumerate((rate[0], rate[1], apart, common)):
        glides[k] = np.arcsinh(abs(value) / GLIDE_SCALE)


@part()
def _glide(transform: NDArray[np.complex128], peak: int, window: float) -> float:
    """Return the change of a line's frequency in 1/s^2, from second differences of its phase."""
    seen = np.zeros(VIEWS, np.complex128)
    for v in range(VIEWS):
        for b in range(2 * REACH_BINS + 1):
            seen[v] += _VIEWS[v, b] * transform[peak - REACH_BINS + b]
    near = np.angle(seen[1] * seen[3] * (seen[2] * seen[2]).conjugate())
    far = np.angle(seen[0] * seen[4] * (seen[2] * seen[2]).conjugate())
    turns = np.round((4.0 * near - far) / (2.0 * np.pi))
    distance = 2.0 * APART * window
    return (far + 2.0 * np.pi * turns) / (2.0 * np.pi * distance**2)
