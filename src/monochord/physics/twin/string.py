"""The string: modes that are carried from sample to sample exactly, in two polarisations.

Each mode obeys m (q'' + 2 sigma q' + omega^2 q) = F with F held over a sample, which has a closed solution
(Trautmann and Rabenstein 2003; Issanchou et al. 2017). All that belongs to modes stands in one flat bank, row after
row of `size` numbers: the modes of the press direction in the first half of a row, those across it in the second,
each half padded with modes at rest. One array and a size that is known when the kernel is compiled let a row be
one run of vector instructions.
"""

import numpy as np

from monochord.physics.twin.part import part
from monochord.types import Floats

PULL, BEND, SIGMA, STRETCH = range(4)
"""Rows of a mode: omega^2 a newton of tension, omega^2 of bending, decay rate, weight n^2 in the stretch."""
DRIVE_1, DRIVE_2, SENSE_1, SENSE_2, END_1, END_2, FRAME = range(4, 11)
"""Rows of its shape: at the coils, as force on the ends in N/m, and under a shake of the frame."""
Q_Q, Q_V, V_Q, V_V, PUSH_Q, PUSH_V, KICK_Q, KICK_V = range(11, 19)
"""Rows of its propagator: what q and v become of q, v, a held force and an extra tension."""
Q, V = range(19, 21)
"""Rows of its state: displacement in m and velocity in m/s."""
FORCE, Q_FREE, V_FREE, Q_NEXT, EASE = range(21, 26)
"""Rows at work within a sample: modal force in N, free motion, new displacement, and its ease in m/N."""
SHAPE, DRIFT = range(26, 28)
"""Rows of the first touch: the modes' shapes there, and their change a step; others follow in pairs."""


def rows(touches: int) -> int:
    """Return how many rows a bank has.

    Examples
    --------
    >>> rows(0), rows(2)
    (26, 30)
    """
    return SHAPE + 2 * touches


@part
def tune(bank: Floats, size: int, tension: float, mass: float, reach: float, step: float) -> None:
    """Fill the propagator of every mode for a tension.

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
    for i in range(size):
        square = bank[PULL * size + i] * tension + bank[BEND * size + i]
        if square <= 0.0:
            continue
        sigma = bank[SIGMA * size + i]
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


@part
def carry(bank: Floats, size: int) -> float:
    """Carry all modes over one sample under the held force in `FORCE`; return their stretch sum."""
    total = 0.0
    for i in range(size):
        q, v, force = bank[Q * size + i], bank[V * size + i], bank[FORCE * size + i]
        new = bank[Q_Q * size + i] * q + bank[Q_V * size + i] * v + bank[PUSH_Q * size + i] * force
        bank[Q_FREE * size + i] = new
        bank[V_FREE * size + i] = (
            bank[V_Q * size + i] * q + bank[V_V * size + i] * v + bank[PUSH_V * size + i] * force
        )
        total += bank[STRETCH * size + i] * new * new
    return total


@part
def pulled(bank: Floats, size: int, tension: float) -> float:
    """Fill `Q_NEXT` and `EASE` under an extra tension, in N; return the stretch sum.

    The tension acts at the mean of old and new position, q_next = (q_free - h q) / (1 + h) with
    h = KICK_Q tension, which solves that mean exactly.
    """
    total = 0.0
    for i in range(size):
        h = bank[KICK_Q * size + i] * tension
        share = 1.0 / (1.0 + h)
        new = (bank[Q_FREE * size + i] - h * bank[Q * size + i]) * share
        bank[Q_NEXT * size + i] = new
        bank[EASE * size + i] = bank[PUSH_Q * size + i] * share
        total += bank[STRETCH * size + i] * new * new
    return total


@part
def pushed(bank: Floats, size: int) -> float:
    """Add what the touches' modal force in `FORCE` does to `Q_NEXT`; return the stretch sum."""
    total = 0.0
    for i in range(size):
        new = bank[Q_NEXT * size + i] + bank[EASE * size + i] * bank[FORCE * size + i]
        bank[Q_NEXT * size + i] = new
        total += bank[STRETCH * size + i] * new * new
    return total


@part
def arrive(bank: Floats, size: int, tension: float) -> tuple[float, float]:
    """Let new positions and velocities take the old ones' place; return the speeds at both sense coils in m/s.

    `FORCE` holds the modal force of the touches, `tension` is the extra tension in N.
    """
    first, second = 0.0, 0.0
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
    return first, second


@part
def ends(bank: Floats, size: int) -> tuple[float, float]:
    """Return the forces on both ends as the microphones feel them, in N at nominal tension."""
    near, far = 0.0, 0.0
    for i in range(size):
        near += bank[END_1 * size + i] * bank[Q * size + i]
        far += bank[END_2 * size + i] * bank[Q * size + i]
    return near, far


@part
def driven(bank: Floats, size: int, first: float, second: float, shake: float) -> None:
    """Fill `FORCE` with what both drivers, in N, and a shake of the frame, in m/s^2, do to every mode."""
    for i in range(size):
        bank[FORCE * size + i] = (
            bank[DRIVE_1 * size + i] * first
            + bank[DRIVE_2 * size + i] * second
            + bank[FRAME * size + i] * shake
        )


@part
def shape_at(bank: Floats, size: int, row: int, position: float, weight: Floats) -> None:
    """Fill a touch's row with sin(n pi x / L) times each mode's weight, by recurrence; `position` is x / L."""
    angle = np.pi * position
    turn = 2.0 * np.cos(angle)
    before, now = 0.0, np.sin(angle)
    for i in range(size // 2):
        bank[row * size + i] = now * weight[i]
        before, now = now, turn * now - before


@part
def placed(bank: Floats, size: int, row: int) -> tuple[float, float]:
    """Return where the string is at a touch, in the press direction and across it, in m, from `Q_NEXT`."""
    below, aside = 0.0, 0.0
    for i in range(size // 2):
        below += bank[row * size + i] * bank[Q_NEXT * size + i]
        aside += bank[row * size + i] * bank[Q_NEXT * size + size // 2 + i]
    return below, aside


@part
def eased(bank: Floats, size: int, row: int, other: int) -> tuple[float, float]:
    """Return what a newton held over one sample at one touch moves the string at another, in m/N, both ways."""
    below, aside = 0.0, 0.0
    for i in range(size // 2):
        both = bank[row * size + i] * bank[other * size + i]
        below += both * bank[EASE * size + i]
        aside += both * bank[EASE * size + size // 2 + i]
    return below, aside


@part
def hold(bank: Floats, size: int, row: int, load: float, side: float) -> None:
    """Add a touch's forces in N to the modal force in `FORCE`."""
    for i in range(size // 2):
        bank[FORCE * size + i] += bank[row * size + i] * load
        bank[FORCE * size + size // 2 + i] += bank[row * size + i] * side


@part
def release(bank: Floats, size: int) -> None:
    """Empty `FORCE`."""
    for i in range(size):
        bank[FORCE * size + i] = 0.0


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
