"""Where a touch is told to be: keys in time, and what they ask of the surface at one instant.

Between two keys position, force, clearance and speed run linearly. A force is turned into the depth at
which a string at rest would press back with it; the string then decides what force there really is.
"""

import numpy as np

from monochord.core.types import Floats
from monochord.physics.twin.part import called, part
from monochord.physics.twin.press import root_of_compression

TIME, POSITION, FORCE, CLEARANCE, ACROSS = range(5)
"""Columns of a key: s, m, N, m above the string at rest, and m/s across it."""
PLACE, LOAD, GAP, SPEED, DEPTH = range(5)
"""What is asked at one instant: the keys' columns but time, and the depth of the surface in m."""
STILL = 0.02
"""Clearance in m beyond which a touch is out of the string's reach."""


@called
def asked(keys: Floats, count: int, time: float, want: Floats) -> None:
    """Fill what the keys ask at a time, save the depth; before the first and after the last they hold."""
    i = 0
    while i < count and keys[i, TIME] <= time:
        i += 1
    if i in (0, count):
        last = min(i, count - 1)
        for c in range(4):
            want[c] = keys[last, c + 1]
        return
    share = (time - keys[i - 1, TIME]) / (keys[i, TIME] - keys[i - 1, TIME])
    for c in range(4):
        want[c] = keys[i - 1, c + 1] + share * (keys[i, c + 1] - keys[i - 1, c + 1])


@called
def between(table: Floats, share: float) -> float:
    """Return a value of a table over 0 to 1, linearly between its entries."""
    place = share * (table.size - 1)
    i = min(int(place), table.size - 2)
    return table[i] + (place - i) * (table[i + 1] - table[i])


@called
def cross_compliance(a: float, b: float, length: float, tension: float) -> float:
    """Return the deflection a newton at a of a flexible string at rest at b, in m/N."""
    return min(a, b) * (length - max(a, b)) / (tension * length)


@called
def depth_of(force: float, k1: float, k2: float, static: float, others: float, clearance: float) -> float:
    """Return the depth in m of a surface that presses with a force on a string of static compliance in m/N.

    `others` is the deflection that other touches cause there, in m.
    """
    s = root_of_compression(force, k1, k2)
    return s * s + static * force + others - clearance


@part
def drifted(start: float, rate: float, time: float, tension: float) -> float:
    """Return how far the tension is off its nominal value at a time, in N: a quarter of it at most."""
    most = 0.25 * tension
    return min(most, max(-most, start + rate * time))


@called
def geometric_rise(force: float, place: float, length: float, tension: float, stretch: float) -> float:
    """Return the rise of tension in N by a static press; see `monochord.physics.theory.geometric_tension`."""
    load = stretch * force * force * place * (length - place)
    w = np.sqrt(3.0 * load / (2.0 * length * length * tension**3))
    if w < 1e-9:
        return 0.0
    return tension * (w / (2.0 * np.sinh(np.arcsinh(1.5 * w) / 3.0)) - 1.0)
