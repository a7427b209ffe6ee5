"""Every material says where it comes from and lies in its order of softness; a wrong one is refused."""

from itertools import pairwise
from pathlib import Path

import pytest

from monochord.core.errors import InputError
from monochord.physics.materials import load_material, material_names
from monochord.physics.strings import load_string
from monochord.physics.theory import hertz_stiffness

GOOD = """
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


def stiffness_of(name: str) -> float:
    material, string = load_material(name), load_string("prototype").string
    return hertz_stiffness(string, material.radius, material.young_modulus, material.poisson_ratio)


@pytest.mark.parametrize("name", material_names())
def test_material_is_documented(name: str) -> None:
    material = load_material(name)
    assert material.name == name
    assert material.title
    assert len(material.source) > 20
    assert "Assumed" in material.notes
    assert material.friction_static > material.friction_kinetic


def test_objects_of_the_paper_and_soft_ones_are_there() -> None:
    assert {"plastic", "wood", "metal_tube", "allen_key", "rubber", "foam"} <= set(material_names())


def test_contact_spans_from_foam_to_steel() -> None:
    order = ["foam", "rubber", "wood", "plastic", "metal_tube", "allen_key"]
    stiffness = [stiffness_of(name) for name in order]
    assert 1e3 < stiffness[0] < 1e5
    assert 1e9 < stiffness[-1] < 2e10
    assert all(soft < hard for soft, hard in pairwise(stiffness[:4]))
    assert min(stiffness[4:]) > 5.0 * stiffness[3]


def test_soft_materials_lose_more_than_metals() -> None:
    metals = max(load_material(name).loss for name in ("metal_tube", "allen_key"))
    soft = min(load_material(name).loss for name in ("wood", "rubber", "foam"))
    assert soft > 2.0 * metals


def test_foam_is_like_skin() -> None:
    assert 5e4 <= load_material("foam").young_modulus <= 2e5


def test_file_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "finger.toml"
    path.write_text(GOOD)
    finger = load_material(str(path))
    assert (finger.name, finger.radius, finger.notes) == ("finger", 8e-3, "")


def test_unknown_name_is_refused_with_a_suggestion() -> None:
    with pytest.raises(InputError, match="did you mean 'allen_key'"):
        load_material("alen-key")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("young_modulus", "young_modulos", "did you mean 'young_modulus'"),
        ("2.0e5", "-2.0e5", r"finger.young_modulus -200000 Pa: allowed is 1000 to 2e\+12 Pa"),
        ("2.0e5", "inf", "finger.young_modulus inf Pa"),
        ("2.0e5", "'soft'", "young_modulus"),
        ("2.0e5", "nan", "young_modulus"),
        ("0.45", "0.51", r"finger.poisson_ratio 0.51: allowed is 0.001 to 0.5$"),
        ("loss = 1.0", "loss = 0.0", "finger.loss 0 s/m"),
        ("0.9", "0.6", r"finger.friction_static 0.6: allowed is friction_kinetic \(0.7\) or more"),
        ("stribeck_speed = 0.02", "stribeck_speed = 0.0", "finger.stribeck_speed 0 m/s"),
        ("2.0e-5", "2.0e-2", "finger.roughness 0.02 m"),
        ("4.0e-4", "0.0", "finger.roughness_length 0 m"),
        ("8.0e-3", "8.0", "finger.radius 8 m: allowed is 0.0001 to 1 m"),
        ('title = "My finger"', "", "title"),
        ("=", "", "TOML"),
    ],
)
def test_wrong_file_is_refused_in_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "finger.toml"
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(InputError, match=message) as caught:
        load_material(str(path))
    assert "\n" not in str(caught.value)


def test_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        load_material(str(tmp_path / "absent.toml"))
