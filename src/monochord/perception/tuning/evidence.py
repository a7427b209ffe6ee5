"""Whether lasting lines come from a string, and not from a tone or a synthesised wave.

A reading (`read_tuning`) gives the pitch of the string that the lines would fit. A sine of the right pitch
fits a string too. Any one of three kinds of evidence shows that a string sounds:

- **its series**: the fundamental, the next two partials and one more;
- **free partials**: three or more partials that are not a sum, difference or multiple of stronger lines; or
  three partials with at least one that is faint or dies away, as after a pluck or a touch;
- **two ends**: a multiple of the driven line whose ratio of power between the microphones differs from the
  line's. The two ends of a string and their pickups differ with frequency. A tone played into both inputs has
  the same ratio at all of its multiples.

The evidence was measured on the twin (five presets, 171 builds and days, both worlds, 3 s each). It suffices
for all 335 sounds that the tuner reads from a pluck on or 0.35 s after a touch. It suffices for 313 of 322
sounds that the tuner reads 2 s or 12 s after the last touch; in the other 9, one partial and its multiples
remain. Two other sounds pass for a string: a wave with the string's fundamental and next partials, and a tone
that the microphones pick up differently.
"""

from math import gcd

import numpy as np

from monochord.core.reasons import Reason
from monochord.core.types import Flags, Floats
from monochord.core.units import Hertz
from monochord.perception.tuning.lines import (
    BALANCE,
    BALANCE_STD,
    GROWTH_STD,
    LAST_FREQUENCY,
    LAST_GROWTH,
    LAST_POWER_1,
    LAST_POWER_2,
    LAST_STD,
    PRESENCE,
)
from monochord.perception.tuning.reading import DISTORTION_ORDER, MAX_NUMBER, TOLERANCE

EVIDENCE_DECADES = 6.5
"""Decades of power below the strongest line down to which a line counts; a window's noise lies there."""
MAX_MULTIPLE = 40
"""Highest multiple of a line that is searched for; multiples above half the sample rate alias."""
MULTIPLE_TOLERANCE: Hertz = 0.3
"""Largest distance of a line from a multiple, in addition to the lines' errors; drivers drift by this
much."""
MIN_SERIES, MIN_PARTIALS = 4, 3
"""Fewest partials of a series from the fundamental on, and of a series without it."""
WEAK_DECADES = 3.0
"""Decades of power below the strongest line from which a partial is too faint to be played."""
MIN_DECAY, MIN_GROWTH_STD = 2.0, 0.5
"""Smallest rate in 1/s at which a partial dies away, and smallest standard error of a rate."""
MIN_BALANCE, BALANCE_DEVIATIONS, MIN_COUNT = 0.023, 6.0, 3
"""Smallest difference of two balances, in nepers of power (0.1 dB) and in standard errors; fewest windows."""


