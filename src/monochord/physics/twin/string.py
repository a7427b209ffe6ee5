"""The string: modes that are carried from sample to sample exactly, in two polarisations.

Each mode obeys m (q'' + 2 sigma q' + omega^2 q) = F with F held over a sample, which has a closed solution
(Trautmann and Rabenstein 2003; Issanchou et al. 2017). All that belongs to modes stands in one flat bank,
row after row of `size` numbers: the modes of the press direction in the first half of a row, those across
it in the second, each half padded with modes at rest. One array and a size that is known when the kernel is
compiled let a row be one run of vector instructions.
"""

import numpy as np

from monochord.core.types import Floats
from monochord.physics.twin.bank import (
    BEND,
    DRIVE_1,
    DRIVE_2,
    EACH,
    EASE,
    END_1,
    END_2,
    FORCE,
    FRAME,
    KICK_Q,
    KICK_V,
    PRESS,
    PULL,
    PUSH_Q,
    PUSH_V,
    Q_FREE,
    Q_NEXT,
    Q_Q,
    Q_V,
    RUB,
    SENSE_1,
    SENSE_2,
    SHAPE,
    SIGMA,
    STRETCH,
    V_FREE,
    V_Q,
    V_V,
    WORK,
    Q,
    V,
)
from monochord.physics.twin.part import part

LITTLE = 0.1
"""Share of a mode's motion in a sample up to which an extra tension is little."""


@part
def row_of(touch: int) -> int:
    """Return the first row of a touch."""
    return SHAPE + EACH * touch


@part
def tune(bank: Floats, size: int, tension: float, mass: float, reach: float, step: float) -> float:
    """Fill the propagator of every mode for a tension; return the largest of `KICK_Q`.

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
    reach
        pi^2 / (4 L) in 1/m: half the force on a mode's unit weight and displacement a newton of tension.
    step
        Time step in s.
    """
    most = 0.0
    for i in range(size):
        square = bank[PULL * size + i] * tension + bank[BEND * size + i]
        sigma = bank[SIGMA * size + i]
        if square <= sigma * sigma:
            continue  # no mode, or one that a slack string has lost: it stays as it was
        ring = np.sqrt(square - sigma * sigma)
        fall = np.exp(-sigma * step)
        sine = fall * np.sin(ring * step) / ring
        cosine = fall * np.cos(ring * step)
        push = (1.0 - cosine - sigma * sine) / (mass * square)
        weight = bank[STRETCH * size + i] * reach
        bank[Q_Q * size + i] = cosine + sigma * sine
        bank[Q_V * size + i] = sine
        bank[V_Q * size + i] = -square * sine
        bank[V_V * size + i] = cosine - sigma * sine
        bank[PUSH_Q * size + i] = push
        bank[PUSH_V * size + i] = sine / mass
        bank[KICK_Q * size + i] = push * weight
        bank[KICK_V * size + i] = sine / mass * weight
        most = max(most, push * weight)
    return most


@part
def carry(bank: Floats, size: int, first: float, second: float, shake: float) -> tuple[float, float]:
    """Carry all modes over one sample under held forces.

    Returns their stretch sum, and by how much half a newton of extra tension would lower it, in m^2/N.
    `first` and `second` are the drivers' forces in N, `shake` the acceleration of the frame in m/s^2.
    """
    total, yields = 0.0, 0.0
    for i in range(size):
        force = (
            bank[DRIVE_1 * size + i] * first
            + bank[DRIVE_2 * size + i] * second
            + bank[FRAME * size + i] * shake
        )
        q, v = bank[Q * size + i], bank[V * size + i]
        new = bank[Q_Q * size + i] * q + bank[Q_V * size + i] * v + bank[PUSH_Q * size + i] * force
        bank[Q_FREE * size + i] = new
        bank[V_FREE * size + i] = (
            bank[V_Q * size + i] * q + bank[V_V * size + i] * v + bank[PUSH_V * size + i] * force
        )
        stretch = bank[STRETCH * size + i] * new
        total += stretch * new
        yields += stretch * bank[KICK_Q * size + i] * (new + q)
    return total, yields


@part
def pulled(bank: Floats, size: int, tension: float, most: float) -> float:
    """Fill `Q_NEXT` and `EASE` under an extra tension, in N; return the stretch sum.

    The tension acts at the mean of old and new position, q_next = (q_free - h q) / (1 + h) with h = KICK_Q
    tension, which solves that mean exactly. `most` is the largest KICK_Q: while h stays below `LITTLE`, 1 /
    (1 + h) is 1 - h + h^2 after two rounds of Newton's reciprocal, wrong by h^12, which is far cheaper.
    """
    total = 0.0
    if abs(tension) * most < LITTLE:
        for i in range(size):
            h = bank[KICK_Q * size + i] * tension
            share = 1.0 - h + h * h
            share *= 2.0 - share * (1.0 + h)
            share *= 2.0 - share * (1.0 + h)
            new = (bank[Q_FREE * size + i] - h * bank[Q * size + i]) * share
            bank[Q_NEXT * size + i] = new
            bank[EASE * size + i] = bank[PUSH_Q * size + i] * share
            total += bank[STRETCH * size + i] * new * new
        return total
    for i in range(size):
        h = bank[KICK_Q * size + i] * tension
        new = (bank[Q_FREE * size + i] - h * bank[Q * size + i]) / (1.0 + h)
        bank[Q_NEXT * size + i] = new
        bank[EASE * size + i] = bank[PUSH_Q * size + i] / (1.0 + h)
        total += bank[STRETCH * size + i] * new * new
    return total


