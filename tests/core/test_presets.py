"""Presets: strings, materials and sensors state their source and are plausible; wrong files are refused."""

import shutil
from collections.abc import Callable
from importlib.resources import files
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.presets import preset_names, preset_path
from monochord.core.types import Contact
from monochord.physics.materials import load_material, material_names
from monochord.physics.sensors import SensorTuning, load_sensor, sensor_names, sensor_toml, sensor_tuning
from monochord.physics.strings import load_string, string_names
from monochord.physics.theory import harmonic_frequencies, hertz_stiffness, inharmonicity, open_frequency
from monochord.physics.twin import Pluck, Scene, advance, begin, hold

Load = Callable[[str], Any]
KINDS: dict[str, tuple[Load, list[str]]] = {
    "strings": (load_string, string_names()),
    "materials": (load_material, material_names()),
    "sensors": (load_sensor, sensor_names()),
}
ALL = [(load, name) for load, names in KINDS.values() for name in names]
STRING = """
title = "My string"
source = "a scale and a ruler"
open_frequency = 243.252
[string]
length = 0.65
linear_density = 6.5e-4
tension = 65.0
"""
MATERIAL = """
title = "My finger"
source = "pressed against a scale"
young_modulus = 2.0e5
poisson_ratio = 0.45
loss = 1.0
friction_static = 0.9
friction_kinetic = 0.7
stribeck_speed = 0.02
roughness = 2.0e-5
roughness_length = 4.0e-4
radius = 8.0e-3
"""
PROTOTYPE = Path(str(files("monochord.physics.sensors") / "prototype.toml"))
SENSOR = PROTOTYPE.read_text()
TUNED = sensor_toml("prototype", SensorTuning(open_frequency=990.0))


@pytest.mark.parametrize(("load", "name"), ALL)
def test_every_preset_is_documented(load: Load, name: str) -> None:
    preset = load(name)
    assert preset.name == load(name.replace("_", "-")).name == name
    assert preset.title
    assert len(preset.source) > 20
    if load is not load_string:
        assert "Assumed" in preset.notes


@pytest.mark.parametrize("kind", KINDS)
def test_an_unknown_name_is_refused_with_the_nearest_and_a_missing_file_too(
    kind: str, tmp_path: Path
) -> None:
    load, names = KINDS[kind]
    assert names == preset_names(f"monochord.physics.{kind}") == sorted(names)
    with pytest.raises(InputError, match=f"'{names[0]}'"):
        load(names[0] + "x")
    with pytest.raises(InputError, match=r"absent\.toml"):
        load(str(tmp_path / "absent.toml"))
    assert preset_path(f"monochord.physics.{kind}", kind, "of/mine.toml") == Path("of/mine.toml")


