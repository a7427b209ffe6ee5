"""A stiff string by finite elements: an oracle that shares no formula with the twin's modes."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from scipy.linalg import eigh

from monochord.core.types import Floats, StringParams
from monochord.physics.theory import bending_stiffness


def beam_frequencies(
    string: StringParams,
    count: int,
    *,
    pins: tuple[float, ...] = (),
    springs: Mapping[float, float] | None = None,
    turning: Mapping[float, float] | None = None,
    element: float = 5e-4,
) -> Floats:
    """The lowest natural frequencies in Hz of a tensioned beam between hinges, by cubic Hermite elements.

    `pins` are places that stay at rest, `springs` stiffnesses in N/m and `turning` stiffnesses in N m/rad at
    places. Elements are `element` m long at most, which leaves errors of some 1e-6.
    """
    springs, turning = dict(springs or {}), dict(turning or {})
    marks = sorted({0.0, string.length, *pins, *springs, *turning})
    nodes = [0.0]
    for start, stop in pairwise(marks):
        nodes += np.linspace(start, stop, int(np.ceil((stop - start) / element)) + 1)[1:].tolist()
    places, size = np.array(nodes), 2 * len(nodes)
    stiff, mass = np.zeros((size, size)), np.zeros((size, size))
    for i, h in enumerate(np.diff(places)):
        own = slice(2 * i, 2 * i + 4)
        bend = np.array([[12, 6 * h, -12, 6 * h], [6 * h, 4 * h**2, -6 * h, 2 * h**2],
                         [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h**2, -6 * h, 4 * h**2]]) / h**3  # fmt: skip
        pull = np.array([[36, 3 * h, -36, 3 * h], [3 * h, 4 * h**2, -3 * h, -(h**2)],
                         [-36, -3 * h, 36, -3 * h], [3 * h, -(h**2), -3 * h, 4 * h**2]])  # fmt: skip
        load = np.array([[156, 22 * h, 54, -13 * h], [22 * h, 4 * h**2, 13 * h, -3 * h**2],
                         [54, 13 * h, 156, -22 * h], [-13 * h, -3 * h**2, -22 * h, 4 * h**2]])  # fmt: skip
        stiff[own, own] += bending_stiffness(string) * bend + string.tension / (30 * h) * pull
        mass[own, own] += string.linear_density * h / 420 * load

    def node(place: float) -> int:
        return int(np.argmin(np.abs(places - place)))

    for place, value in springs.items():
        stiff[2 * node(place), 2 * node(place)] += value
    for place, value in turning.items():
        stiff[2 * node(place) + 1, 2 * node(place) + 1] += value
    fixed = {0, size - 2, *(2 * node(place) for place in pins)}
    free = [i for i in range(size) if i not in fixed]
    squares = eigh(stiff[np.ix_(free, free)], mass[np.ix_(free, free)], eigvals_only=True,
                   subset_by_index=(0, count - 1))  # fmt: skip
    return np.sqrt(squares) / (2.0 * np.pi)
