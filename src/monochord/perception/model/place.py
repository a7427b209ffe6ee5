"""Whether the place of a touch can be stated: inside the sensing range, and not against the lines.

A network that has learned places inside the sensing range alone answers inside it wherever it is touched. The
lines of both microphones, read as modes of two segments (`monochord.perception.closed_form.modes`), tell a
place by physics, along the whole string. Where that place is clear and another one than the network's, the
network is not believed.
"""

import math
from typing import NamedTuple

from monochord.core.types import OUTSIDE_RANGE
from monochord.core.units import Metres

PLACE, LEAD = "ratio place", "ratio lead"
"""Columns of a feature that hold the place by the lines, over the length, and the logarithm of its odds."""
CONTRADICTED = "two candidates"
"""The reason where the lines clearly tell another place inside the sensing range."""
MIN_LEAD = 2.0
"""Least logarithm of the odds of a place by the lines that counts against another one: some 7 to 1."""
MAX_DEVIATIONS = 5.0
"""Standard errors of the stated place by which the lines may contradict it."""
MIN_DISAGREEMENT: Metres = 2e-3
"""Least distance of both places that is a contradiction."""
EDGE_DEVIATIONS = 2.0
"""Standard errors by which an estimate may lie beyond an end of the range, as that of a touch there does."""
MAX_EDGE: Metres = 1e-3
"""Largest distance beyond the end that these may be."""
REACH_DEVIATIONS = 4.0
"""Standard errors about a place that may reach beyond an end, by no more than the largest one stated."""


class PlaceByLines(NamedTuple):
    """The place that a window's lines tell, in m from pickup 1, and the logarithm of its odds."""

    place: Metres
    lead: float


NO_PLACE = PlaceByLines(math.nan, -math.inf)


def withheld_reason(
    place: Metres, std: Metres, lines: PlaceByLines, sensing_range: tuple[Metres, Metres] | None
) -> str:
    """Return why an estimated place cannot be stated, or an empty string.

    Parameters
    ----------
    place, std
        The estimate and its standard error, in m.
    lines
        What the lines of the window tell; `NO_PLACE` where they tell nothing.
    sensing_range
        Where a place can be told, in m; None for the whole string.

    Examples
    --------
    >>> withheld_reason(0.147, 3e-4, PlaceByLines(0.1598, 10.0), (0.05, 0.15))
    'outside the sensing range'
    >>> withheld_reason(0.147, 3e-4, PlaceByLines(0.120, 10.0), (0.05, 0.15))
    'two candidates'
    >>> withheld_reason(0.147, 3e-4, PlaceByLines(0.1471, 10.0), (0.05, 0.15))
    ''
    """
    edge = min(EDGE_DEVIATIONS * std, MAX_EDGE)
    if not _is_inside(place, sensing_range, edge):
        return OUTSIDE_RANGE
    if lines.lead < MIN_LEAD or abs(lines.place - place) <= max(MAX_DEVIATIONS * std, MIN_DISAGREEMENT):
        return ""
    return CONTRADICTED if _is_inside(lines.place, sensing_range, edge) else OUTSIDE_RANGE


def may_be_outside(
    place: Metres, std: Metres, max_std: Metres, sensing_range: tuple[Metres, Metres] | None
) -> bool:
    """Return whether the error of a place inside the sensing range, in m, reaches well outside it.

    "Well" is further than the largest standard error that the model states, `max_std`.

    >>> [may_be_outside(0.0513, std, 2e-3, (0.05, 0.15)) for std in (3e-4, 1.9e-3)]
    [False, True]
    """
    return not _is_inside(place, sensing_range, max_std - REACH_DEVIATIONS * std)


def _is_inside(place: Metres, sensing_range: tuple[Metres, Metres] | None, edge: Metres) -> bool:
    return sensing_range is None or sensing_range[0] - edge <= place <= sensing_range[1] + edge
