"""How a touch resists the turning of the string: a moment beside its force.

An object that touches along a line, or at two edges a width w apart, holds the string's slope too. In the
modal string the force acts on the mean height of both edges and the moment on the difference of their heights
over w, so that both edges are held where the contact is stiff: then each segment ends at its own edge. A
string that turns by theta on a round object of radius R rolls on it: the middle of the contact moves by
R theta, and the press F with it, which is a moment F R theta.

Either is a spring k between slope and object, k = h^2 (slope of the force by compression) + F R with h = w/2.
The modes beyond the bank turn without delay: they are a compliance in series, as they are for the force, and
far from small, for bending smooths a slope over sqrt(E I / T). The spring takes the mean of its old and new
turn, so that the work of its moment is the rise of its energy, exactly; the moment then is linear in the
force, and a step remains one scalar equation. A contact begins without a moment and ends with what it has: it
may lose energy there, and gains none.

Left out: a flat that stands on one edge only, and the object's own turning, whose stiffness in a gripper is
a thousand times that of the string.
"""

import numpy as np

from monochord.core.types import Floats
from monochord.physics.twin.jit import inlined
from monochord.physics.twin.records import (
    COMPLIANCE,
    FORCE,
    NORMAL,
    OMEGA2_BENDING,
    OMEGA2_TENSION,
    Q_NEW,
    Q,
    TurningState,
)


@inlined
def fill_slope(slope: Floats, row: int, half: int, position: float, weight: Floats) -> None:
    """Fill a row with cos(n pi x / L) times each mode's weight, by recurrence; `position` is x / L."""
    angle = np.pi * position
    turn = 2.0 * np.cos(angle)
    before, now = 1.0, np.cos(angle)
    for i in range(half):
        slope[row, i] = now * weight[i]
        before, now = now, turn * now - before


@inlined
def move_slope(slope: Floats, half: int) -> None:
    """Advance a moving touch's slope by one step."""
    for i in range(half):
        slope[0, i] += slope[1, i]


@inlined
def static_compliance(bank: Floats, size: int, slope: Floats, tension: float, mass: float) -> float:
    """Return the static turn in rad/(N m) of the bank's modes by a moment at a touch, at a tension in N."""
    total = 0.0
    for i in range(size // 2):
        square = bank[OMEGA2_TENSION * size + i] * tension + bank[OMEGA2_BENDING * size + i]
        if square > 0.0:
            total += slope[0, i] ** 2 / (mass * square)
    return total


@inlined
def free_response(bank: Floats, size: int, slope: Floats) -> tuple[float, float, float]:
    """Return the slope at the selected touch, from `Q_NEW`, and how it yields over a step.

    The slope in rad, its compliance to a moment in rad/(N m), and to a force in rad/N.
    """
    turned, compliance, cross = 0.0, 0.0, 0.0
    for i in range(size // 2):
        tilt = slope[0, i]
        gives = tilt * bank[COMPLIANCE * size + i]
        turned += tilt * bank[Q_NEW * size + i]
        compliance += tilt * gives
        cross += bank[NORMAL * size + i] * gives
    return turned, compliance, cross


@inlined
def mutual_compliance(bank: Floats, size: int, row: int, slope: Floats, other: Floats) -> tuple[float, float]:
    """Return how height and slope at one touch yield to a moment at another, over a step."""
    height, turned = 0.0, 0.0
    for i in range(size // 2):
        gives = other[0, i] * bank[COMPLIANCE * size + i]
        height += bank[row * size + i] * gives
        turned += slope[0, i] * gives
    return height, turned


@inlined
def prepare(state: TurningState, turned: float) -> None:
    """Fill the moment without a force, and its change by a newton, where the string would turn freely to."""
    half = 0.5 * state.stiffness
    share = 1.0 / (1.0 + half * state.compliance)
    state.unloaded = -share * (state.stiffness * state.deflection + half * (turned - state.slope))
    state.gain = -share * half * state.cross


@inlined
def apply_moment(bank: Floats, size: int, slope: Floats, moment: float) -> None:
    """Add what a moment in N m held over the step does to `Q_NEW`."""
    for i in range(size // 2):
        bank[Q_NEW * size + i] += slope[0, i] * bank[COMPLIANCE * size + i] * moment


@inlined
def add_force(bank: Floats, size: int, slope: Floats, moment: float) -> None:
    """Add a moment in N m to the modal force of the touches."""
    for i in range(size // 2):
        bank[FORCE * size + i] += slope[0, i] * moment


@inlined
def keep(bank: Floats, size: int, slope: Floats, state: TurningState, pressed: bool) -> None:  # noqa: FBT001
    """Take over the slope after a step; `pressed` says whether the touch did, before and after."""
    turned = 0.0
    for i in range(size // 2):
        turned += slope[0, i] * bank[Q * size + i]
    state.deflection = state.deflection + turned - state.slope if pressed else 0.0
    state.slope = turned
