"""The string: modes that are carried from sample to sample exactly, in two polarisations.

Each mode obeys m (q'' + 2 sigma q' + omega^2 q) = F with F held over a sample, which has a closed solution
(Trautmann and Rabenstein 2003; Issanchou et al. 2017). All that belongs to modes stands in one flat bank, row after
row of `size` numbers: the modes of the press direction in the first half of a row, those across it in the second,
each half padded with modes at rest. One array and a size that is known when the kernel is compiled let a row be
one run of vector instructions.
"""

import numpy as np

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
    GIVE,
    KICK_Q,
    KICK_V,
    PULL,
    PUSH_Q,
    PUSH_V,
    Q,
    Q_FREE,
    Q_NEXT,
    Q_Q,
    Q_V,
    SENSE_1,
    SENSE_2,
    SHAPE,
    SIGMA,
    STRETCH,
    V,
    V_FREE,
    V_Q,
    V_V,
    WORK,
)
from monochord.physics.twin.part import part
from monochord.types import Floats

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
        most = max(most, push * weight)
    return most


@part
def carry(bank: Floats, size: int, first: float, second: float, shake: float) -> float:
    """Carry all modes over one sample under held forces; return their stretch sum.

    `first` and `second` are the drivers' forces in N, `shake` the acceleration of the frame in m/s^2.
    """
    total = 0.0
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
        total += bank[STRETCH * size + i] * new * new
    return total


@part
def pulled(bank: Floats, size: int, tension: float, most: float) -> float:
    """Fill `Q_NEXT` and `EASE` under an extra tension, in N; return the stretch sum.

    The tension acts at the mean of old and new position, q_next = (q_free - h q) / (1 + h) with
    h = KICK_Q tension, which solves that mean exactly. `most` is the largest KICK_Q: while h stays below `LITTLE`,
    1 / (1 + h) is 1 - h + h^2 after two rounds of Newton's reciprocal, wrong by h^12, which is far cheaper.
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

    `FORCE` holds the modal force of the touches, `tension` is the extra tension in N. Returns the speeds at both
    sense coils in m/s and the forces on both ends as the microphones feel them, in N at nominal tension.
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
    """Fill a touch's row with sin(n pi x / L) times each mode's weight, by recurrence; `position` is x / L."""
    angle = np.pi * position
    turn = 2.0 * np.cos(angle)
    before, now = 0.0, np.sin(angle)
    for i in range(size // 2):
        bank[row * size + i] = now * weight[i]
        before, now = now, turn * now - before


@part
def placed(bank: Floats, size: int, row: int) -> tuple[float, float, float, float]:
    """Return where the string is at a touch, from `Q_NEXT`, and what a newton there gives it in a sample.

    In the press direction and across it, in m, then both ways in m/N. Fills the touch's row `GIVE`. That the products
    are stored keeps the loop in vectors: a bare sum of so few terms would be unrolled into one long chain.
    """
    below, aside, ease, ease_aside = 0.0, 0.0, 0.0, 0.0
    half = size // 2
    shape, give = bank[row * size : row * size + half], bank[(row + 2) * size : (row + 3) * size]
    for i in range(half):
        gives, gives_aside = shape[i] * bank[EASE * size + i], shape[i] * bank[EASE * size + half + i]
        give[i] = gives
        give[half + i] = gives_aside
        below += shape[i] * bank[Q_NEXT * size + i]
        aside += shape[i] * bank[Q_NEXT * size + half + i]
        ease += shape[i] * gives
        ease_aside += shape[i] * gives_aside
    return below, aside, ease, ease_aside


@part
def between(bank: Floats, size: int, row: int, other: int) -> tuple[float, float]:
    """Return what a newton held over one sample at another touch gives the string at this one, in m/N, both ways."""
    ease, ease_aside = 0.0, 0.0
    half = size // 2
    shape, give = bank[row * size : row * size + half], bank[(other + 2) * size : (other + 3) * size]
    for i in range(half):
        gives, gives_aside = shape[i] * give[i], shape[i] * give[half + i]
        bank[WORK * size + i] = gives
        bank[WORK * size + half + i] = gives_aside
        ease += gives
        ease_aside += gives_aside
    return ease, ease_aside


@part
def pushed(bank: Floats, size: int, row: int, load: float, side: float) -> float:
    """Add to `Q_NEXT` what a touch's forces in N give; return the stretch sum."""
    total = 0.0
    half, give = size // 2, bank[(row + 2) * size : (row + 3) * size]
    for i in range(half):
        new = bank[Q_NEXT * size + i] + give[i] * load
        aside = bank[Q_NEXT * size + half + i] + give[half + i] * side
        bank[Q_NEXT * size + i] = new
        bank[Q_NEXT * size + half + i] = aside
        total += bank[STRETCH * size + i] * (new * new + aside * aside)
    return total


@part
def hold(bank: Floats, size: int, row: int, load: float, side: float) -> None:
    """Add a touch's forces in N to the modal force in `FORCE`."""
    half, shape = size // 2, bank[row * size : row * size + size // 2]
    for i in range(half):
        bank[FORCE * size + i] += shape[i] * load
        bank[FORCE * size + half + i] += shape[i] * side


@part
def release(bank: Floats, size: int) -> None:
    """Empty `FORCE`."""
    for i in range(size):
        bank[FORCE * size + i] = 0.0


@part
def slide(bank: Floats, size: int, row: int) -> None:
    """Move a touch's shape on by one step."""
    shape, drift = bank[row * size : (row + 1) * size], bank[(row + 1) * size : (row + 2) * size]
    for i in range(size // 2):
        shape[i] += drift[i]


@part
def static_share(bank: Floats, size: int, row: int, tension: float, mass: float) -> float:
    """Return the static compliance in m/N that the bank's modes give a touch, at a tension."""
    total = 0.0
    for i in range(size // 2):
        square = bank[PULL * size + i] * tension + bank[BEND * size + i]
        if square > 0.0:
            total += bank[row * size + i] ** 2 / (mass * square)
    return total
