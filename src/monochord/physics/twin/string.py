"""The string: modes in two polarisations, each propagated from step to step exactly.

Each mode obeys m (q'' + 2 sigma q' + omega^2 q) = F with F held over a step, which has a closed solution
(Trautmann and Rabenstein 2003; Issanchou et al. 2017). The modes stand in one flat bank, laid out in
`monochord.physics.twin.records`. One array, and a size that is known when the kernel is compiled, let every
loop over modes be a few vector instructions.
"""

import numpy as np

from monochord.core.types import Floats
from monochord.physics.twin.jit import inlined
from monochord.physics.twin.records import (
    COMPLIANCE,
    DECAY,
    DRIVE_1,
    DRIVE_2,
    END_1,
    END_2,
    FORCE,
    FRAME,
    NORMAL,
    OMEGA2_BENDING,
    OMEGA2_TENSION,
    Q_FORCE,
    Q_FREE,
    Q_NEW,
    Q_Q,
    Q_TENSION,
    Q_V,
    ROWS_A_TOUCH,
    SENSE_1,
    SENSE_2,
    SHAPE,
    STRETCH,
    TANGENTIAL,
    V_FORCE,
    V_FREE,
    V_Q,
    V_TENSION,
    V_V,
    WORK,
    Q,
    V,
)

MAX_SMALL_H = 0.1
"""Largest h = `Q_TENSION` times extra tension for which 1 / (1 + h) is taken from its series."""


@inlined
def row_of(touch: int) -> int:
    """Return the first row of a touch."""
    return SHAPE + ROWS_A_TOUCH * touch


@inlined
def tune(bank: Floats, size: int, tension: float, mass: float, tension_gain: float, step: float) -> float:
    """Fill the propagator of every mode for a tension; return the largest of `Q_TENSION`.

    Parameters
    ----------
    bank
        Flat, rows of `size`.
    size
        Modes in a row.
    tension
        In N.
    mass
        Modal mass mu L / 2 in kg.
    tension_gain
        pi^2 / (4 L) in 1/m: half the force on a mode of unit weight and displacement a newton of tension.
    step
        Time step in s.
    """
    largest = 0.0
    for i in range(size):
        square = bank[OMEGA2_TENSION * size + i] * tension + bank[OMEGA2_BENDING * size + i]
        sigma = bank[DECAY * size + i]
        if square <= sigma * sigma:
            continue  # padding, or a mode that does not oscillate on a slack string: it keeps its propagator
        ring = np.sqrt(square - sigma * sigma)
        fall = np.exp(-sigma * step)
        sine = fall * np.sin(ring * step) / ring
        cosine = fall * np.cos(ring * step)
        push = (1.0 - cosine - sigma * sine) / (mass * square)
        weight = bank[STRETCH * size + i] * tension_gain
        bank[Q_Q * size + i] = cosine + sigma * sine
        bank[Q_V * size + i] = sine
        bank[V_Q * size + i] = -square * sine
        bank[V_V * size + i] = cosine - sigma * sine
        bank[Q_FORCE * size + i] = push
        bank[V_FORCE * size + i] = sine / mass
        bank[Q_TENSION * size + i] = push * weight
        bank[V_TENSION * size + i] = sine / mass * weight
        largest = max(largest, push * weight)
    return largest


@inlined
def propagate(bank: Floats, size: int, first: float, second: float, shake: float) -> tuple[float, float]:
    """Propagate all modes over one step under held forces, without touches and extra tension.

    `first` and `second` are the drivers' forces in N, `shake` the acceleration of the frame in m/s^2. Returns
    the stretch sum in m^2, and by how much half a newton of extra tension would lower it, in m^2/N.
    """
    total, yields = 0.0, 0.0
    for i in range(size):
        force = (
            bank[DRIVE_1 * size + i] * first
            + bank[DRIVE_2 * size + i] * second
            + bank[FRAME * size + i] * shake
        )
        q, v = bank[Q * size + i], bank[V * size + i]
        new = bank[Q_Q * size + i] * q + bank[Q_V * size + i] * v + bank[Q_FORCE * size + i] * force
        bank[Q_FREE * size + i] = new
        bank[V_FREE * size + i] = (
            bank[V_Q * size + i] * q + bank[V_V * size + i] * v + bank[V_FORCE * size + i] * force
        )
        stretch = bank[STRETCH * size + i] * new
        total += stretch * new
        yields += stretch * bank[Q_TENSION * size + i] * (new + q)
    return total, yields


