"""How objects are held: three classes of mount, drawn by seed.

Seen from the string, object, gripper and frame are a dynamic stiffness between 300 and 5,000 Hz: one to three
modes, and a spring for all that is faster. Of a class, each mode's mass lies in one range, and the stiffness
of every mode and of the spring in another, so that spring and modes fit each other; frequencies follow.

A bolted or gripped object of 50 to 500 g stands on bolts, jaws and a wrist. A light one of 2 to 50 g, such as
a pen or a key between two fingers, stands on pads. A soft mount, such as a rubber pad or a limp grip, is a
special condition, which evaluations report apart.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi

from monochord.core.units import Hertz
from monochord.physics.setup import Mount, MountKind, MountMode
from monochord.physics.twin.variation import log_uniform, random_stream

MOUNT_MODES = 1, 3
MOUNT_FREQUENCY: tuple[Hertz, Hertz] = (300.0, 5000.0)
"""Of a mode: below, a mass of these ranges hardly moves; above, the spring stands for it."""
MOUNT_QUALITY = 5.0, 50.0
"""Assumed: rubber pads to bare metal."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MountClass:
    """How often a class is drawn, and its ranges: modal mass in kg, stiffness in N/m."""

    share: float
    mass: tuple[float, float]
    stiffness: tuple[float, float]


CLASSES: Mapping[MountKind, MountClass] = {
    "bolted": MountClass(share=0.70, mass=(50e-3, 500e-3), stiffness=(1e6, 1e8)),
    "light": MountClass(share=0.25, mass=(2e-3, 50e-3), stiffness=(1e5, 1e7)),
    "soft": MountClass(share=0.05, mass=(2e-3, 50e-3), stiffness=(1e4, 1e5)),
}
"""Shares assumed, as tools are held in robots. Ranges: an M3 bolt or a steel jaw is some 1e8 N/m, a printed
part or a robot's joint 1e6 to 1e7, a fingertip or a rubber pad 1e4 to 1e5 at these frequencies (orders of
magnitude by E A / l of such parts)."""


def drawn_mount(name: str, seed: int, kind: MountKind = "") -> Mount:
    """Return the mount of an object by its name and a seed, of a class that is drawn too if none is given.

    >>> drawn_mount("plastic", 4).kind
    'bolted'
    """
    kind = kind or drawn_kind(name, seed)
    allowed = CLASSES[kind]
    modes = tuple(_mode(f"mode {i} under {name}", allowed, seed) for i in range(_count(name, seed)))
    spring = log_uniform(seed, f"spring under {name}", allowed.stiffness)
    return Mount(modes=modes, compliance=1.0 / spring, kind=kind)


def drawn_kind(name: str, seed: int) -> MountKind:
    """Return the class of the mount of an object by its name and a seed."""
    draw = float(random_stream(seed, f"class of the mount under {name}").random())
    for kind, allowed in CLASSES.items():
        if draw < allowed.share:
            return kind
        draw -= allowed.share
    return "soft"


def _count(name: str, seed: int) -> int:
    return int(random_stream(seed, f"modes under {name}").integers(MOUNT_MODES[0], MOUNT_MODES[1] + 1))


def _mode(name: str, allowed: MountClass, seed: int) -> MountMode:
    """Return a mode whose frequency is as even as the ranges of mass and stiffness allow."""
    low, high = allowed.stiffness
    least, most = (_frequency(k, m) for k, m in zip(allowed.stiffness, reversed(allowed.mass), strict=True))
    band = max(least, MOUNT_FREQUENCY[0]), min(most, MOUNT_FREQUENCY[1])
    frequency = log_uniform(seed, f"frequency of {name}", band)
    square = (2.0 * pi * frequency) ** 2
    masses = max(allowed.mass[0], low / square), min(allowed.mass[1], high / square)
    return MountMode(
        mass=log_uniform(seed, f"mass of {name}", masses),
        frequency=frequency,
        quality=log_uniform(seed, f"quality of {name}", MOUNT_QUALITY),
    )


def _frequency(stiffness: float, mass: float) -> Hertz:
    return float((stiffness / mass) ** 0.5 / (2.0 * pi))
