"""Every preset of a sensor says where it comes from and can be; a wrong file is refused in one line."""

import shutil
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.physics.materials import load_material
from monochord.physics.sensors import load_sensor, sensor_names
from monochord.physics.strings import load_string
from monochord.physics.theory import open_frequency
from monochord.physics.twin import Pluck, Scene, advance, begin, hold

PROTOTYPE = Path(str(files("monochord.physics.sensors") / "prototype.toml"))


@pytest.mark.parametrize("name", sensor_names())
def test_preset_is_documented(name: str) -> None:
    sensor = load_sensor(name)
    assert sensor.name == name
    assert sensor.title
    assert len(sensor.source) > 20
    assert "Assumed" in sensor.notes


@pytest.mark.parametrize("name", sensor_names())
def test_drivers_stand_outside_the_range_one_at_each_end(name: str) -> None:
    sensor = load_sensor(name)
    first, second = sensor.drivers
    assert max(first.sense, first.drive) < sensor.range[0]
    assert min(second.sense, second.drive) > sensor.range[1]
    for driver in sensor.drivers:  # coils that do not lie in each other
        assert abs(driver.sense - driver.drive) > 2.0 * driver.aperture


def test_the_named_presets_are_there() -> None:
    assert {"prototype", "long", "gauge_012", "gauge_013"} <= set(sensor_names())


def test_with_one_driver_off_its_segment_falls_silent_and_the_other_does_not() -> None:
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


def test_prototype_has_the_papers_range_and_the_string_of_its_name() -> None:
    sensor = load_sensor("prototype")
    assert sensor.range[1] - sensor.range[0] == pytest.approx(0.1)
    assert sensor.string == load_string("prototype").string


@pytest.mark.parametrize("gauge", ["012", "013"])
def test_other_gauges_are_tuned_alike_on_the_same_frame(gauge: str) -> None:
    sensor, usual = load_sensor(f"gauge-{gauge}"), load_sensor("prototype")
    assert (sensor.string.length, sensor.range) == (usual.string.length, usual.range)
    assert sensor.string.linear_density == load_string(f"plain_{gauge}").string.linear_density
    assert open_frequency(sensor.string) == pytest.approx(open_frequency(usual.string), rel=5e-4)
    assert sensor.string.tension < load_string(f"plain_{gauge}").string.tension


@pytest.mark.parametrize("name", ["prototype", "gauge_012", "gauge_013"])
def test_settled_sound_fills_the_converter_and_hardly_stretches_the_string(name: str) -> None:
    sensor = load_sensor(name)
    scene = Scene(touches=(hold(0.09, 1.0, load_material("plastic")),))
    for history in (scene, Scene(pluck=Pluck(position=0.07, height=1e-4))):
        _, twin = advance(begin(sensor, history), 30000)
        loud, twin = advance(twin, 4410)
        assert (abs(loud.microphones).max(axis=1) > 0.1).all()
        assert abs(loud.microphones).max() < 0.6
        assert loud.labels.settled.all()


def test_file_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    shutil.copy(PROTOTYPE, path)
    path.write_text(path.read_text() + "\n[override]\ntension = 70.0\n")
    assert load_sensor(str(path)).name == "mine"
    assert load_sensor(str(path)).string.tension == 70.0


def test_unknown_name_is_refused_with_a_suggestion() -> None:
    with pytest.raises(InputError, match="did you mean 'prototype'"):
        load_sensor("protoype")


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('string = "prototype"', "", "name of a string preset"),
        ('string = "prototype"', 'string = "protoype"', "did you mean 'prototype'"),
        ("[pickups]", "[override]\ntensoin = 70.0\n[pickups]", "did you mean 'tension'"),
        ("[pickups]", "[override]\ntension = 0.0\n[pickups]", "tension 0 N: allowed is 2 to 500 N"),
        ("support =", "suport =", "did you mean 'support'"),
        ("support = 4.0e-3", "support = -1.0", "support -1"),
        ("quality = 0.6", "quality = 60.0", "quality"),
        ("range = [0.05, 0.15]", "range = [0.05, 0.25]", "place 0.25 m"),
        ("range = [0.05, 0.15]", "", "range"),
        ('title = "A sensor with a 10 cm range"', "", "title"),
    ],
)
def test_wrong_file_is_refused_in_one_line(tmp_path: Path, before: str, after: str, message: str) -> None:
    text = PROTOTYPE.read_text()
    assert before in text
    path = tmp_path / "mine.toml"
    path.write_text(text.replace(before, after, 1))
    with pytest.raises(InputError, match=message) as caught:
        load_sensor(str(path))
    assert "\n" not in str(caught.value)
