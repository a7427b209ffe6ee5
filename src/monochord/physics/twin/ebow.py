"""The EBow: what one coil hears of the string is filtered, amplified and pushed back by another.

The sense coil gives the string's velocity, a two-pole band filter its band, and the drive coil pushes with
F = F_max tanh(g y / F_max) (after Heet 1978: feedback through sense and drive coil). The filter is the
trapezoidal state-variable one (Zavalishin 2012), and the force held over a sample is that of its middle,
extrapolated.
"""

from monochord.core.types import Floats
from monochord.physics.twin.memory import GATE
from monochord.physics.twin.part import part

WARP, DAMP, GAIN, LIMIT, SCALE = range(5)
"""Parameters: g = tan(pi f / rate), k = 1 / Q, gain over limit in s/m, limit in N, and 1 / (1 + g (g +
k))."""
FIRST, SECOND, BEFORE = range(3)
"""Memory: the two states of the filter and its last output, then `GATE`."""


@part
def saturated(x: float) -> float:
    """Return tanh(x) to 2e-7, and to 6e-4 beyond 8: two halves of its continued fraction (Lambert 1768)."""
    half = 0.5 * min(20.0, max(-20.0, x))
    y = half * half
    t = half * (10395.0 + y * (1260.0 + 21.0 * y)) / (10395.0 + y * (4725.0 + y * (210.0 + y)))
    return 2.0 * t / (1.0 + t * t)


@part
def drive(ebow: Floats, memory: Floats, velocity: float) -> float:
    """Return the force in N held over the next sample, given the velocity at the sense coil in m/s."""
    g, k = ebow[WARP], ebow[DAMP]
    high = (velocity - (k + g) * memory[FIRST] - memory[SECOND]) * ebow[SCALE]
    band = g * high + memory[FIRST]
    low = g * band + memory[SECOND]
    memory[FIRST] = g * high + band
    memory[SECOND] = g * band + low
    heard = k * band
    ahead = 1.5 * heard - 0.5 * memory[BEFORE]
    memory[BEFORE] = heard
    limit = ebow[LIMIT]
    if limit <= 0.0 or memory[GATE] <= 0.0:
        return 0.0
    return memory[GATE] * limit * saturated(ebow[GAIN] * ahead)
