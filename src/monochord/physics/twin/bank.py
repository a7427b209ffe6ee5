"""How the bank of modes is laid out: one flat array, row after row of one number a mode.

The modes of the press direction stand in the first half of a row, those across it in the second, each half
padded with modes at rest.
"""

PULL, BEND, SIGMA, STRETCH = range(4)
"""Rows of a mode: omega^2 a newton of tension, omega^2 of bending, decay rate, weight n^2 in the stretch."""
DRIVE_1, DRIVE_2, SENSE_1, SENSE_2, END_1, END_2, FRAME = range(4, 11)
"""Rows of its shape: at the coils, as force on the ends in N/m, and under a shake of the frame."""
Q_Q, Q_V, V_Q, V_V, PUSH_Q, PUSH_V, KICK_Q, KICK_V = range(11, 19)
"""Rows of its propagator: what q and v become of q, v, a held force and an extra tension."""
Q, V = range(19, 21)
"""Rows of its state: displacement in m and velocity in m/s."""
FORCE, Q_FREE, V_FREE, Q_NEXT, EASE, WORK = range(21, 27)
"""Rows at work within a sample: modal force of the touches in N, free motion, new displacement, its ease in
m/N, and products."""
PRESS, RUB = range(27, 29)
"""Rows of the touch at hand: the modes' shapes at it, in the half of the press and in that across it."""
SHAPE, DRIFT = range(29, 31)
"""Rows of the first touch, of which half is used: the modes' shapes there, and their change a step. Others
follow in pairs."""
EACH = 2
"""Rows of each touch."""


def rows(touches: int) -> int:
    """Return how many rows a bank has.

    Examples
    --------
    >>> rows(0), rows(2)
    (29, 33)
    """
    return SHAPE + EACH * touches
