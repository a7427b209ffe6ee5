"""The wound coils of the budget driver: turns, resistance, heat and an estimate of the force. SI units."""

from collections.abc import Callable
from dataclasses import dataclass
from math import pi, sqrt

from hardware.cad.parameters import Hardware
from monochord.core.errors import InputError

WIRES = {30: 255e-6, 32: 202e-6, 34: 160e-6, 36: 127e-6, 38: 101e-6, 40: 79.9e-6}
"""Bare diameter of enamelled copper wire by its AWG number, in m."""
ENAMEL = 1.13
"""Outer over bare diameter (assumed: single build)."""
PACKING = 0.85
"""Share of a square grid that a hand-wound coil reaches (assumed)."""
RESISTIVITY = 1.724e-8
"""Of annealed copper at 20 C, in ohm m."""
LEAST_RESISTANCE = 8.0
"""Ohms that a small amplifier drives without overheating."""
VACUUM = 4e-7 * pi


@dataclass(frozen=True, slots=True, kw_only=True)
class Winding:
    """One coil: wire by AWG, turns, resistance in ohm, and its inductance without a core in H (Wheeler)."""

    awg: int
    turns: int
    resistance: float
    inductance: float


def window(hardware: Hardware) -> tuple[float, float, float]:
    """Return the inner radius, depth and height of a bobbin's winding, in m."""
    inner = hardware.pole_diameter / 2 + hardware.fit / 2 + 0.75
    depth = hardware.bobbin_diameter / 2 - 0.25 - inner
    return 1e-3 * inner, 1e-3 * depth, 1e-3 * (hardware.bobbin_height - 2.0)


def winding(hardware: Hardware, least: float = LEAST_RESISTANCE) -> Winding:
    """Return the winding of the thickest wire with which a full bobbin has at least this resistance.

    Turns are cut back to that resistance. Inductance is Wheeler's 31.5e-6 N^2 r^2 / (6 r + 9 l + 10 c), SI.

    Examples
    --------
    >>> from hardware.cad.parameters import load_hardware
    >>> coil = winding(load_hardware("prototype"))
    >>> coil.awg, coil.turns
    (34, 391)
    """
    inner, depth, height = window(hardware)
    mean = inner + depth / 2.0
    for awg, bare in WIRES.items():
        room = int(PACKING * depth * height / (ENAMEL * bare) ** 2)
        per_turn = RESISTIVITY * 2.0 * pi * mean / (pi / 4.0 * bare**2)
        turns = round(least / per_turn)
        if turns <= room:
            inductance = 31.5e-6 * turns**2 * mean**2 / (6.0 * mean + 9.0 * height + 10.0 * depth)
            return Winding(awg=awg, turns=turns, resistance=turns * per_turn, inductance=inductance)
    given = f"a bobbin of {hardware.bobbin_diameter:g} mm"
    raise InputError(given, f"room for {least:g} ohm of AWG {max(WIRES)}", "move the coils apart")


@dataclass(frozen=True, slots=True, kw_only=True)
class Pull:
    """What a pole does to the string: force in N/A, static pull in N, negative stiffness in N/m."""

    per_ampere: float
    static: float
    stiffness: float


def pull(hardware: Hardware, *, clearance: float, remanence: float = 1.2, core: float = 3.0) -> Pull:
    """Estimate the force of a coil with a steel pole and a magnet behind it, right to a factor of 3.

    The wire is magnetised across its axis, M = 2 B / mu0, over a length of twice the pole's diameter; the
    force is V (2 / mu0) B dB/dz. B is the field on the axis: the coil's as that of a thin solenoid times
    `core`, the rise that a short rod brings (assumed); the magnet's as if it stood at the pole's face,
    times a third for the flux that leaks from the pole on its way (assumed).
    """
    inner, depth, height = window(hardware)
    radius, coil = inner + depth / 2.0, winding(hardware)
    pole, magnet = 0.5e-3 * hardware.pole_diameter, 1e-3 * hardware.magnet_height
    volume = pi / 4.0 * (1e-3 * hardware.wire) ** 2 * 4.0 * pole

    def solenoid(z: float, length: float, r: float) -> float:
        return ((z + length) / sqrt(r**2 + (z + length) ** 2) - z / sqrt(r**2 + z**2)) / 2.0

    def steady(z: float) -> float:
        return remanence / 3.0 * solenoid(z, magnet, pole)

    def moving(z: float) -> float:
        return core * VACUUM * coil.turns / height * solenoid(z + 1e-3, height, radius)

    def slope(field: Callable[[float], float], z: float) -> float:
        step = 1e-5
        return (field(z - step) - field(z + step)) / (2.0 * step)

    factor = volume * 2.0 / VACUUM

    def static(z: float) -> float:
        return factor * steady(z) * slope(steady, z)

    force = factor * (
        steady(clearance) * slope(moving, clearance) + moving(clearance) * slope(steady, clearance)
    )
    return Pull(per_ampere=force, static=static(clearance), stiffness=slope(static, clearance))
