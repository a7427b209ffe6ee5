"""Type aliases that state the unit of a number, and a few unit conversions.

All quantities in Monochord are in SI base units without a suffix; the alias in an annotation states the unit,
and errors quote it. Millimetres, milliseconds and decibels appear only in displays.
"""

import math
import sys
from typing import Annotated, Any, TypeAlias, TypeVar

Metres: TypeAlias = Annotated[float, "m"]
Seconds: TypeAlias = Annotated[float, "s"]
Hertz: TypeAlias = Annotated[float, "Hz"]
Newtons: TypeAlias = Annotated[float, "N"]
Pascals: TypeAlias = Annotated[float, "Pa"]
KilogramsPerMetre: TypeAlias = Annotated[float, "kg/m"]
MetresPerSecond: TypeAlias = Annotated[float, "m/s"]
NewtonSecondsPerSquareMetre: TypeAlias = Annotated[float, "N s/m^2"]
"""Damping of a string per unit length, in N s / m^2."""
Samples: TypeAlias = int
"""A number of sample frames, or an index on the sample clock."""
T = TypeVar("T")
NAN = object()
"""Marks a number in an annotation that may be NaN."""
OrNaN: TypeAlias = Annotated[T, NAN]
"""A number that is NaN where there is none: ``OrNaN[Metres]``."""
FINITE = sys.float_info.max
"""Largest finite number."""


def unit_of(kind: Any) -> str:
    """Return a space and the unit of an annotated type; an empty string for no unit.

    >>> unit_of(Metres), unit_of(float)
    (' m', '')
    """
    return "".join(f" {each}" for each in getattr(kind, "__metadata__", ()) if isinstance(each, str))


def cents(reference: Hertz, estimate: Hertz) -> float:
    """Return the musical interval from `reference` to `estimate` in cents (1200 per octave).

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
