"""Combination tones: what a touch whose compliance depends on force makes of the two sustained lines.

A Hertzian touch is indented by delta = c F^(2/3), so it is the stiffer the harder it is pressed. Lines that
pull at it with F1 and F2 thus move it at sums and differences of their frequencies too. To second order the
tone at f1 + f2 or f1 - f2 moves it by u = -delta'' F1 F2 / 2 = F1 F2 / (6 K F), where K = 3 F / (2 delta) is
the stiffness of the touch; that at 2 f1 by F1^2 / (12 K F). So T / (K F) can be measured: the length T / K by
which a touch lengthens each segment, for each newton of force. To third order the tone at 2 f1 + f2 is
F1 / (3 F) times that at f1 + f2, whatever the object is made of.

A displacement u of the touch at wave number k pulls at the ends with T k u / sin(k x) and T k u / sin(k (L -
x)), so both microphones together give u.

Hertz (1881), On the contact of elastic solids; stiff wave numbers, Fletcher (1964). The rest is derived here.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monochord.core.kernels import kernel, part
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, Metres, Newtons, Samples
from monochord.perception.closed_form.modes import StringModel
from monochord.perception.features._harmonics import (
    MIN_POWER,
    MIN_SIDEBAND_SHARE,
    SIDEBAND_END,
    SIDEBAND_FIRST,
)

COLUMNS = (
    "push 1",
    "push 2",
    "give 2 a",
    "give 2 b",
    "give a + b",
    "give a - b",
    "third 2 a + b",
    "third 2 a - b",
    "third 2 b + a",
    "third 2 b - a",
    "side a + b",
    "side 2 a + b",
)
"""Names of the columns; a and b are the lines sustained in segment 1 and in segment 2."""
PUSH_1, PUSH_2, SUM_TONE = 0, 1, 4
COMPLIANCES, THIRDS, SIDES = slice(2, 6), slice(6, 10), slice(10, 12)
"""Columns of tones of second and of third order, and of sidebands."""
MULTIPLES = np.array(
    [[1, 0], [0, 1], [2, 0], [0, 2], [1, 1], [1, -1], [2, 1], [2, -1], [1, 2], [-1, 2]], np.float64
)
"""Multiples of both lines in each tone, in the order of `COLUMNS`."""
MIN_PUSH: Newtons = 1.0e-4
"""Least amplitude of a line's force on the touch."""
MIN_LOG_COMPLIANCE, MAX_LOG_COMPLIANCE = -5.0, 2.0
"""Range of log10 of T / (K F) in mm/N."""
MAX_LOG_THIRD = 3.0
"""Largest size of log10 of a third-order tone's ratio to the sum tone."""
MAX_CLEAR_SIDE = -1.0
"""Largest log10 of sidebands over line at which a sum tone is clear enough to measure compliance."""
CLEAR_FORCE: Newtons = 0.3
"""Least force of touches from which compliance is measured."""
MIN_FORCE: Newtons = 0.1
"""Least force that compliance is scaled with; lighter touches count as this one."""


class Microphones(NamedTuple):
    """Share of its own end's force in each microphone's signal, above 0.5, and full scale a newton."""

    own: float
    gain: float


@kernel()
def combination_tones(
    transform: NDArray[np.complex128],
    power: Floats,
    size: Samples,
    spacing: Hertz,
    sustained: tuple[Hertz, Hertz, Metres],
    string: StringModel,
    tension: Newtons,
    microphones: Microphones,
) -> Floats:
    """Return the columns of `COLUMNS` (12,); all 0 where no line is sustained.

    Pushes: log10 of the amplitude in N of both lines' force on the touch. Gives: log10 of T / (K F) in mm/N
    from each tone of second order. Thirds: log10 of 1 / (3 F) in 1/N from those of third order. Sides: log10
    of the power beside a tone over its own.

    Parameters
    ----------
    transform, power
        Transform without a taper and Hann power, (2, bins), of `size` frames, bins `spacing` apart.
    sustained
        Lines in segment 1 and segment 2 in Hz, and the position of the touch in m.
    string, tension
        The string, and its tension in N.
    microphones
        How the microphones mix the forces at both ends.
    """
    columns = np.zeros(12)
    a, b, x = sustained
    length, beta = string.length, string.stiffness
    if a <= 0.0 or b <= 0.0 or x <= 0.0:
        return columns
    displacement, pull = np.zeros(MULTIPLES.shape[0]), np.zeros(2)
    own, gain = microphones.own, microphones.gain
    for t in range(MULTIPLES.shape[0]):
        frequency = abs(MULTIPLES[t, 0] * a + MULTIPLES[t, 1] * b)
        k = int(np.rint(frequency / spacing))
        if k <= SIDEBAND_END or k >= power.shape[1] - SIDEBAND_END:
            continue
        off = frequency / spacing - k
        first, second = _amplitude(transform[0], k, off, size), _amplitude(transform[1], k, off, size)
        near = (own * first - (1.0 - own) * second) / ((2.0 * own - 1.0) * gain)
        far = (own * second - (1.0 - own) * first) / ((2.0 * own - 1.0) * gain)
        if t < 2:
            pull[t] = abs(near) if t == 0 else abs(far)
            continue
        square = (frequency / (2.0 * length * string.nominal)) ** 2 * (2.0 * np.pi) ** 2
        wave = np.sqrt(2.0 * square / (1.0 + np.sqrt(1.0 + 4.0 * beta / np.pi**2 * square)))
        # Displacement of the touch for each newton at an end.
        left, right = np.sin(wave * x) / (tension * wave), np.sin(wave * (length - x)) / (tension * wave)
        total = left * left + right * right
        displacement[t] = abs(near * left * right * right + far * right * left * left) / (total + 1e-30)
    f1, f2 = pull[0] + MIN_PUSH, pull[1] + MIN_PUSH
    columns[PUSH_1], columns[PUSH_2] = np.log10(f1), np.log10(f2)
    order = np.array([12.0 / (f1 * f1), 12.0 / (f2 * f2), 6.0 / (f1 * f2), 6.0 / (f1 * f2)])
    for i in range(4):
        compliance = 1000.0 * tension * order[i] * displacement[2 + i]
        logarithm = np.log10(compliance + 10.0**MIN_LOG_COMPLIANCE)
        columns[2 + i] = min(max(logarithm, MIN_LOG_COMPLIANCE), MAX_LOG_COMPLIANCE)
        expected = displacement[SUM_TONE] * (f1 if i < 2 else f2)
        ratio = np.log10((displacement[6 + i] + 1e-15) / (expected + 1e-15))
        columns[6 + i] = min(max(ratio, -MAX_LOG_THIRD), MAX_LOG_THIRD)
    columns[10] = _side(power, abs(a + b), spacing)
    columns[11] = _side(power, 2.0 * a + b, spacing)
    return columns


