"""By how much an object that gives way lengthens both segments of a touched string: mount and contact.

A support of compliance C at a touch lengthens each segment by T C(w), C being taken at that segment's line:
below a mode of the mount it gives way as a spring, above it the mode's mass resists and the segment is
shortened. Sizes are those of the world `plausible`, see `monochord.physics.twin.held`.
"""

from dataclasses import dataclass
from functools import cache
from math import pi
from typing import Literal

import numpy as np

from monochord.core.types import Floats, StringParams
from monochord.core.units import Metres, Newtons
from monochord.physics.materials import Material
from monochord.physics.setup import MountKind
from monochord.physics.theory import hertz_stiffness
from monochord.physics.twin.held import drawn_mount

MountName = Literal["bolted", "light", "soft", "known"]
DRAWS = 600
"""Mounts of a class that are drawn."""
CENTRAL = 16.0, 84.0
"""Percentiles whose distance is two standard deviations of a normal error: resonances have long tails."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lengthening:
    """Standard error in m of each segment's lengthening, and the correlation of both."""

    std: Metres
    correlation: float


def lengthening(
    string: StringParams,
    frequencies: Floats,
    *,
    mount: MountName,
    contact: float,
    contact_share: float,
) -> Lengthening:
    """Return how uncertain the lengthening of both segments is, with lines at `frequencies` (2,) in Hz.

    A `mount` of a class is drawn anew for each object; ``known`` has no spread. The surface's compliance
    `contact` in m/N, see `contact_compliance`, is the same for both segments, known to `contact_share` of it.

    >>> string = StringParams(length=0.2, linear_density=3.978e-4, tension=65.0)
    >>> lines = np.array([1312.0, 1644.0])
    >>> each = {
    ...     mount: lengthening(string, lines, mount=mount, contact=0.0, contact_share=0.0)
    ...     for mount in ("bolted", "light", "soft", "known")
    ... }
    >>> [round(1e6 * one.std) for one in each.values()]
    [21, 257, 1794, 0]
    """
    surface = string.tension * contact * contact_share
    if mount == "known":
        return Lengthening(std=surface, correlation=1.0)
    moved = string.tension * _compliances(mount, frequencies)
    one, other, both = (
        0.5 * float(np.diff(np.percentile(values, CENTRAL))[0]) for values in (*moved, moved.sum(axis=0))
    )
    square = 0.5 * (one**2 + other**2)
    shared = min(max(0.5 * both**2 - square, -square), square)
    whole = square + surface**2
    return Lengthening(std=whole**0.5, correlation=(shared + surface**2) / whole)


def contact_compliance(string: StringParams, material: Material, force: Newtons) -> float:
    """Return the compliance of a smooth, round surface under a press, in m/N: 2 / (3 k^(2/3) F^(1/3)), Hertz.

    >>> from monochord.physics.materials import load_material
    >>> string = StringParams(length=0.2, linear_density=3.978e-4, tension=65.0)
    >>> round(65e6 * contact_compliance(string, load_material("plastic"), 1.0))
    165
    """
    stiffness = hertz_stiffness(string, material.radius, material.young_modulus, material.poisson_ratio)
    return 2.0 / (3.0 * stiffness ** (2.0 / 3.0) * force ** (1.0 / 3.0))


def _compliances(mount: MountKind, frequencies: Floats) -> Floats:
    """Return the real part of each drawn mount's compliance at each frequency, (n, draws) in m/N."""
    spring, compliance, resonance, quality = _drawn(mount)
    detuning = frequencies[:, None, None] / resonance
    modes = compliance / (1.0 - detuning**2 + 1j * detuning / quality)
    return spring + modes.real.sum(axis=-1)


@cache
def _drawn(mount: MountKind) -> tuple[Floats, Floats, Floats, Floats]:
    """Return drawn mounts: spring (draws,), and each mode's compliance, frequency and quality (draws, 3)."""
    mounts = [drawn_mount("", seed, mount) for seed in range(DRAWS)]
    modes = np.ones((DRAWS, 3, 3)) * [0.0, 1.0, 1.0]
    for number, each in enumerate(mounts):
        for at, mode in enumerate(each.modes):
            stiffness = mode.mass * (2.0 * pi * mode.frequency) ** 2
            modes[number, at] = 1.0 / stiffness, mode.frequency, mode.quality
    return np.array([each.compliance for each in mounts]), modes[..., 0], modes[..., 1], modes[..., 2]
