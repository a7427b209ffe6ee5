"""What the twin's arrays hold: the names of their columns, and the numbers its parts agree on.

Nothing here loads a compiler. A name is the index of a column or, in `TICK` and what follows it, a number.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Floats

Integers = NDArray[np.int64]
Flags = NDArray[np.uint8]

STEP, LENGTH, TENSION, MASS, REACH, STRETCH, AXIAL, RISE, DRIFT, DRIFT_RATE, SHAKE, AGREED = range(12)
"""Scalars: time step, L, T0, modal mass, pi^2/(4L), E A pi^2/(4 L^2), E A, k_T of the linear law, N off T0
and N/s of drift, acceleration of the frame in m/s^2 at full scale of the outside sound, and the relative
change of the stretch sum at which its rounds end."""
FINER, SEED, LAW = range(3)
"""Integers: steps a frame, seed, and tension law (0 geometric, 1 linear)."""
K1, K2, LOSS, TANGENT, STATIC, KINETIC, STRIBECK, ROUGH, ROUGH_LENGTH, ROLLS = range(10)
"""Parameters of a touch: stiffness, Hunt-Crossley's beta, tangential over normal stiffness, friction,
roughness."""
(
    S, ETA, Z, Z_ALONG, PULL_ALONG, SLIP, SIDE, PATH, HEIGHT, REST, GRIP, DAMP, NOW, SINCE, MEAN, ACROSS,
    ALONG, STATE, ON, PATH_ALONG, ROLL, LAG, LAG_ALONG, SLOW, SLOW_ALONG, MARK, MARK_ALONG, READ, READ_ALONG,
    TOUCH_MEMORY,
) = range(30)  # fmt: skip
"""Memory of a touch: contact (sqrt delta, eta), bristles, force along, last speed, place aside, path slid
across, height, residual compliance, stiffness and damping of the bristles, force now, time since it
pressed, its mean, slip speeds, state of friction, and whether it counted as touching; then the path slid
along and the one rolled, both paths after one pole and after two, the mark that their play leaves, and
where the height was last read."""
(
    TUNED,
    SPREAD,
    BRIEF_1,
    BRIEF_2,
    LONG_1,
    LONG_2,
    QUIET,
    SETTLED,
    COIL_1,
    COIL_2,
    SLOPE,
    NEAR,
    FAR,
    KICK,
    FRESH,
    ROUNDS,
    SENSOR_MEMORY,
) = range(17)
"""Memory of the sensor: tension of the propagator, stretch sum, levels, time at rest, flag, speeds at the
coils, how a miss of the guess comes back, forces on the ends, largest kick of a mode, whether touches must
be laid anew, and how many rounds were done."""

(
    LOAD, SIDE_FORCE, ALONG_FORCE, NEW_S, NEW_ETA, Z_NEW, Z_NEW_ALONG, LEFT, LEFT_ALONG, GRIPS, ASIDE, BELOW,
    BESIDE, SURFACE, ALONG_SPEED, ROLLED, FOUND,
) = range(17)  # fmt: skip
"""What a step finds of a touch: its forces, contact, bristles, motion left to slide, state, place; then
what it started from: free place, surface and its motion."""

GATE = 3
"""Column of a driver's memory: how far it is switched on, 0 to 1."""
TICK = 32
"""Steps from one reading of the touches' motion to the next; between, they run linearly."""
TELLING = 1e-10
"""Relative difference of two guesses that tells how a miss comes back."""
ALIKE = 1e-12
"""Relative change of the largest force at which several touches have come to terms."""
MOST = 60
"""Most rounds of the stretch: two or three are usual, and a bracket is halved where they go astray."""
SLACK = 0.9
"""Share of the slack that a mode bears in a step at which the extra tension is held, should it fall so
low."""
SWEEPS = 40
"""Most rounds of several touches among themselves."""
HOLD = 0.005
"""Seconds without force after which a touch counts as off, and time constant of its force."""
SWING, SPEEDING = 0.002, 0.003
"""Time constants in s of the two poles that take the swing off the path slid, and of sliding speeds."""
SLIPPING = 5e-4
"""Sliding speed in m/s from which a touch counts as slipping."""
BRIEF, LONG, SAME, CALM = 0.010, 0.050, 0.2, 0.020
"""Time constants of the two levels in s, how far they may differ, and for how long in s, to be settled."""
RETUNE = 1e-7
"""Relative change of the tension at which the propagators follow; what is less acts as an extra tension."""
FINE = 1e-8
"""Way over an object in m that leaves its height as it was."""
SILENCE = 1e-12
"""Level, in full scale squared, that counts as none."""
LEAST = 0.01
"""Press in N at which the bristles of a lighter touch are taken."""
SWITCH = 0.005
"""Seconds a driver takes to go on or off."""


class Sensor(NamedTuple):
    """What does not change while the twin runs; `monochord.physics.twin.assemble` makes it."""

    scalars: Floats
    integers: Integers
    ebows: Floats
    pickup: Floats
    gates: Floats
    sound: Audio
    touches: Floats
    keys: Floats
    counts: Integers
    weights: Floats
    tables: Floats


class State(NamedTuple):
    """What changes: the bank of modes (part of it only when the tension moves), and the parts' memories."""

    bank: Floats
    contact: Floats
    asked: Floats
    ahead: Floats
    coils: Floats
    band: Floats
    memory: Floats
    solved: Floats
    mutual: Floats


class Out(NamedTuple):
    """What is heard and what is true, per frame."""

    microphones: Audio
    contact: Flags
    position: Audio
    force: Audio
    reaction: Audio
    slip: Flags
    across: Audio
    along: Audio
    friction: Flags
    settled: Flags
