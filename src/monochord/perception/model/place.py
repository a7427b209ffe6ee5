"""Whether a position can be stated: inside the sensing range, and consistent with the spectral lines.

A network that was trained on positions inside the sensing range estimates a position inside the range for
every touch. The lines at both microphones, read as modes of two segments
(`monochord.perception.closed_form.modes`), give a position from physics along the whole string. If this
position is clear and differs from the network's, the network's position is withheld.
"""

import math
from typing import NamedTuple

from monochord.core.types import OUTSIDE_RANGE
from monochord.core.units import Metres

PLACE, LEAD = "ratio place", "ratio lead"
"""Columns of a feature with the position from the lines, as a share of the length, and its log odds."""
CONTRADICTED = "two candidates"
"""The reason if the lines clearly give another position inside the sensing range."""
MIN_LEAD = 2.0
"""Smallest log odds at which a position from the lines counts: about 7 to 1."""
MAX_DEVIATIONS = 5.0
"""Number of standard errors from the estimate within which the lines agree with it."""
MIN_DISAGREEMENT: Metres = 2e-3
"""Smallest distance of two positions that counts as a contradiction."""
EDGE_DEVIATIONS = 2.0
"""Number of standard errors by which the estimate of a touch at an end of the range may lie outside."""
MAX_EDGE: Metres = 1e-3
"""Largest distance outside the range for an estimate within `EDGE_DEVIATIONS`."""
REACH_DEVIATIONS = 4.0
"""Number of standard errors around an estimate that may reach outside the range, by at most one largest
standard error that the model states."""


class PlaceByLines(NamedTuple):
    """The position from a window's lines, in m from pickup 1, and its log odds."""

    place: Metres
    lead: float


NO_PLACE = PlaceByLines(math.nan, -math.inf)


def withheld_reason(
    place: Metres, std: Metres, lines: PlaceByLines, sensing_range: tuple[Metres, Metres] | None
) -> str:
    """Return why an estimated position is withheld; empty if it can be stated.

    Parameters
    ----------
    place, std
        The estimate and its standard error, in m.
    lines
        The position from the window's lines; `NO_PLACE` if they give none.
    sensing_range
        The positions that the sensor can estimate, in m; None for the whole string.

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
    """Return whether the error of a position inside the sensing range may reach far outside the range.

    "Far" is more than `max_std`, the largest standard error that the model states. All lengths are in m.

    >>> [may_be_outside(0.0513, std, 2e-3, (0.05, 0.15)) for std in (3e-4, 1.9e-3)]
    [False, True]
    """
    return not _is_inside(place, sensing_range, max_std - REACH_DEVIATIONS * std)


def _is_inside(place: Metres, sensing_range: tuple[Metres, Metres] | None, edge: Metres) -> bool:
    return sensing_range is None or sensing_range[0] - edge <= place <= sensing_range[1] + edge
