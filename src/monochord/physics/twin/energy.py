"""The energy of a twin, which nothing but drivers, losses, friction and moving objects can change."""

import numpy as np

from monochord.physics.twin import bank as layout
from monochord.physics.twin import memory as k
from monochord.physics.twin import motion
from monochord.physics.twin.memory import Sensor, State
from monochord.physics.twin.stream import Twin


def energy(twin: Twin) -> float:
    """Return the energy that string and contacts hold at an instant.

    E = sum m/2 (v^2 + omega^2 q^2) + r (a S^2 / 2 - d S) + contacts,  r = pi^2/(4 L), a = E A pi^2/(4 L^2),

    over the modes of both polarisations, with omega at the tension that the modes are carried with, S the
    stretch sum of weights times q^2, and d how far that tension is above that of a string which does not
    stretch. A contact holds k1 delta^2 / 2 + 2 k2 delta^(5/2) / 5, its modes left out R f^2 / 2, its bristles
    sigma z^2 / 2. This is what the scheme keeps: without losses and drivers, under objects that hold still,
    it stays as it is, up to rounding and to how well tension and motion agree in a step (`agreement` of
    `begin`).

    Parameters
    ----------
    twin
        A twin at an instant.

    Returns
    -------
    float
        In J; zero for a string at rest that nothing touches.

    References
    ----------
    Gonzalez (1996), Time integration and discrete Hamiltonian systems, J. Nonlinear Sci. 6, 449; Bilbao,
    Torin and Chatziioannou (2015), Numerical modeling of collisions in musical instruments, Acta Acustica
    101, 155.

    Examples
    --------
    >>> from monochord.physics.strings import load_string
    >>> from monochord.physics.twin import Ebow, Pluck, Scene, Sensor, begin
    >>> coils = Ebow(sense=0.02, drive=0.03), Ebow(sense=0.18, drive=0.17)
    >>> sensor = Sensor(name="p", string=load_string("prototype").string, drivers=coils, range=(0.05, 0.15))
    >>> twin = begin(sensor, Scene(pluck=Pluck(position=0.1, height=1e-4)))
    >>> energy(twin) > 0.0
    True
    """
    fixed = Sensor(*(array[0] for array in twin.fixed))
    state = State(*(array[0] for array in twin.moving))
    scalars, memory = fixed.scalars, state.memory
    bank = state.bank.reshape(layout.rows(len(twin.scene.touches)), -1)
    tension = memory[k.TUNED] if memory[k.TUNED] > 0.0 else scalars[k.TENSION]
    square = bank[layout.PULL] * tension + bank[layout.BEND]
    q, v = bank[layout.Q], bank[layout.V]
    total = 0.5 * scalars[k.MASS] * float(np.sum(v**2 + square * q**2))
    if fixed.integers[k.LAW] == 0:
        stretch = float(bank[layout.STRETCH] @ q**2)
        tick = max(0, (twin.start * int(fixed.integers[k.FINER]) - 1)) // k.TICK * k.TICK
        drift = motion.drifted(
            scalars[k.DRIFT], scalars[k.DRIFT_RATE], tick * scalars[k.STEP], scalars[k.TENSION]
        )
        above = tension - scalars[k.TENSION] - drift
        total += scalars[k.REACH] * (0.5 * scalars[k.STRETCH] * stretch**2 - above * stretch)
    for own, touch in zip(state.contact, fixed.touches, strict=True):
        delta, k1, k2 = own[k.S] ** 2, touch[k.K1], touch[k.K2]
        force = k1 * delta + k2 * delta**1.5
        total += 0.5 * k1 * delta**2 + 0.4 * k2 * delta**2.5 + 0.5 * own[k.REST] * force**2
        total += 0.5 * own[k.GRIP] * (own[k.Z] ** 2 + own[k.Z_ALONG] ** 2)
    return float(total)