@pytest.mark.parametrize(
    ("load", "text", "before", "after", "message"),
    [
        (load_string, STRING, "tension", "tensoin", "'tension'"),
        (load_string, STRING, "source", "sauce", "'source'"),
        (load_string, STRING, "65.0", "-65.0", "tension' = -65"),
        (load_string, STRING, "65.0", "'tight'", "tension"),
        (load_string, STRING, "65.0", "65.0\ndamping = -0.1", "damping' = -0.1"),
        (load_string, STRING, "65.0", "65.0\n[contact]\nposition = 0.7\nforce = 1.0", "position 0.7"),
        (load_string, STRING, "65.0", "65.0\n[contact]\nposition = 0.2\nforc = 1.0", "'force'"),
        (load_string, STRING, 'title = "My string"', "", "title"),
        (load_string, STRING, "=", "", "TOML"),
        (load_material, MATERIAL, "young_modulus", "young_modulos", "'young_modulus'"),
        (load_material, MATERIAL, "2.0e5", "-2.0e5", "young_modulus' = -200000.0"),
        (load_material, MATERIAL, "2.0e5", "inf", "young_modulus' = inf"),
        (load_material, MATERIAL, "2.0e5", "nan", "young_modulus"),
        (load_material, MATERIAL, "0.45", "0.51", "poisson_ratio' = 0.51"),
        (load_material, MATERIAL, "loss = 1.0", "loss = 0.0", "loss' = 0.0"),
        (load_material, MATERIAL, "0.9", "0.6", "friction_static 0.6"),
        (load_material, MATERIAL, "stribeck_speed = 0.02", "stribeck_speed = 0.0", "stribeck_speed' = 0.0"),
        (load_material, MATERIAL, "2.0e-5", "2.0e-2", "roughness' = 0.02"),
        (load_material, MATERIAL, "4.0e-4", "0.0", "roughness_length' = 0.0"),
        (load_material, MATERIAL, "8.0e-3", "8.0", "radius' = 8.0"),
        (load_sensor, SENSOR, 'string = "prototype"', "", "string"),
        (load_sensor, SENSOR, 'string = "prototype"', 'string = "protoype"', "'prototype'"),
        (load_sensor, SENSOR, "[pickups]", "[override]\ntensoin = 70.0\n[pickups]", "'tension'"),
        (load_sensor, SENSOR, "[pickups]", "[override]\ntension = 0.0\n[pickups]", "tension' = 0"),
        (load_sensor, SENSOR, "support =", "suport =", "'support'"),
        (load_sensor, SENSOR, "support = 4.0e-3", "support = -1.0", "support' = -1.0"),
        (load_sensor, SENSOR, "quality = 0.6", "quality = 60.0", "quality"),
        (load_sensor, SENSOR, "range = [0.05, 0.15]", "range = [0.05, 0.25]", "place 0.25 m"),
        (load_sensor, SENSOR, "range = [0.05, 0.15]", "", "range"),
        (load_sensor, TUNED, 'design = "prototype"', 'design = "protoype"', "'prototype'"),
        (load_sensor, TUNED, 'design = "prototype"', "design = 1", "design"),
        (load_sensor, TUNED, "[tuning]", "range = [0.05, 0.15]\n[tuning]", "range"),
        (load_sensor, TUNED, "open_frequency = 990.0", "open_frequency = 2000.0", "2000 Hz"),
        (load_sensor, TUNED, "open_frequency = 990.0", "open_frequncy = 990.0", "'open_frequency'"),
        (load_sensor, TUNED, "[tuning]", "[tunings]", "tuning"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(
    tmp_path: Path, load: Load, text: str, before: str, after: str, message: str
) -> None:
    assert before in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(before, after, 1))
    with pytest.raises(InputError, match=message) as caught:
        load(str(path))
    assert "\n" not in str(caught.value)


def test_files_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(TUNED)
    assert open_frequency(load_sensor(str(path)).string) == pytest.approx(990.0)
    assert sensor_tuning(str(path)) == SensorTuning(open_frequency=990.0)
    path.write_text(STRING)
    preset = load_string(str(path))
    assert (preset.name, preset.contact) == ("mine", None)
    assert preset.usual_contact == Contact(position=0.35 * 0.65, force=0.0)
    path.write_text(MATERIAL)
    assert load_material(str(path)).radius == 8e-3
    shutil.copy(PROTOTYPE, path)
    more = "[tolerances]\nplaces = 1e-3\n[changes]\ntemperature = 10.0\n[override]\ntension = 70.0\n"
    path.write_text(path.read_text() + "\n" + more)
    sensor, usual = load_sensor(str(path)), load_sensor("prototype")
    assert (sensor.name, sensor.string.tension) == ("mine", 70.0)
    assert (sensor.tolerances.places, sensor.changes.temperature) == (1e-3, 10.0)
    assert sensor.tolerances.gain == usual.tolerances.gain


@pytest.mark.parametrize("name", string_names())
def test_a_string_agrees_with_its_open_frequency(name: str) -> None:
    preset = load_string(name)
    string = preset.string
    first = harmonic_frequencies(string.length, string.tension, string.linear_density, 1)[0]
    assert first == pytest.approx(preset.open_frequency, rel=2e-4)
    assert 10.0 < string.tension < 300.0
    assert 0.0 <= inharmonicity(string) < 1e-3


def test_appendix_is_the_papers() -> None:
    preset = load_string("appendix")
    string, contact = preset.string, preset.contact
    assert (string.length, string.linear_density, string.tension) == (0.65, 6.5e-4, 65.0)
    assert (string.tension_per_force, string.damping) == (6.0, 0.02)
    assert contact is not None
    assert contact.position == pytest.approx(0.35 * 0.65)


def test_plain_010_is_close_to_the_makers_figure() -> None:
    # D'Addario's guide lists 0.00002215 lb/in for PL010, and 16.2 lb at E4 on 25.5 in.
    string = load_string("plain-010").string
    assert string.linear_density == pytest.approx(0.00002215 * 0.45359237 / 0.0254, rel=0.01)
    assert string.tension == pytest.approx(16.2 * 4.4482, rel=0.02)


def test_materials_span_from_foam_to_steel() -> None:
    order = ["foam", "rubber", "wood", "plastic", "metal_tube", "allen_key"]
    string, materials = load_string("prototype").string, [load_material(name) for name in order]
    stiffness = [hertz_stiffness(string, m.radius, m.young_modulus, m.poisson_ratio) for m in materials]
    assert 1e3 < stiffness[0] < 1e5
    assert 1e9 < stiffness[-1] < 2e10
    assert all(soft < hard for soft, hard in pairwise(stiffness[:4]))
    assert min(stiffness[4:]) > 5.0 * stiffness[3]
    assert min(m.loss for m in materials[:3]) > 2.0 * max(m.loss for m in materials[4:])
    assert 5e4 <= materials[0].young_modulus <= 2e5  # foam is like skin
    assert all(m.friction_static > m.friction_kinetic for m in materials)


@pytest.mark.parametrize("name", sensor_names())
def test_drivers_stand_outside_the_range_one_at_each_end(name: str) -> None:
    sensor = load_sensor(name)
    first, second = sensor.drivers
    assert max(first.sense, first.drive) < sensor.range[0]
    assert min(second.sense, second.drive) > sensor.range[1]
    for driver in sensor.drivers:  # coils that do not overlap
        assert abs(driver.sense - driver.drive) > 2.0 * driver.aperture


def test_without_one_driver_its_segment_decays_and_the_other_does_not() -> None:
    usual, one = load_sensor("prototype"), load_sensor("prototype_one_driver")
    assert one.drivers[0] == usual.drivers[0]
    assert (one.drivers[1].limit, one.string, one.pickups) == (0.0, usual.string, usual.pickups)
    scene = Scene(
        touches=(hold(0.09, 1.0, load_material("plastic")),), pluck=Pluck(position=0.04, height=1e-4)
    )
    far: list[float] = []
    for sensor in (usual, one):
        _, twin = advance(begin(sensor, scene), 44100)
        take, _ = advance(twin, 22050)
        first, second = np.sqrt(np.mean(take.microphones.astype(float) ** 2, axis=1)).tolist()
        assert 0.1 < first < 0.5
        far.append(second)
    assert far[1] < 0.5 * far[0]


def test_the_prototype_has_the_papers_range_and_other_gauges_its_frame() -> None:
    usual = load_sensor("prototype")
    assert usual.range[1] - usual.range[0] == pytest.approx(0.1)
    assert usual.string == load_string("prototype").string
    for gauge in ("012", "013"):
        sensor, plain = load_sensor(f"gauge-{gauge}"), load_string(f"plain_{gauge}").string
        assert (sensor.string.length, sensor.range) == (usual.string.length, usual.range)
        assert sensor.string.linear_density == plain.linear_density
        assert open_frequency(sensor.string) == pytest.approx(open_frequency(usual.string), rel=5e-4)
        assert sensor.string.tension < plain.tension


@pytest.mark.parametrize("name", ["prototype", "gauge_012", "gauge_013"])
def test_settled_sound_is_well_below_full_scale(name: str) -> None:
    scene = Scene(touches=(hold(0.09, 1.0, load_material("plastic")),))
    for history in (scene, Scene(pluck=Pluck(position=0.07, height=1e-4))):
        _, twin = advance(begin(load_sensor(name), history), 30000)
        loud, twin = advance(twin, 4410)
        assert (abs(loud.microphones).max(axis=1) > 0.1).all()
        assert abs(loud.microphones).max() < 0.6
        assert loud.labels.settled.all()