@part
def arrive(bank: Floats, size: int, tension: float) -> tuple[float, float, float, float]:
    """Let new positions and velocities take the old ones' place.

    `FORCE` holds the modal force of the touches, `tension` is the extra tension in N. Returns the speeds at
    both sense coils in m/s and the forces on both ends as the microphones feel them, in N at nominal
    tension.
    """
    first, second, near, far = 0.0, 0.0, 0.0, 0.0
    for i in range(size):
        old, new = bank[Q * size + i], bank[Q_NEXT * size + i]
        speed = (
            bank[V_FREE * size + i]
            + bank[PUSH_V * size + i] * bank[FORCE * size + i]
            - bank[KICK_V * size + i] * tension * (new + old)
        )
        bank[V * size + i] = speed
        bank[Q * size + i] = new
        first += bank[SENSE_1 * size + i] * speed
        second += bank[SENSE_2 * size + i] * speed
        near += bank[END_1 * size + i] * new
        far += bank[END_2 * size + i] * new
    return first, second, near, far


@part
def shape_at(bank: Floats, size: int, row: int, position: float, weight: Floats) -> None:
    """Fill a touch's row with sin(n pi x / L) times each mode's weight, by recurrence; `position` is x/L."""
    angle = np.pi * position
    turn = 2.0 * np.cos(angle)
    before, now = 0.0, np.sin(angle)
    for i in range(size // 2):
        bank[row * size + i] = now * weight[i]
        before, now = now, turn * now - before


@part
def take(bank: Floats, size: int, row: int) -> None:
    """Take a touch in hand: its shapes are copied where `foreseen`, `placed` and `pushed` look for them.

    Those run along whole rows at known places, and keep what they multiply: that lets them be vectors,
    where a bare sum over half a row at some place would be unrolled into one long chain, ten times as slow.
    """
    half = size // 2
    for i in range(half):
        bank[PRESS * size + i] = bank[row * size + i]
        bank[RUB * size + half + i] = bank[row * size + i]


@part
def foreseen(bank: Floats, size: int) -> tuple[float, float, float, float]:
    """Return what tells about the force of the touch at hand before anything has pushed, from `Q_FREE`.

    Where the string would be there, in m; what a newton gives it in a sample, in m/N; and what a force f
    adds to the stretch sum: 2 f times the third number and f^2 times the fourth.
    """
    below, ease, cross, square = 0.0, 0.0, 0.0, 0.0
    for i in range(size):
        shape, free = bank[PRESS * size + i], bank[Q_FREE * size + i]
        gives = shape * bank[PUSH_Q * size + i]
        weighed = bank[STRETCH * size + i] * gives
        bank[WORK * size + i] = weighed
        below += shape * free
        ease += shape * gives
        cross += weighed * free
        square += weighed * gives
    return below, ease, cross, square


@part
def placed(bank: Floats, size: int) -> tuple[float, float, float, float]:
    """Return where the string is at the touch at hand, from `Q_NEXT`, and its ease there.

    In the press direction and across it, in m, then what a newton there gives it in a sample, in m/N.
    """
    below, aside, ease, ease_aside = 0.0, 0.0, 0.0, 0.0
    for i in range(size):
        shape, shape_aside = bank[PRESS * size + i], bank[RUB * size + i]
        gives, gives_aside = shape * bank[EASE * size + i], shape_aside * bank[EASE * size + i]
        bank[WORK * size + i] = gives + gives_aside
        below += shape * bank[Q_NEXT * size + i]
        aside += shape_aside * bank[Q_NEXT * size + i]
        ease += shape * gives
        ease_aside += shape_aside * gives_aside
    return below, aside, ease, ease_aside


@part
def pushed(bank: Floats, size: int, load: float, side: float, kept: float) -> float:
    """Let the touch at hand push, in N; return the stretch sum.

    Its modal force is added to `FORCE`, of which a share is kept: none for the first touch.
    """
    total = 0.0
    for i in range(size):
        force = bank[PRESS * size + i] * load + bank[RUB * size + i] * side
        new = bank[Q_NEXT * size + i] + bank[EASE * size + i] * force
        bank[FORCE * size + i] = kept * bank[FORCE * size + i] + force
        bank[Q_NEXT * size + i] = new
        total += bank[STRETCH * size + i] * new * new
    return total


@part
def between(bank: Floats, size: int, row: int, other: int) -> tuple[float, float]:
    """Return what a newton held over a sample at another touch gives this one, in m/N, both ways."""
    ease, ease_aside = 0.0, 0.0
    for i in range(size // 2):
        both = bank[row * size + i] * bank[other * size + i]
        ease += both * bank[EASE * size + i]
        ease_aside += both * bank[EASE * size + size // 2 + i]
    return ease, ease_aside


@part
def slide(bank: Floats, size: int, row: int) -> None:
    """Move a touch's shape on by one step."""
    for i in range(size // 2):
        bank[row * size + i] += bank[(row + 1) * size + i]


@part
def static_share(bank: Floats, size: int, row: int, tension: float, mass: float) -> float:
    """Return the static compliance in m/N that the bank's modes give a touch, at a tension."""
    total = 0.0
    for i in range(size // 2):
        square = bank[PULL * size + i] * tension + bank[BEND * size + i]
        if square > 0.0:
            total += bank[row * size + i] ** 2 / (mass * square)
    return total
