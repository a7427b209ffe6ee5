"""Materials: what a touching object is made of, one TOML file each, with its source."""

from dataclasses import dataclass
from typing import Any

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.core.presets import Presets
from monochord.core.units import Metres, MetresPerSecond, Pascals

__all__ = ["Material", "load_material", "material_names"]

_RANGES = {
    "young_modulus": (1.0e3, 2.0e12, "Pa"),
    "poisson_ratio": (1.0e-3, 0.5, ""),
    "loss": (1.0e-4, 10.0, "s/m"),
    "friction_static": (0.01, 5.0, ""),
    "friction_kinetic": (0.01, 5.0, ""),
    "stribeck_speed": (1.0e-5, 1.0, "m/s"),
    "roughness": (1.0e-9, 1.0e-3, "m"),
    "roughness_length": (1.0e-7, 1.0e-2, "m"),
    "radius": (1.0e-4, 1.0, "m"),
}
"""Lowest and highest plausible value for an object on a string, and the unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """The material and shape of an object that touches a steel string.

    Elastic: `young_modulus` and `poisson_ratio`, and `radius`, the object's usual radius where it touches.
    Its `loss` is Hunt and Crossley's beta in s/m: f = k delta^1.5 (1 + beta d(delta)/dt), which a
    restitution e at a small impact speed v gives as 3 (1 - e) / (2 v). Sliding on steel: `friction_static`,
    `friction_kinetic` and the speed `stribeck_speed` at which the one has mostly fallen to the other. The
    surface has an rms height `roughness` that is correlated over `roughness_length`. `notes` says which
    values are assumed. SI units.

    References
    ----------
    Hunt and Crossley (1975), Coefficient of restitution interpreted as damping in vibroimpact, J. Appl. Mech.
    42, 440.
    """

    name: str
    title: str
    source: str
    young_modulus: Pascals
    poisson_ratio: float
    loss: float
    friction_static: float
    friction_kinetic: float
    stribeck_speed: MetresPerSecond
    roughness: Metres
    roughness_length: Metres
    radius: Metres
    notes: str = ""

    def __post_init__(self) -> None:
        for key, (lowest, highest, unit) in _RANGES.items():
            value: float = getattr(self, key)
            if not lowest <= value <= highest:
                given = f"material {self.name}.{key} {value:g} {unit}".rstrip()
                raise InputError(given, f"{lowest:g} to {highest:g} {unit}".rstrip())
        if self.friction_static < self.friction_kinetic:
            given = f"material {self.name}.friction_static {self.friction_static:g}"
            raise InputError(given, f"friction_kinetic ({self.friction_kinetic:g}) or more")


def _read(tree: dict[str, Any], where: str) -> Material:
    return from_tree(Material, tree, where)


MATERIALS = Presets(package=__name__, kind="material", read=_read)
material_names, load_material = MATERIALS.names, MATERIALS.load
