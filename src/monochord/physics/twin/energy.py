"""The energy of a twin, which only drivers, losses, friction and moving objects change."""

from collections.abc import Iterable

import numpy as np

from monochord.physics.twin import records as r
from monochord.physics.twin.records import (
    Constants,
    ContactState,
    Parameters,
    Plausible,
    SensorState,
    State,
    TouchParameters,
)
from monochord.physics.twin.stream import Twin


def energy(twin: Twin) -> float:
    """Return the energy of string and contacts at an instant.

    E = sum m/2 (v^2 + omega^2 q^2) + r (a S^2 / 2 - d S) + contacts,  r = pi^2/(4 L), a = E A pi^2/(4 L^2),

    over the modes of both polarisations, with omega at the tension that the propagators hold, S the stretch
    sum of weights times q^2, and d the excess of that tension over that of a string which does not stretch. A
    contact stores k1 delta^2 / 2 + 2 k2 delta^(5/2) / 5, the modes beyond the bank R f^2 / 2, the bristles
    sigma z^2 / 2. What holds an object stores sum m/2 (v^2 + omega^2 q^2) in its modes and R f^2 / 2 in its
    spring, a rough layer u0 (f - F0 log(1 + f / F0)), a contact that turned by z k z^2 / 2, a driver's magnet
    -k u^2 / 2 + k d^2 / 4 over a string that stands at u and moved there by d in a step. This is what the
    scheme conserves: without losses and drivers, under objects at rest, it is constant up to rounding and to
    the error of a step's iteration (`tolerance` of `begin`). In J; zero for a string at rest that nothing
    touches.

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
    parameters = Parameters(*(array[0] for array in twin.parameters))
    state = State(*(array[0] for array in twin.state))
    constants: Constants = parameters.constants
    memory: SensorState = state.memory
    bank = state.bank.reshape(r.rows(len(twin.scene.touches)), -1)
    tension = memory.tuned_tension if memory.tuned_tension > 0.0 else constants.tension
    square = bank[r.OMEGA2_TENSION] * tension + bank[r.OMEGA2_BENDING]
    q, v = bank[r.Q], bank[r.V]
    total = 0.5 * constants.mass * float(np.sum(v**2 + square * q**2))
    if constants.linear_law == 0:
        stretch = float(bank[r.STRETCH] @ q**2)
        steps = max(0, twin.start * int(constants.oversampling) - 1)
        update = steps // r.CONTROL_PERIOD * r.CONTROL_PERIOD
        limit = 0.25 * constants.tension
        drift = min(limit, max(-limit, constants.drift + constants.drift_rate * (update * constants.step)))
        pressed = 0.0 if twin.plausible is None else float(twin.plausible.chain["pressed"][0])
        above = tension - constants.tension - drift - pressed
        total += constants.tension_gain * (0.5 * constants.tension_per_stretch * stretch**2 - above * stretch)
    contacts: Iterable[tuple[ContactState, TouchParameters]] = zip(
        state.contact, parameters.touches, strict=True
    )
    for contact, touch in contacts:
        delta, k1, k2 = contact.s**2, touch.k1, touch.k2
        force = k1 * delta + k2 * delta**1.5
        total += 0.5 * k1 * delta**2 + 0.4 * k2 * delta**2.5 + 0.5 * contact.residual_compliance * force**2
        total += 0.5 * contact.bristle_stiffness * (contact.z**2 + contact.z_along**2)
    if twin.plausible is not None:
        more = Plausible(*(array[0] for array in twin.plausible))
        modes = more.mount_modes
        total += 0.5 * float(np.sum(modes["mass"] * (modes["v"] ** 2 + modes["square"] * modes["q"] ** 2)))
        for contact, touch, layer in zip(state.contact, parameters.touches, more.layers, strict=True):
            force = touch.k1 * contact.s**2 + touch.k2 * contact.s**3
            total += layer.thickness * (force - layer.load * np.log1p(force / layer.load))
        total += 0.5 * float(more.turnings["stiffness"] @ more.turnings["deflection"] ** 2)
        place, moved = more.coils["place"], more.coils["place"] - more.coils["place_before"]
        total += float(more.coils["pull"] @ (0.25 * moved**2 - 0.5 * place**2))
    return float(total)
