"""The hardware's dimensions come from the sensor, and its pages say the same. Needs no CAD library."""

import csv
import doctest
import math
import os
import re
import subprocess
import sys
from dataclasses import replace
from importlib import import_module
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from hardware.cad import __main__ as command
from hardware.cad import coil, mechanics
from hardware.cad.crosstalk import feedthrough, mutual_inductance
from hardware.cad.ebow import BATTERY, refuse_ebows_that_do_not_fit, room_above, room_below
from hardware.cad.layout import ADAPTER_SCREW, Layout
from hardware.cad.parameters import EBOW, UNMEASURED, Hardware, load_hardware
from hardware.cad.physics import physics
from hardware.signal_cost import PLACES, mirrored
from hardware.wiring import __main__ as wiring
from hardware.wiring.figures import follower, low_corner

from monochord.core.errors import InputError
from monochord.physics.sensors import load_sensor, sensor_names
from monochord.physics.theory import bending_stiffness
from monochord.physics.theory.tension import STRENGTH

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "hardware"
PAGES = {page: page.read_text(encoding="utf-8") for page in sorted(FOLDER.rglob("*.md"))}
README = PAGES[FOLDER / "README.md"]
MEASURED = {
    "ebow_length": 90.0,
    "ebow_width": 36.0,
    "ebow_height": 25.0,
    "ebow_coil_spacing": 25.0,
    "ebow_end_to_sense": 32.0,
}
"""An EBow made up for these tests."""
CASE = {
    "ebow_length": 92.0,
    "ebow_width": 37.0,
    "ebow_height": 38.0,
    "ebow_coil_spacing": 30.0,
    "ebow_end_to_sense": 8.0,
}
"""The EBow that `prototype_ebow` has room for, with the size that its pictures assume."""


def run(*arguments: str) -> "subprocess.CompletedProcess[str]":
    words = [sys.executable, "-m", "hardware.cad", *arguments]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "src")])}
    return subprocess.run(
        words, cwd=ROOT, env=environment, capture_output=True, text=True, check=False, timeout=240
    )


def table(text: str, header: str) -> list[list[str]]:
    """Return the cells of the rows below a table's header."""
    _, _, rest = text.partition(header)
    rows = rest.partition("\n\n")[0].splitlines()[2:]
    return [[cell.strip() for cell in row[1:-1].split("|")] for row in rows]


@pytest.mark.parametrize("name", sensor_names())
def test_length_and_coils_are_those_of_the_sensor(name: str) -> None:
    hardware, sensor = load_hardware(name), load_sensor(name)
    assert hardware.length == pytest.approx(1e3 * sensor.string.length)
    assert hardware.wire == pytest.approx(1e3 * sensor.string.core_diameter)
    for (sense, drive), driver in zip(hardware.coils, sensor.drivers, strict=True):
        assert (sense, drive) == pytest.approx((1e3 * driver.sense, 1e3 * driver.drive))
    ends = [Layout(hardware).drivers[0], Layout(hardware).drivers[-1]]
    assert ends[0].x - ends[0].length / 2 - hardware.front >= hardware.gap - 1e-9
    assert hardware.length - hardware.front - ends[1].x - ends[1].length / 2 >= hardware.gap - 1e-9


def test_another_sensor_changes_what_follows_from_it_and_nothing_else() -> None:
    short, long = load_hardware("prototype"), load_hardware("long")
    assert long.bar_length - short.bar_length == pytest.approx(450.0 - 2 * (long.front - short.front))
    assert (short.bobbin_diameter, long.bobbin_diameter) == (10.0, 14.0)
    assert long.pole_clearance > 2 * short.pole_clearance  # its range reaches nearer to its coils
    assert (short.bar_width, short.pin_diameter, short.block_length) == (
        long.bar_width,
        long.pin_diameter,
        long.block_length,
    )


def test_a_sensor_of_ones_own_is_a_file(tmp_path: Path) -> None:
    text = (FOLDER / "sensor_300.toml").read_text(encoding="utf-8")
    file = tmp_path / "own.toml"
    file.write_text(text.replace("length = 0.3", "length = 0.31"), encoding="utf-8")
    assert load_hardware(str(file)).length == pytest.approx(310.0)
    file.write_text(text.replace("sense = 0.020", "sense = 0.008"), encoding="utf-8")
    with pytest.raises(InputError, match=r"8\.0 mm from an end: expected .* mm or more"):
        load_hardware(str(file))


