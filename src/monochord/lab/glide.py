"""How a robot covers a way: it speeds up evenly, keeps its speed, and slows down evenly to rest."""

from math import ceil

from monochord.core.errors import InputError
from monochord.core.units import Metres, MetresPerSecond, Seconds

ACCELERATION = 1.5
"""Of the robot's tool, in m/s^2: assumed, within what a seven-axis arm of 14 kg payload can do."""
PIECES = 4
"""Into how many straight pieces a change of speed is cut."""
LONGEST: Metres = 4e-3
"""Longest straight piece at full speed: along the string, the depth of a press is kept at its ends only."""


def glide(
    way: Metres, speed: MetresPerSecond, *, acceleration: float = ACCELERATION
) -> list[tuple[Seconds, Metres, MetresPerSecond]]:
    """Return points of a move from rest to rest: time, way gone and speed there, the start left out.

    The speed is a trapezoid over time, a triangle where the way is too short for the full speed. Each slope
    is cut into `PIECES` of equal time, the stretch between them into pieces of `LONGEST` at most: the speed
    is exact between the points too, the way at the points.

    Parameters
    ----------
    way
        In m, more than 0.
    speed
        Highest speed in m/s, more than 0.
    acceleration
        In m/s^2, up and down.

    Raises
    ------
    InputError
        If one of them is not above 0.

    Examples
    --------
    >>> points = glide(0.03, 0.03)
    >>> [round(value, 4) for value in points[-1]]
    [1.02, 0.03, 0.0]
    >>> max(pace for _, _, pace in glide(0.001, 0.2)) < 0.04
    True
    """
    if not (way > 0.0 and speed > 0.0 and acceleration > 0.0):
        raise InputError(f"a move of {way:g} m at {speed:g} m/s", "more than 0 each")
    top = min(speed, (way * acceleration) ** 0.5)
    rise = top / acceleration
    slope = 0.5 * top * rise
    flat = (way - 2.0 * slope) / top
    points: list[tuple[Seconds, Metres, MetresPerSecond]] = []
    for i in range(1, PIECES + 1):
        share = i / PIECES
        points.append((share * rise, share**2 * slope, share * top))
    if flat > 1e-9:
        cuts = ceil(flat * top / LONGEST)
        points += [(rise + i / cuts * flat, slope + i / cuts * flat * top, top) for i in range(1, cuts + 1)]
    end = points[-1][0]
    for i in range(1, PIECES + 1):
        left = 1.0 - i / PIECES
        points.append((end + (1.0 - left) * rise, way - left**2 * slope, left * top))
    return points