def reason_against_a_string(
    lines: Floats,
    frequency: Hertz,
    inharmonicity: float,
    *,
    sample_rate: int,
    windows: int,
    least_share: float,
) -> str:
    """Return why lasting lines may not come from a string; empty if they do.

    The `lines` (n, 9) are those of `windows` untouched windows, the strongest first, whose reading has the
    open `frequency` and the `inharmonicity` B. `least_share` is the smallest share of a partial's power at
    either microphone; 0 for a single microphone.

    >>> tone = np.array([[1005.0, 0.01, 1.0, 1.0, 1.0, 0.0, 0.01, 0.0, 0.01]])
    >>> reason_against_a_string(tone, 1005.0, 0.0, sample_rate=44100, windows=30, least_share=0.12)
    'one line at 1005.0 Hz, no other partial: it may be a tone'
    """
    power = lines[:, LAST_POWER_1] + lines[:, LAST_POWER_2]
    lines = lines[power > power.max(initial=0.0) * 10.0**-EVIDENCE_DECADES]
    numbers = _numbers(lines, frequency, inharmonicity, least_share)
    made = _made_of_stronger(lines, numbers, sample_rate)
    partials = {int(number) for number in numbers if number}
    free = {int(number) for number in numbers[~made] if number}
    growth, growth_std = lines[:, LAST_GROWTH], np.maximum(lines[:, GROWTH_STD], MIN_GROWTH_STD)
    dying = (numbers > 0) & (growth < -MIN_DECAY) & (growth < -3.0 * growth_std)
    dying[:1] = False
    if {1, 2, 3} <= partials and len(partials) >= MIN_SERIES:
        return Reason.NONE
    power = lines[:, LAST_POWER_1] + lines[:, LAST_POWER_2]
    weak = (numbers > 0) & ~made & (power < power.max(initial=0.0) * 10.0**-WEAK_DECADES)
    rings = dying.any() or weak.any() or len(free) >= MIN_PARTIALS
    if rings and len(partials) >= MIN_PARTIALS and gcd(*partials) == 1:
        return Reason.NONE
    if least_share > 0.0 and _shared_otherwise(lines, made, windows):
        return Reason.NONE
    if len(lines) - np.count_nonzero(made) <= 1:
        also = " and its exact multiples" if made.any() else ""
        return Reason.ONE_TONE.with_detail(float(lines[0, LAST_FREQUENCY]), also)
    found = ", ".join(map(str, sorted(partials)))
    lacking = "" if 1 in partials else "no fundamental and "
    return Reason.TONES.with_detail(found, lacking)


def _numbers(lines: Floats, frequency: Hertz, inharmonicity: float, least_share: float) -> Floats:
    """Return the number (n,) of the partial that each line lies at, at both microphones; 0 for none."""
    f, std = lines[:, LAST_FREQUENCY], lines[:, LAST_STD]
    numbers = np.maximum(np.rint(f / frequency), 1.0)
    partial = numbers * frequency * np.sqrt(1.0 + inharmonicity * numbers**2)
    near = np.abs(f - partial) < np.minimum(TOLERANCE * f + 3.0 * std, 0.25 * frequency)
    both = lines[:, [LAST_POWER_1, LAST_POWER_2]]
    near &= both.min(axis=1) >= least_share * both.sum(axis=1)
    return np.where(near & (numbers <= MAX_NUMBER), numbers, 0.0)


def _made_of_stronger(lines: Floats, numbers: Floats, sample_rate: int) -> Flags:
    """Return which lines (n,) are multiples of stronger partials, folded at half the sample rate, or sums."""
    made = np.zeros(len(lines), bool)
    orders = np.arange(1, MAX_MULTIPLE + 1)
    few = np.arange(1, DISTORTION_ORDER + 1)
    partials: list[tuple[float, float]] = []
    for i, (f, std) in enumerate(lines[:, [LAST_FREQUENCY, LAST_STD]].tolist()):
        reach = MULTIPLE_TOLERANCE + 3.0 * std
        for first, first_std in partials:
            folded = np.abs((orders * first + 0.5 * sample_rate) % sample_rate - 0.5 * sample_rate)
            made[i] |= bool(np.any(np.abs(f - folded) < reach + 3.0 * orders * first_std))
            for second, second_std in partials:
                p, q = few[:, np.newaxis], few
                for sign in (1.0, -1.0):
                    near = np.abs(f - np.abs(p * first + sign * q * second))
                    allowed = reach + 3.0 * (p * first_std + q * second_std)
                    made[i] |= second != first and bool(np.any(near < allowed))
        if not made[i] and numbers[i]:
            partials.append((f, std))
    return made


def _shared_otherwise(lines: Floats, made: Flags, windows: int) -> bool:
    """Return whether a multiple is shared between the microphones otherwise than the strongest line."""
    apart = np.abs(lines[:, BALANCE] - lines[0, BALANCE])
    std = np.hypot(lines[:, BALANCE_STD], lines[0, BALANCE_STD])
    often = np.rint(lines[:, PRESENCE] * windows) >= MIN_COUNT
    return bool(np.any(made & often & (apart > np.maximum(MIN_BALANCE, BALANCE_DEVIATIONS * std))))
