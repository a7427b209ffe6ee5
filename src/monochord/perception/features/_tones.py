"""Combination tones: what a touch that gives way unevenly makes of the two lines that it holds.

A Hertzian touch gives way by delta = c F^(2/3), the less the harder it is pressed already. Lines that pull at
it with F1 and F2 thus move it at sums and differences of their frequencies too. To second order the tone at
f1 + f2 or f1 - f2 moves it by u = -delta'' F1 F2 / 2 = F1 F2 / (6 K F), where K = 3 F / (2 delta) is the
stiffness of the touch; that at 2 f1 by F1^2 / (12 K F). So T / (K F) is heard: the length T / K by which a
touch lengthens each segment, a newton of force. To third order the tone at 2 f1 + f2 is F1 / (3 F) times
that at f1 + f2, whatever the object is made of.

A displacement u of the touch at wave number k pulls at the ends with T k u / sin(k x) and T k u / sin(k (L -
x)), which is how u is told from both microphones.

Hertz (1881), On the contact of elastic solids; stiff wave numbers, Fletcher (1964). The rest is derived here.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz, Metres, Newtons, Samples

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
"""Names of the numbers: a and b are the lines held in segment 1 and in segment 2."""
GIVES, THIRDS, SIDES = slice(2, 6), slice(6, 10), slice(10, 12)
TIMES = np.array(
    [[1, 0], [0, 1], [2, 0], [0, 2], [1, 1], [1, -1], [2, 1], [2, -1], [1, 2], [-1, 2]], np.float64
)
"""How often either line goes into a tone."""
SUM = 4
"""The tone a + b, in `TIMES` as in `COLUMNS`."""
LEAST = 1.0e-4
"""Least push in N."""
LOW, HIGH = -5.0, 2.0
"""Least and largest logarithms of what gives way, in mm/N."""
MOST_THIRD = 3.0
SIDES_FROM, SIDES_TO = 3, 9
"""Bins from a tone between which its sidebands are."""
LEAST_SIDE = 1.0e-5
QUIET = 1.0e-13
"""Power that counts as none at all, in full scale."""
FIRM: Newtons = 0.3
"""Least force of the touches from which it is told how far objects of one kind give way."""
LEAST_FORCE: Newtons = 0.1
"""Lighter touches count as this one where another object is thought of."""


@numba.njit(cache=True, error_model="numpy")
def tones(
    plain: NDArray[np.complex128],
    power: Floats,
    size: Samples,
    spacing: Hertz,
    held: tuple[Hertz, Hertz, Metres],
    string: tuple[Metres, Hertz, float, Newtons],
    ears: tuple[float, float],
) -> Floats:
    """Return the numbers of `COLUMNS` (12,); all 0 where nothing is held.

    Pushes: log10 of the amplitude in N of both lines' force on the touch. Gives: log10 of T / (K F) in mm/N
    as each tone of second order tells it. Thirds: log10 of 1 / (3 F) in 1/N as those of third order do.
    Sides: log10 of the power beside a tone over its own.

    Parameters
    ----------
    plain, power
        Transform without a taper and Hann power, (2, bins), of `size` frames, bins `spacing` apart.
    held
        Lines in segment 1 and segment 2 in Hz, and the touch's place in m.
    string
        Length in m, open frequency in Hz, stiffness beta in m^2 and tension in N.
    ears
        Share of its own end's force that a microphone hears, and full scale a newton.
    """
    told = np.zeros(12)
    a, b, x = held
    length, nominal, beta, tension = string
    if a <= 0.0 or b <= 0.0 or x <= 0.0:
        return told
    moved, pull = np.zeros(TIMES.shape[0]), np.zeros(2)
    own, gain = ears
    for t in range(TIMES.shape[0]):
        frequency = abs(TIMES[t, 0] * a + TIMES[t, 1] * b)
        k = int(np.rint(frequency / spacing))
        if k <= SIDES_TO or k >= power.shape[1] - SIDES_TO:
            continue
        off = frequency / spacing - k
        first, second = _amplitude(plain[0], k, off, size), _amplitude(plain[1], k, off, size)
        near = (own * first - (1.0 - own) * second) / ((2.0 * own - 1.0) * gain)
        far = (own * second - (1.0 - own) * first) / ((2.0 * own - 1.0) * gain)
        if t < 2:
            pull[t] = abs(near) if t == 0 else abs(far)
            continue
        square = (frequency / (2.0 * length * nominal)) ** 2 * (2.0 * np.pi) ** 2
        wave = np.sqrt(2.0 * square / (1.0 + np.sqrt(1.0 + 4.0 * beta / np.pi**2 * square)))
        # The ends' compliances: what a newton at an end tells of the touch's way.
        left, right = np.sin(wave * x) / (tension * wave), np.sin(wave * (length - x)) / (tension * wave)
        whole = left * left + right * right
        moved[t] = abs(near * left * right * right + far * right * left * left) / (whole + 1e-30)
    f1, f2 = pull[0] + LEAST, pull[1] + LEAST
    told[0], told[1] = np.log10(f1), np.log10(f2)
    order = np.array([12.0 / (f1 * f1), 12.0 / (f2 * f2), 6.0 / (f1 * f2), 6.0 / (f1 * f2)])
    for i in range(4):
        way = 1000.0 * tension * order[i] * moved[2 + i]
        told[2 + i] = min(max(np.log10(way + 10.0**LOW), LOW), HIGH)
        over = moved[SUM] * (f1 if i < 2 else f2)
        share = np.log10((moved[6 + i] + 1e-15) / (over + 1e-15))
        told[6 + i] = min(max(share, -MOST_THIRD), MOST_THIRD)
    told[10] = _side(power, abs(a + b), spacing)
    told[11] = _side(power, 2.0 * a + b, spacing)
    return told


@numba.njit(cache=True, error_model="numpy")
def _amplitude(plain: NDArray[np.complex128], k: int, off: float, size: Samples) -> complex:
    """Return the amplitude of a tone `off` bins above bin k, but for a phase that all channels share."""
    value = 0.5 * plain[k] - 0.25 * (plain[k - 1] + plain[k + 1])
    taper = 0.5 if off == 0.0 else 0.5 * np.sin(np.pi * off) / (np.pi * off * (1.0 - off * off))
    return 2.0 * value / (size * taper)


@numba.njit(cache=True, error_model="numpy")
def _side(power: Floats, frequency: Hertz, spacing: Hertz) -> float:
    k = int(np.rint(frequency / spacing))
    if k <= SIDES_TO or k >= power.shape[1] - SIDES_TO:
        return 0.0
    line = side = QUIET
    for c in range(power.shape[0]):
        line += power[c, k - 1 : k + 2].sum()
        side += power[c, k - SIDES_TO + 1 : k - SIDES_TO + 7].sum()
        side += power[c, k + SIDES_FROM : k + SIDES_TO].sum()
    return np.log10((side + LEAST_SIDE * line) / line)


def given(told: Audio, force: Floats) -> float:
    """Return by how many mm a newton makes each segment longer, as the tones (n, 12) of clear touches tell.

    The length goes with F^(-1/3) (Hertz), so that other forces (n,) count too; 0 where no touch is clear.
    """
    clear = (told[:, SIDES.start] < -1.0) & (force > FIRM)
    if not clear.any():
        return 0.0
    sum_tone = told[clear, SUM].astype(np.float64)
    return float(np.median(10.0**sum_tone * force[clear] ** (4.0 / 3.0)))


def as_if(told: Audio, force: Floats, share: Floats) -> Audio:
    """Return tones (n, 12) as they would be if the objects gave way by `share` (n,) of what they do.

    Tones of second order, and that part of those of third order that a touch of this force makes, go with
    it; what is noise, and what the drivers distort, stays.
    """
    found = told.astype(np.float64)
    level = 10.0 ** found[:, SIDES]
    clear = 1.0 / (1.0 + level)
    second = clear[:, 0] * share + 1.0 - clear[:, 0]
    found[:, GIVES] = np.clip(found[:, GIVES] + np.log10(second)[:, np.newaxis], LOW, HIGH)
    third = 10.0 ** found[:, THIRDS]
    own = np.minimum(third, 1.0 / (3.0 * np.maximum(force, LEAST_FORCE)[:, np.newaxis]))
    kept = (own * second[:, np.newaxis] + third - own) / third
    found[:, THIRDS] += np.log10(kept / second[:, np.newaxis])
    found[:, THIRDS] = np.clip(found[:, THIRDS], -MOST_THIRD, MOST_THIRD)
    found[:, SIDES] -= 2.0 * np.log10(np.stack((second, kept[:, 0]), axis=1))
    return found.astype(np.float32)