@pytest.mark.parametrize("name", [*sensor_names(), "hardware/sensor_300.toml"])
def test_no_two_holes_of_the_bar_meet(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    holes = Layout(load_hardware(name)).holes
    assert len(holes) == 14
    for one, two in combinations(holes, 2):
        distance = math.hypot(one.x - two.x, one.y - two.y)
        assert distance - (one.diameter + two.diameter) / 2 > 2.0


def test_every_unmeasured_dimension_is_a_field_and_is_listed_with_its_value() -> None:
    rows = {row[0].strip("`"): row[1:] for row in table(README, "| name | assumed, mm |")}
    hardware = load_hardware("prototype")
    assert rows.keys() == UNMEASURED.keys()
    for name, (value, how) in rows.items():
        assert how == UNMEASURED[name]
        assert value == (f"{hardware.assumed[name]:g}" if name in hardware.assumed else "none")
    assert not set(EBOW) & hardware.assumed.keys()


def test_the_figures_on_the_page_are_those_of_the_design() -> None:
    rows = table(README, "| figure | `prototype` | `long` | `prototype_ebow`, its EBows 92 x 37 x 38 mm |")
    assert len(rows) > 15
    built = load_hardware("prototype"), load_hardware("long"), load_hardware("prototype_ebow", "ebow", **CASE)
    for index, figures in enumerate(map(physics, built), start=1):
        for row in rows:
            assert float(row[index]) == pytest.approx(figures[row[0].strip("`")], rel=6e-3), row[0]
    prototype = physics(load_hardware("prototype"))
    for frame, cents in table(README, "| frame, blocks | cents a kelvin, `prototype` |"):
        words = (
            frame.replace(" (the paper's bar)", "")
            .replace("plain ", "")
            .replace("stainless steel", "stainless")
        )
        bar, blocks = words.split(", ")
        assert float(cents) == pytest.approx(
            prototype[f"drift_{bar}_with_{blocks}_blocks_cents_per_K"], abs=6e-3
        )


def test_both_lists_of_materials_agree() -> None:
    with (FOLDER / "bom.csv").open(encoding="utf-8", newline="") as file:
        listed = [list(row.values()) for row in csv.DictReader(file)]
    titles = {"both": "## Both variants", "paper": "## The paper's parts", "budget": "## Budget"}
    page = PAGES[FOLDER / "bom.md"]
    shown = [
        [variant, *row]
        for variant, title in titles.items()
        for row in table(page.partition(title)[2], "| item | quantity | part | dimension |")
    ]
    assert [[cell.strip() for cell in row] for row in listed] == shown
    assert {row[0] for row in listed} == titles.keys()
    bar = load_hardware("prototype").bar_length
    assert f"{bar:g} mm for prototype" in next(row[4] for row in listed if row[1] == "bar")
    assert f"{load_hardware('long').bar_length:g} mm for long" in next(
        row[4] for row in listed if row[1] == "bar"
    )


def test_every_page_says_that_nobody_has_built_it() -> None:
    for page in (*PAGES, ROOT / "docs/how-to/build-a-sensor.md"):
        text = " ".join(page.read_text(encoding="utf-8").split())
        assert re.search(r"No person has built|no person yet", text), page
        for target in re.findall(r"\]\(([^)#:\s]+)", text):
            assert (page.parent / target).exists(), (page, target)
    assert len(PAGES) >= 6


def test_two_stock_ebows_do_not_fit_below_the_prototypes_string() -> None:
    hardware = load_hardware("prototype", "ebow")
    below, above = room_below(hardware), room_above(hardware)
    assert below.spacings == pytest.approx((13.0, 11.0))
    assert below.off == pytest.approx(0.5)
    assert below.length == pytest.approx(27.6)
    assert below.length < BATTERY[0] < above.length == pytest.approx(52.0)
    with pytest.raises(InputError, match=r"ebow_length \(not measured\): .* measure it"):
        refuse_ebows_that_do_not_fit(hardware)
    with pytest.raises(InputError, match="coils 25 mm apart: expected 13 and 11 mm"):
        refuse_ebows_that_do_not_fit(load_hardware("prototype", "ebow", **MEASURED))
    with pytest.raises(InputError, match="an EBow of 90 mm"):
        refuse_ebows_that_do_not_fit(
            load_hardware(
                "prototype", "ebow", **{**MEASURED, "ebow_coil_spacing": 12.0, "ebow_end_to_sense": 9.0}
            )
        )
    refuse_ebows_that_do_not_fit(load_hardware("long", "ebow", **MEASURED))


def test_mirrored_drivers_have_room_and_couple_less_the_farther_apart_they_are() -> None:
    rows = {row[0]: row for row in table(README, "| drivers, simulated | answered |")}
    assert len(rows) == 1 + len(PLACES)
    for sense, spacing in PLACES:
        hardware = Hardware(sensor=mirrored(sense, spacing))
        room, before = room_below(hardware), 1e3 * sense - 7.0
        assert (room.length, room.before, room.off) == pytest.approx((92.5, before, 0.0), abs=1e-9)
        coupled = feedthrough(hardware, 0)
        assert coupled == pytest.approx(feedthrough(hardware, 1))
        row = rows[f"mirrored, coils at {1e3 * sense:g} and {1e3 * (sense + spacing):g} mm"]
        assert row[-2:] == [f"{before:g} mm", f"{coupled:.0f} dB"]


def test_two_ebows_fit_below_the_string_of_prototype_ebow() -> None:
    hardware = load_hardware("prototype_ebow", "ebow", **CASE)
    refuse_ebows_that_do_not_fit(hardware)
    (first, last), sensor = hardware.faces, hardware.sensor
    assert (first, last) == ((7.0, 99.0), (101.0, 193.0))
    assert all(1e-3 * place < sensor.range[0] for place in hardware.coils[0])
    with pytest.raises(InputError, match=r"an EBow of 93 mm: expected at most 8\.0 mm before"):
        refuse_ebows_that_do_not_fit(load_hardware("prototype_ebow", "ebow", **{**CASE, "ebow_length": 93.0}))
    layout = Layout(hardware)
    bases = [(each.x - each.base / 2, each.x + each.base / 2) for each in layout.drivers]
    for x in (*layout.feet, 100.0 - ADAPTER_SCREW, 100.0 + ADAPTER_SCREW):
        assert all(not start - 4.0 < x < end + 4.0 for start, end in bases)
    assert len(layout.feet) == 2


def test_a_press_anywhere_in_the_range_leaves_the_string_above_a_case() -> None:
    hardware = load_hardware("prototype_ebow", "ebow", **CASE)
    string = hardware.sensor.string
    length, lowest = string.length, 0.0
    for press in np.linspace(*hardware.sensor.range, 41):
        for start, end in hardware.faces:
            place = np.linspace(1e-3 * start, 1e-3 * end, 93)
            near, far = np.minimum(press, place), np.maximum(press, place)
            lowest = max(lowest, float((2.0 * near * (length - far) / (string.tension * length)).max()))
    assert 1e-3 * hardware.sag >= lowest
    assert hardware.sag == pytest.approx(1e3 * lowest, rel=0.02)
    assert hardware.pole_clearance > hardware.sag > load_hardware("prototype_ebow").sag


def test_the_wire_reaches_its_strength_at_the_break_angle_and_not_before() -> None:
    string = load_sensor("prototype").string
    angle = mechanics.elastic_break_angle(string)
    curvature = angle / (2.0 * math.sqrt(bending_stiffness(string) / string.tension))
    surface = mechanics.stress(string) + string.young_modulus * string.core_diameter / 2.0 * curvature
    assert surface == pytest.approx(STRENGTH)
    assert mechanics.downforce(string, angle) == pytest.approx(65.0 * math.sin(math.radians(6.143)), rel=1e-3)
    assert mechanics.elastic_break_angle(replace(string, tension=160.0)) == 0.0


def test_cents_of_a_frame_are_those_of_the_string_it_slackens() -> None:
    string = load_sensor("prototype").string
    stretch = 1e-6 / string.length * string.young_modulus * math.pi / 4 * string.core_diameter**2
    lower = 1200.0 * math.log2(math.sqrt(1.0 - stretch / string.tension))
    assert -lower == pytest.approx(1e-6 * mechanics.cents_per_metre(string), rel=2e-3)
    drift = mechanics.thermal_cents(string, frame="aluminium", block="aluminium", offset=0.0)
    assert drift == pytest.approx(1.52, abs=0.01)
    assert mechanics.thermal_cents(string, frame="steel", block="steel", offset=3.5e-3) == 0.0


def test_a_coil_has_its_resistance_and_room_for_its_turns() -> None:
    sizes = [load_hardware("long", bobbin_limit=each) for each in np.arange(7.5, 14.0, 0.25)]
    for hardware in (*sizes, *map(load_hardware, sensor_names())):
        wound = coil.winding(hardware)
        inner, depth, height = coil.window(hardware)
        bare = coil.WIRES[wound.awg]
        length = 2.0 * math.pi * (inner + depth / 2.0) * wound.turns
        resistance = coil.RESISTIVITY * length / (math.pi / 4.0 * bare**2)
        assert resistance == pytest.approx(wound.resistance) == pytest.approx(8.0, abs=0.1)
        assert wound.turns * (coil.ENAMEL * bare) ** 2 <= coil.PACKING * depth * height
    hardware = load_hardware("prototype")
    near, far = (coil.pull(hardware, clearance=each).per_ampere for each in (1e-3, 2e-3))
    assert near > 2.0 * far


def neumann(radius: float, spacing: float, height: float) -> float:
    """Return the mutual inductance of two solenoids of one turn side by side (Neumann)."""
    angle = np.linspace(0.0, 2.0 * math.pi, 40, endpoint=False)
    loop = radius * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    step = radius * np.stack([-np.sin(angle), np.cos(angle), 0.0 * angle], axis=1) * (2.0 * math.pi / 40)
    levels = np.linspace(-height / 2.0, height / 2.0, 8)
    total = 0.0
    for low in levels:
        for high in levels:
            apart = loop[:, None] - loop[None] - np.array([spacing, 0.0, high - low])
            total += float(np.sum((step @ step.T) / np.linalg.norm(apart, axis=2)))
    return -1e-7 * total / len(levels) ** 2


def test_feedthrough_is_that_of_two_solenoids_within_4_db() -> None:
    hardware = load_hardware("prototype")
    inner, depth, height = coil.window(hardware)
    turns = coil.winding(hardware).turns
    for spacing, least in ((11e-3, 0.6), (13e-3, 0.7), (25e-3, 0.9)):
        exact = turns**2 * neumann(inner + depth / 2.0, spacing, height)
        assert least < exact / mutual_inductance(hardware, spacing) < 1.0
    assert feedthrough(hardware, 1) > feedthrough(hardware, 0) > 40.0  # 11 mm apart, and 13


def test_any_jfet_of_the_type_has_room_in_the_buffer() -> None:
    for cutoff, saturation in ((-0.5, 2e-3), (-1.5, 8e-3), (-3.0, 20e-3)):
        point = follower(cutoff=cutoff, saturation=saturation)
        assert point.current == pytest.approx(
            saturation * (1.0 - (3.0 - point.voltage) / cutoff) ** 2, rel=1e-6
        )
        assert 9.0 - point.voltage > -cutoff + 0.5  # stays saturated
        assert 0.93 < point.gain < 0.97
    assert low_corner(15e-9) == pytest.approx(1.06, abs=0.01)


def test_the_drawn_circuits_are_those_of_the_script(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wiring, "HERE", tmp_path)
    wiring.main()
    page = PAGES[FOLDER / "wiring" / "wiring.md"]
    for name in ("piezo_buffer.svg", "coil_driver.svg"):
        drawn = (tmp_path / name).read_text(encoding="utf-8")
        assert drawn == (FOLDER / "wiring" / name).read_text(encoding="utf-8")
        parts = re.findall(r">([A-Z]\d+)\b", drawn)
        assert len(parts) > 6
        assert not [part for part in parts if not re.search(rf"\b{part}\b", page)]


def test_the_command_prints_figures_without_a_cad_library() -> None:
    done = run("prototype", "long", "--physics")
    assert done.returncode == 0, done.stderr
    assert "# prototype" in done.stdout
    assert "# long" in done.stdout
    assert re.search(r"^break_angle_deg +6\.143$", done.stdout, re.MULTILINE)


def test_the_command_refuses_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    done = run("nothing")
    assert (done.returncode, done.stdout) == (2, "")
    assert "nothing" in done.stderr
    for arguments, line in (
        (["prototype", "--set", "pole=1"], "dimension 'pole': expected one of"),
        (["prototype", "--set", "fit=wide"], "--set fit=wide: expected NAME=MM"),
        (["prototype", "--set", "fit=nan"], "fit = nan mm: expected 0.05 to 0.8 mm"),
        (["prototype", "--driver", "ebow"], "ebow_length (not measured)"),
    ):
        assert command.main(arguments) == 2
        error = capsys.readouterr().err
        assert len(error.strip().splitlines()) == 1
        assert line in error


def test_the_examples_in_the_docstrings_run() -> None:
    modules = ("parameters", "mechanics", "coil", "physics")
    names = [*(f"hardware.cad.{each}" for each in modules), "hardware.wiring.figures"]
    results = [doctest.testmod(import_module(name)) for name in names]
    assert all(each.attempted for each in results)
    assert not [each for each in results if each.failed]


def test_a_dimension_that_is_set_is_taken() -> None:
    hardware = load_hardware("prototype", piezo_diameter=27.0)
    assert isinstance(hardware, Hardware)
    assert (hardware.piezo_diameter, hardware.block_length) == (27.0, 43.0)