@part()
def _amplitude(transform: NDArray[np.complex128], k: int, off: float, size: Samples) -> complex:
    """Return the amplitude of a tone `off` bins above bin k, but for a phase that all channels share."""
    value = 0.5 * transform[k] - 0.25 * (transform[k - 1] + transform[k + 1])
    taper = 0.5 if off == 0.0 else 0.5 * np.sin(np.pi * off) / (np.pi * off * (1.0 - off * off))
    return 2.0 * value / (size * taper)


@part()
def _side(power: Floats, frequency: Hertz, spacing: Hertz) -> float:
    """Return log10 of the power of a line's sidebands over its own, over all channels."""
    k = int(np.rint(frequency / spacing))
    if k <= SIDEBAND_END or k >= power.shape[1] - SIDEBAND_END:
        return 0.0
    line = side = MIN_POWER
    for c in range(power.shape[0]):
        line += power[c, k - 1 : k + 2].sum()
        side += power[c, k - SIDEBAND_END + 1 : k - SIDEBAND_END + 7].sum()
        side += power[c, k + SIDEBAND_FIRST : k + SIDEBAND_END].sum()
    return np.log10((side + MIN_SIDEBAND_SHARE * line) / line)


def lengthening(tones: Audio, force: Floats) -> float:
    """Return by how many mm 1 N lengthens each segment, as the median of clear touches.

    The length goes with F^(-1/3) (Hertz), so that other forces count too; 0 where no touch is clear.

    Parameters
    ----------
    tones
        Columns of touched windows, (n, 12).
    force
        Their forces in N, (n,).
    """
    clear = (tones[:, SIDES.start] < MAX_CLEAR_SIDE) & (force > CLEAR_FORCE)
    if not clear.any():
        return 0.0
    sum_tone = tones[clear, SUM_TONE].astype(np.float64)
    return float(np.median(10.0**sum_tone * force[clear] ** (4.0 / 3.0)))


def with_compliance(tones: Audio, force: Floats, share: Floats) -> Audio:
    """Return columns (n, 12) as of objects whose compliance is `share` (n,) of the actual one.

    Tones of second order, and the part of those of third order that a touch of this force (n,) makes, are
    scaled; noise, and distortion by the drivers, stay.
    """
    columns = tones.astype(np.float64)
    clear = 1.0 / (1.0 + 10.0 ** columns[:, SIDES])
    second = clear[:, 0] * share + 1.0 - clear[:, 0]
    columns[:, COMPLIANCES] = np.clip(
        columns[:, COMPLIANCES] + np.log10(second)[:, np.newaxis], MIN_LOG_COMPLIANCE, MAX_LOG_COMPLIANCE
    )
    third = 10.0 ** columns[:, THIRDS]
    contact_part = np.minimum(third, 1.0 / (3.0 * np.maximum(force, MIN_FORCE)[:, np.newaxis]))
    scaled = (contact_part * second[:, np.newaxis] + third - contact_part) / third
    columns[:, THIRDS] += np.log10(scaled / second[:, np.newaxis])
    columns[:, THIRDS] = np.clip(columns[:, THIRDS], -MAX_LOG_THIRD, MAX_LOG_THIRD)
    columns[:, SIDES] -= 2.0 * np.log10(np.stack((second, scaled[:, 0]), axis=1))
    return columns.astype(np.float32)
