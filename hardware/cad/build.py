"""Builds one sensor: files, checks, and a report of both."""

import json
import re
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hardware.cad import checks, export
from hardware.cad.assembly import assembled, made
from hardware.cad.checks import Clearance, Mesh
from hardware.cad.layout import Layout
from hardware.cad.parameters import Hardware
from hardware.cad.physics import physics
from monochord.core.errors import InputError

STEP_TOLERANCE = 1e-9
"""Relative difference that a part's STEP file may have."""
DENSITY = {"bar": 7.85e-3}
"""In g/mm^3; every other part is printed in PLA."""
PLA = 1.24e-3
STAGES = {
    "step_1_blocks": ("bar", "tuner_support", "anchor", "saddle_pin", "screw_block", "nut_block"),
    "step_2_microphones": ("microphone", "clamp", "screw_microphone"),
    "step_3_drivers": ("base", "carrier", "cradle", "ebow", "bobbin", "pole", "magnet", "screw", "nut"),
    "step_4_string": ("string", "tuner"),
}
"""First words of the bodies that each step of the assembly adds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """What was built and what its checks say."""

    sensor: str
    meshes: list[Mesh]
    clearances: list[Clearance]
    overlaps: dict[str, float]
    step_difference: float
    seconds: float

    @property
    def faults(self) -> list[str]:
        """What does not hold, a line each."""
        lines = [f"{each.name}: the mesh is open, or not the part" for each in self.meshes if not each.good]
        lines += [f"{pair} share {volume:.3g} mm^3" for pair, volume in self.overlaps.items()]
        lines += [
            f"{each.first} and {each.second}: {each.distance:.2f} mm apart, stated {each.least:.2f}"
            for each in self.clearances
            if not each.kept
        ]
        different = self.step_difference >= STEP_TOLERANCE
        return [*lines, f"STEP files differ by {self.step_difference:.1e}"] if different else lines

    @property
    def good(self) -> bool:
        """Whether everything holds that a build is checked for."""
        return not self.faults


def build(hardware: Hardware, out: Path, *, pictures: bool = True) -> Report:
    """Write all files of one sensor into a folder, check them, and write the report beside them."""
    out.mkdir(parents=True, exist_ok=True)
    begun, layout = time.process_time(), Layout(hardware)
    parts, meshes, difference = _possible(layout), list[Mesh](), 0.0
    for name, part in parts.items():
        step, stl = export.write_part(name, part, out)
        meshes.append(checks.mesh(name, part, stl))
        difference = max(difference, checks.step_difference(part, step))
    overlaps: dict[str, float] = {}
    clearances: list[Clearance] = []
    for stand in ("gripper", "feet"):
        bodies = assembled(layout, parts, stand=stand)
        overlaps |= {" and ".join(pair): volume for pair, volume in checks.overlaps(bodies).items()}
        clearances = checks.clearances(layout, bodies)
        export.write_assembly(bodies, out / f"assembly_{stand}.step")
        if pictures:
            export.picture(bodies, out / f"assembly_{stand}.svg")
            _draw(bodies, out, stand)
    if pictures:
        for name, part in parts.items():
            export.picture({name: part}, out / f"{name}.svg", hidden=True)
    report = Report(
        sensor=hardware.sensor.name,
        meshes=meshes,
        clearances=clearances,
        overlaps=overlaps,
        step_difference=difference,
        seconds=time.process_time() - begun,
    )
    content = {**asdict(report), "good": report.good, **physics(hardware), "mass": _mass(meshes)}
    text = json.dumps(content, indent=1)
    (out / "report.json").write_text(text + "\n", encoding="utf-8")
    return report


def _possible(layout: Layout) -> dict[str, Any]:
    """Return the parts, or say which dimensions make none."""
    given = f"sensor '{layout.hardware.sensor.name}'"
    expected, remedy = "dimensions that leave every part some material", "--set fewer, or smaller changes"
    try:
        parts = made(layout)
    except Exception as error:  # the kernel's errors share no base class
        raise InputError(f"{given} ({type(error).__name__})", expected, remedy) from error
    empty = [each for each, part in parts.items() if len(part.solids()) != 1 or not part.volume > 0.0]
    if empty:
        raise InputError(f"{given} with {', '.join(empty)} empty or in pieces", expected, remedy)
    return parts


def _mass(meshes: list[Mesh]) -> dict[str, float]:
    """Return the mass of each part in grams, printed ones as if they were solid."""
    return {each.name: round(each.volume * DENSITY.get(each.name, PLA), 1) for each in meshes}


def _draw(bodies: dict[str, Any], out: Path, stand: str) -> None:
    """Draw the steps of the assembly, and it from the side."""
    if stand != "feet":
        return
    shown: dict[str, Any] = {}
    for file, words in STAGES.items():
        shown |= {name: bodies[name] for name in bodies if name.startswith(words) and "foot" not in name}
        export.picture(shown, out / f"{file}.svg")
    export.picture(bodies, out / "assembly_side.svg", "side")
    words = (*STAGES["step_3_drivers"][:-2], "screw_base", "screw_height", "nut_base", "nut_height")
    of_first = re.compile(rf"({'|'.join(words)})(_[a-z]+)?_1(_at_\d)?")
    driver = {name: each for name, each in bodies.items() if of_first.fullmatch(name)}
    export.picture(driver, out / "driver.svg", hidden=True)
