"""Materials as data: what a touching object is made of, one TOML file each, with its source."""

from dataclasses import dataclass
from pathlib import Path

from monochord.core.config import from_tree, load_toml
from monochord.core.errors import InputError
from monochord.core.presets import preset_names, preset_path
from monochord.core.units import Metres, MetresPerSecond, Pascals

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
"""Lowest and highest value that a touch on a string can mean, and the unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """An object that touches a steel string, with what is known of it.

    Elastic: `young_modulus` and `poisson_ratio`, and `radius`, the object's usual radius where it touches.
    Its `loss` is Hunt and Crossley's beta in s/m: f = k delta^1.5 (1 + beta d(delta)/dt), which a
    restitution e at a small impact speed v gives as 3 (1 - e) / (2 v). Sliding on steel: `friction_static`,
    `friction_kinetic` and the speed `stribeck_speed` by which the one has mostly fallen to the other. The
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


def material_names() -> list[str]:
    """Return the names of the presets, sorted.

    Examples
    --------
    >>> "wood" in material_names()
    True
    """
    return preset_names(__name__)


def load_material(name: str) -> Material:
    """Return a preset by its name, or read one from a file of your own.

    Parameters
    ----------
    name
        A name from `material_names`, or the path of a TOML file laid out as the presets are.

    Raises
    ------
    InputError
        If there is no such preset, or the file cannot be used.

    Examples
    --------
    >>> load_material("allen-key").young_modulus
    205000000000.0
    """
    return _read(preset_path(__name__, "material", name))


def _read(path: Path) -> Material:
    return from_tree(Material, {**load_toml(path), "name": path.stem}, f"material {path.stem}")
