"""How readings come over a wire: a delay that stays, jitter that does not, and some that never come."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Floats
from monochord.core.units import Seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A line to an instrument: every reading comes `delay` late and, on average, `jitter` more, in s.

    A share `lost` of them never comes. The jitter is exponential: never negative, and now and then long.
    """

    delay: Seconds = 0.0
    jitter: Seconds = 0.0
    lost: float = 0.0


def arrive(
    taken: Floats, line: Line, random: np.random.Generator, latest: Seconds = -np.inf
) -> tuple[NDArray[np.intp], Floats]:
    """Return which of the readings arrive, and when.

    Parameters
    ----------
    taken
        When the readings were taken, (n,) in s, rising.
    line
        What they come over.
    random
        Random numbers; two are drawn for every reading.
    latest
        When the last reading before these arrived: none overtakes another.

    Returns
    -------
    index
        Of those that come, (m,).
    arrival
        When they come, (m,) in s, never falling.

    Examples
    --------
    >>> index, arrival = arrive(np.array([0.0, 0.1]), Line(delay=0.02), np.random.default_rng(0))
    >>> index.tolist(), arrival.round(3).tolist()
    ([0, 1], [0.02, 0.12])
    """
    late, chance = random.exponential(size=len(taken)), random.uniform(size=len(taken))
    index = np.flatnonzero(chance >= line.lost)
    arrival = np.maximum.accumulate(np.maximum(latest, (taken + line.delay + line.jitter * late)[index]))
    return index, arrival