@inlined
def apply_tension(bank: Floats, size: int, tension: float, max_q_tension: float) -> float:
    """Fill `Q_NEW` and `COMPLIANCE` under an extra tension in N; return the stretch sum in m^2.

    The tension acts at the mean of old and new position: q_new = (q_free - h q) / (1 + h) with h = Q_TENSION
    tension. `max_q_tension` is the largest Q_TENSION: while h stays below `MAX_SMALL_H`, 1 / (1 + h) is 1 - h
    + h^2 after two rounds of Newton's reciprocal, whose error is h^12 and which is far cheaper than a
    division.
    """
    total = 0.0
    if abs(tension) * max_q_tension < MAX_SMALL_H:
        for i in range(size):
            h = bank[Q_TENSION * size + i] * tension
            share = 1.0 - h + h * h
            share *= 2.0 - share * (1.0 + h)
            share *= 2.0 - share * (1.0 + h)
            new = (bank[Q_FREE * size + i] - h * bank[Q * size + i]) * share
            bank[Q_NEW * size + i] = new
            bank[COMPLIANCE * size + i] = bank[Q_FORCE * size + i] * share
            total += bank[STRETCH * size + i] * new * new
        return total
    for i in range(size):
        h = bank[Q_TENSION * size + i] * tension
        new = (bank[Q_FREE * size + i] - h * bank[Q * size + i]) / (1.0 + h)
        bank[Q_NEW * size + i] = new
        bank[COMPLIANCE * size + i] = bank[Q_FORCE * size + i] / (1.0 + h)
        total += bank[STRETCH * size + i] * new * new
    return total


@inlined
def finish_step(bank: Floats, size: int, tension: float) -> tuple[float, float, float, float]:
    """Replace old positions and velocities by the new ones.

    `FORCE` holds the modal force of the touches, `tension` is the extra tension in N. Returns the speeds at
    both sense coils in m/s, and the forces on both ends in the pickups' direction, in N at nominal tension.
    """
    first, second, near, far = 0.0, 0.0, 0.0, 0.0
    for i in range(size):
        old, new = bank[Q * size + i], bank[Q_NEW * size + i]
        speed = (
            bank[V_FREE * size + i]
            + bank[V_FORCE * size + i] * bank[FORCE * size + i]
            - bank[V_TENSION * size + i] * tension * (new + old)
        )
        bank[V * size + i] = speed
        bank[Q * size + i] = new
        first += bank[SENSE_1 * size + i] * speed
        second += bank[SENSE_2 * size + i] * speed
        near += bank[END_1 * size + i] * new
        far += bank[END_2 * size + i] * new
    return first, second, near, far


@inlined
def places_over_coils(bank: Floats, size: int) -> tuple[float, float]:
    """Return where the string is at both drive coils, along the drivers' angles, in m."""
    first, second = 0.0, 0.0
    for i in range(size):
        q = bank[Q * size + i]
        first += bank[DRIVE_1 * size + i] * q
        second += bank[DRIVE_2 * size + i] * q
    return first, second


