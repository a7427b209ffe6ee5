"""Bundled pretrained models are whole, small, and what the code and the default preset say."""

from pathlib import Path

import numpy as np
import pytest

import monochord as mc
from monochord.core.config import load_toml
from monochord.core.errors import InputError
from monochord.core.types import Signal, Window
from monochord.perception.features import FEATURES
from monochord.perception.features.base import Feature
from monochord.perception.model import ModelState, folder_of, load
from monochord.perception.model.bundled import bundled_folder, bundled_names
from monochord.perception.model.definition import FeatureRecord
from monochord.perception.training.configs import DEFAULT, config_path
from monochord.perception.training.settings import TrainingSettings
from monochord.physics.sensors import load_sensor

SIGNAL = Signal(sample_rate=44100, channels=2, string=load_sensor("prototype").string)
AGAIN = "train it again as its SOURCES.md says"


@pytest.mark.parametrize("name", bundled_names())
def test_it_is_small_and_says_how_it_was_made(name: str) -> None:
    folder = bundled_folder(name)
    assert folder is not None
    assert {file.name for file in folder.iterdir()} == {
        "SOURCES.md",
        "model.json",
        "weights.safetensors",
    }
    assert sum(file.stat().st_size for file in folder.iterdir()) < 2_000_000
    assert load(name).definition.simulated


def built(record: FeatureRecord) -> Feature:
    """Return a feature with its options, later ones at their defaults."""
    return FEATURES.build(record.name, record.options)


@pytest.mark.parametrize("name", bundled_names())
def test_it_is_what_its_configuration_asks_for(name: str) -> None:
    definition = load(name).definition
    settings = TrainingSettings.read(load_toml(config_path(DEFAULT)))
    assert definition.title == settings.title, AGAIN
    assert built(definition.feature) == FEATURES.build(*settings.feature_named()), AGAIN
    assert {head: record.task for head, record in definition.heads.items()} == settings.tasks(), AGAIN
    assert definition.string == load_sensor(settings.sensor).string, AGAIN
    assert definition.window == 4410, AGAIN
    assert definition.faults is not None, AGAIN
    assert max(definition.faults.limits) < 10.0, AGAIN
    assert definition.faults.measured["ordinary"] <= settings.faults, AGAIN


@pytest.mark.parametrize("name", bundled_names())
def test_the_features_are_what_they_were_when_it_was_trained(name: str) -> None:
    try:
        model = load(name)
        model.check(SIGNAL)
    except InputError as error:
        pytest.fail(f"{error}\n{AGAIN}")
    rng = np.random.default_rng(0)
    samples = 0.1 * rng.standard_normal((2, 4410), np.float32)
    _, estimates = model.step(ModelState(), Window(samples=samples, start=0, sample_rate=44100))
    assert estimates.keys() == {"contact", "slip", "position", "force"}


def test_it_is_found_by_its_name_where_nothing_else_has_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert folder_of(Path("demo")) == bundled_folder("demo")
    Path("demo").mkdir()
    assert folder_of(Path("demo")) is None
    with pytest.raises(InputError, match=r"demo.*model\.json"):
        load("demo")


def test_an_unknown_name_is_refused_with_the_names() -> None:
    with pytest.raises(InputError, match=r"demmo.*'demo'"):
        load("demmo")


@pytest.mark.parametrize("dead", [1, 2])
def test_beside_a_silent_driver_no_wrong_position_is_stated(dead: int) -> None:
    sensor, model = mc.VirtualSensor("prototype", build=3), load("demo")
    parts, pressed = [sensor.advance(2.0)[0]], list[tuple[float, float]]()
    sensor.drive(dead != 1, dead != 2)
    for place in (0.07, 0.12):
        sensor.press(place, force=1.0)
        pressed.append((sum(part.shape[1] for part in parts) / 44100, place))
        parts.append(sensor.advance(1.0)[0])
        sensor.release()
        parts.append(sensor.advance(0.5)[0])
    table = model.predict(np.concatenate(parts, axis=1), hop=0.05)
    denied = table.contact.valid & (table.contact.value < 0.5)
    for begin, place in pressed:
        held = (table.time > begin + 0.4) & (table.time < begin + 0.9)
        assert np.mean(denied[held]) < 0.4
        stated = held & table.position.valid
        assert (np.abs(table.position.value[stated] - place) < 5e-3).all()
