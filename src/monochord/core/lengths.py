"""Lengths are in metres: a number far too large for one was given in another unit, and is asked back."""

import math
from contextlib import suppress
from numbers import Real
from typing import Any

from monochord.core.errors import InputError
from monochord.core.units import Metres

LONGEST: Metres = 5.0
"""Longest length of anything on a string: a piano's longest string has 2 m."""
INCH: Metres = 0.0254
LEAST_MILLIMETRES = 100.0
"""Below this, centimetres or inches may be meant as well."""


def refuse_other_units(**lengths: Any) -> None:
    """Raise `InputError` for a named length of more than 5 m, with the metres that may be meant.

    A value that is no number passes.

    >>> refuse_other_units(length=650)
    Traceback (most recent call last):
    monochord.core.errors.InputError: length 650 m: expected metres, 5 at most; did you mean 0.65?
    >>> refuse_other_units(length=25.5)
    Traceback (most recent call last):
    monochord.core.errors.InputError: ...; did you mean 0.0255 (from mm), 0.255 (from cm) or ...?
    """
    for name, length in lengths.items():
        with suppress(OverflowError):  # of a number beyond any, which is refused as such
            if isinstance(length, Real) and float(length) > LONGEST:
                given = f"{name.replace('_', ' ')} {float(length):g} m"
                raise InputError(given, f"metres, {LONGEST:g} at most", metres_meant(float(length)))


def metres_meant(length: float) -> str:
    """Return the question which length in m is meant by more than 5; empty for a length that may be in m.

    >>> metres_meant(650.0), metres_meant(0.65)
    ('did you mean 0.65?', '')
    """
    if not LONGEST < length < math.inf:
        return ""
    if length >= LEAST_MILLIMETRES:
        return f"did you mean {length / 1000.0:g}?"
    millimetres, centimetres, inches = (f"{unit * length:.4g}" for unit in (1e-3, 1e-2, INCH))
    return f"did you mean {millimetres} (from mm), {centimetres} (from cm) or {inches} (from inches)?"
