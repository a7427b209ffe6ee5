"""What every build is checked for: closed meshes, volumes, overlaps, clearances, and STEP files read back."""

from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import trimesh
from build123d import Compound, import_step

from hardware.cad.layout import Layout

VOLUME_TOLERANCE = 1e-3
"""Relative difference that a mesh's volume may have."""
BENCH = 2.0
"""Least height in mm of everything but the feet over the bench."""
OVERLAP_TOLERANCE = 1e-3
"""Volume in mm^3 below which a common body is the rounding of two faces that touch."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Clearance:
    """A distance between two bodies in mm, and the least that the design states."""

    first: str
    second: str
    distance: float
    least: float

    @property
    def kept(self) -> bool:
        """Whether it is as large as stated, up to a micrometre."""
        return self.distance >= self.least - 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """A part's STL: whether it is closed, its volume in mm^3, and the part's own."""

    name: str
    watertight: bool
    volume: float
    solid_volume: float

    @property
    def good(self) -> bool:
        """Whether it can be printed and is the part."""
        return self.watertight and abs(self.volume / self.solid_volume - 1.0) < VOLUME_TOLERANCE


def mesh(name: str, part: Compound, stl: Path) -> Mesh:
    """Return what trimesh, which knows nothing of the CAD kernel, says of a part's STL."""
    read = trimesh.load_mesh(stl)
    return Mesh(
        name=name, watertight=bool(read.is_watertight), volume=float(read.volume), solid_volume=part.volume
    )


def overlaps(bodies: dict[str, Compound]) -> dict[tuple[str, str], float]:
    """Return the pairs of bodies that share space, with the volume in mm^3."""
    found: dict[tuple[str, str], float] = {}
    boxes = {name: body.bounding_box() for name, body in bodies.items()}
    for first, second in combinations(bodies, 2):
        one, two = boxes[first], boxes[second]
        apart = (
            low.X > high.X or low.Y > high.Y or low.Z > high.Z
            for low, high in ((one.min, two.max), (two.min, one.max))
        )
        if any(apart):
            continue
        common = bodies[first] & bodies[second]
        shared = common.volume if hasattr(common, "volume") else 0.0
        if shared > OVERLAP_TOLERANCE:
            found[first, second] = shared
    return found


def stated(layout: Layout, bodies: dict[str, Compound]) -> list[tuple[str, str, float]]:
    """Return the clearances that the design states: two bodies and the least distance in mm."""
    hardware = layout.hardware
    pairs = [("tuner", "bar", 3.0), ("string_tail_1", "tuner_support", 1.0)]
    below = [name for name in bodies if name.startswith(("pole", "bobbin", "carrier", "ebow"))]
    pairs += [("string", name, hardware.pole_clearance) for name in below]
    blocks = ("tuner_support", "anchor")
    holders = ("ebow", "cradle") if hardware.driver == "ebow" else ("carrier", "base")
    for number, end in enumerate(blocks, start=1):
        pairs += [(end, f"{holder}_{number}", hardware.gap) for holder in holders]
    pairs.append((f"{holders[0]}_1", f"{holders[0]}_2", hardware.gap))
    if hardware.driver == "coil":
        pairs += [(f"bobbin_sense_{each}", f"bobbin_drive_{each}", hardware.gap) for each in (1, 2)]
        pairs += [(f"base_{each}", f"carrier_{each}", hardware.spring_gap) for each in (1, 2)]
    return pairs


def clearances(layout: Layout, bodies: dict[str, Compound]) -> list[Clearance]:
    """Return each stated clearance as it is in the assembly, and over the bench where it stands on feet."""
    found = [
        Clearance(first=first, second=second, distance=bodies[first].distance_to(bodies[second]), least=least)
        for first, second, least in stated(layout, bodies)
    ]
    if "foot_1" in bodies:
        bench = bodies["foot_1"].bounding_box().min.Z
        low = {
            name: body.bounding_box().min.Z for name, body in bodies.items() if not name.startswith("foot")
        }
        lowest = min(low, key=low.__getitem__)
        found.append(Clearance(first=lowest, second="bench", distance=low[lowest] - bench, least=BENCH))
    return found


def step_difference(part: Compound, step: Path) -> float:
    """Return the largest relative difference in volume, area and size between a part and its STEP file."""
    read = import_step(step)
    before = [part.volume, part.area, *part.bounding_box().size]
    after = [read.volume, read.area, *read.bounding_box().size]
    assert len(read.solids()) == len(part.solids())
    return max(abs(one / two - 1.0) for one, two in zip(after, before, strict=True))