@inlined
def fill_shape(bank: Floats, size: int, row: int, position: float, weight: Floats) -> None:
    """Fill a row with sin(n pi x / L) times each mode's weight, by recurrence; `position` is x / L."""
    angle = np.pi * position
    turn = 2.0 * np.cos(angle)
    before, now = 0.0, np.sin(angle)
    for i in range(size // 2):
        bank[row * size + i] = now * weight[i]
        before, now = now, turn * now - before


@inlined
def select_touch(bank: Floats, size: int, row: int) -> None:
    """Copy a touch's shapes to `NORMAL` and `TANGENTIAL`, where the functions below read them.

    Those run along whole rows at fixed addresses, and store their products (`WORK`): so they compile to
    vector instructions, where a bare sum over half a row at a variable address is unrolled into one long
    chain of additions, ten times as slow.
    """
    half = size // 2
    for i in range(half):
        bank[NORMAL * size + i] = bank[row * size + i]
        bank[TANGENTIAL * size + half + i] = bank[row * size + i]


@inlined
def predict(bank: Floats, size: int) -> tuple[float, float, float, float]:
    """Return height and compliances at the selected touch before any touch acts, from `Q_FREE`.

    The string's height there in m; its compliance over a step in m/N; and the change of the stretch sum by a
    force f: 2 f times the third number and f^2 times the fourth. The force is predicted from these.
    """
    height, compliance, cross, square = 0.0, 0.0, 0.0, 0.0
    for i in range(size):
        shape, free = bank[NORMAL * size + i], bank[Q_FREE * size + i]
        gives = shape * bank[Q_FORCE * size + i]
        weighed = bank[STRETCH * size + i] * gives
        bank[WORK * size + i] = weighed
        height += shape * free
        compliance += shape * gives
        cross += weighed * free
        square += weighed * gives
    return height, compliance, cross, square


@inlined
def free_response(bank: Floats, size: int) -> tuple[float, float, float, float]:
    """Return where the string is at the selected touch, from `Q_NEW`, and its compliance there over a step.

    Both in the press direction and across it: m, m, m/N, m/N.
    """
    height, across, compliance, compliance_across = 0.0, 0.0, 0.0, 0.0
    for i in range(size):
        normal, tangential = bank[NORMAL * size + i], bank[TANGENTIAL * size + i]
        gives, gives_across = normal * bank[COMPLIANCE * size + i], tangential * bank[COMPLIANCE * size + i]
        bank[WORK * size + i] = gives + gives_across
        height += normal * bank[Q_NEW * size + i]
        across += tangential * bank[Q_NEW * size + i]
        compliance += normal * gives
        compliance_across += tangential * gives_across
    return height, across, compliance, compliance_across


@inlined
def apply_force(bank: Floats, size: int, normal: float, tangential: float, kept: float) -> float:
    """Apply the selected touch's forces, in N; return the stretch sum in m^2.

    Its modal force is added to `FORCE`, of which the share `kept` remains: 0 for the first touch, then 1.
    """
    total = 0.0
    for i in range(size):
        force = bank[NORMAL * size + i] * normal + bank[TANGENTIAL * size + i] * tangential
        new = bank[Q_NEW * size + i] + bank[COMPLIANCE * size + i] * force
        bank[FORCE * size + i] = kept * bank[FORCE * size + i] + force
        bank[Q_NEW * size + i] = new
        total += bank[STRETCH * size + i] * new * new
    return total


@inlined
def mutual_compliance(bank: Floats, size: int, row: int, other: int) -> tuple[float, float]:
    """Return the compliance over a step from one touch to another, normal and tangential, in m/N."""
    normal, tangential = 0.0, 0.0
    for i in range(size // 2):
        both = bank[row * size + i] * bank[other * size + i]
        normal += both * bank[COMPLIANCE * size + i]
        tangential += both * bank[COMPLIANCE * size + size // 2 + i]
    return normal, tangential


@inlined
def move_shape(bank: Floats, size: int, row: int) -> None:
    """Advance a moving touch's shape by one step."""
    for i in range(size // 2):
        bank[row * size + i] += bank[(row + 1) * size + i]


@inlined
def static_compliance(bank: Floats, size: int, row: int, tension: float, mass: float) -> float:
    """Return the static compliance in m/N of the bank's modes at a touch, at a tension in N."""
    total = 0.0
    for i in range(size // 2):
        square = bank[OMEGA2_TENSION * size + i] * tension + bank[OMEGA2_BENDING * size + i]
        if square > 0.0:
            total += bank[row * size + i] ** 2 / (mass * square)
    return total
