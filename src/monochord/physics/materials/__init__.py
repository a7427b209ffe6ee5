"""Materials of touching objects, one TOML file each, with its source."""

from dataclasses import dataclass
from functools import partial
from typing import Annotated

from msgspec import Meta

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.core.notebook import lines
from monochord.core.presets import Presets
from monochord.core.ranges import Checked
from monochord.core.units import Metres, MetresPerSecond, Pascals

__all__ = ["Material", "load_material", "material_names"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Material(Checked):
    """The material and shape of an object that touches a steel string.

    Elasticity: `young_modulus` and `poisson_ratio`, and `radius`, the object's usual radius at the contact.
    `loss` is Hunt and Crossley's beta in s/m: f = k delta^1.5 (1 + beta d(delta)/dt); a restitution e at a
    small impact speed v corresponds to 3 (1 - e) / (2 v). Sliding on steel: `friction_static`,
    `friction_kinetic`, and `stribeck_speed`, the speed of the transition between them. The surface has an rms
    height `roughness` with correlation length `roughness_length`. `notes` says which values are assumed. SI
    units; the ranges cover plausible objects on a string.

    References
    ----------
    Hunt and Crossley (1975), Coefficient of restitution interpreted as damping in vibroimpact, J. Appl. Mech.
    42, 440.
    """

    name: str
    title: str
    source: str
    young_modulus: Annotated[Pascals, Meta(ge=1000, le=2e12)]
    poisson_ratio: Annotated[float, Meta(ge=0.001, le=0.5)]
    loss: Annotated[float, Meta(ge=0.0001, le=10.0)]
    friction_static: Annotated[float, Meta(ge=0.01, le=5.0)]
    friction_kinetic: Annotated[float, Meta(ge=0.01, le=5.0)]
    stribeck_speed: Annotated[MetresPerSecond, Meta(ge=1e-5, le=1.0)]
    roughness: Annotated[Metres, Meta(ge=1e-9, le=0.001)]
    roughness_length: Annotated[Metres, Meta(ge=1e-7, le=0.01)]
    radius: Annotated[Metres, Meta(ge=0.0001, le=1.0)]
    notes: str = ""

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.friction_static < self.friction_kinetic:
            given = f"material {self.name}.friction_static {self.friction_static:g}"
            raise InputError(given, f"friction_kinetic ({self.friction_kinetic:g}) or more")

    def __repr__(self) -> str:
        return lines(
            f"Material: {self.name}, {self.title}",
            [
                ("young modulus", f"{1e-9 * self.young_modulus:.3g} GPa"),
                ("friction", f"{self.friction_static:g} static, {self.friction_kinetic:g} kinetic"),
                ("radius", f"{1e3 * self.radius:g} mm"),
                ("roughness", f"{1e6 * self.roughness:.3g} um"),
            ],
        )


MATERIALS = Presets(package=__name__, kind="material", read=partial(from_tree, Material))
material_names, load_material = MATERIALS.names, MATERIALS.load
