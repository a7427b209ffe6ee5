"""Type aliases that tell the unit of a number, and the few unit conversions of the field.

Inside Monochord every quantity is in SI base units and carries no suffix; the alias in its annotation
tells which. Millimetres, milliseconds and decibels appear only where a person reads them.
"""

import math
from typing import TypeAlias

Metres: TypeAlias = float
Seconds: TypeAlias = float
Hertz: TypeAlias = float
Newtons: TypeAlias = float
Pascals: TypeAlias = float
KilogramsPerMetre: TypeAlias = float
MetresPerSecond: TypeAlias = float
NewtonSecondsPerSquareMetre: TypeAlias = float
"""Damping of a string per unit length, in N s / m^2."""
Samples: TypeAlias = int
"""A count of sample frames, or an index on the sample clock."""


def cents(reference: Hertz, estimate: Hertz) -> float:
    """Return the musical interval from `reference` to `estimate` in cents (1200 an octave).

    >>> round(cents(440.0, 880.0), 9)
    1200.0
    """
    return 1200.0 * math.log2(estimate / reference)


def decibels(ratio: float) -> float:
    """Return an amplitude ratio in decibels; zero gives minus infinity.

    >>> round(decibels(10.0), 9)
    20.0
    """
    return 20.0 * math.log10(ratio) if ratio > 0.0 else -math.inf
