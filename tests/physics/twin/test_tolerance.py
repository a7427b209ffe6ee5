"""Tolerances are refused where no workshop could mean them."""

from pathlib import Path

import pytest

from monochord.core.config import from_tree
from monochord.core.errors import InputError
from monochord.physics.sensors import load_sensor
from monochord.physics.twin.tolerance import Changes, Tolerances


def test_usual_tolerances_keep_what_astm_a228_allows_a_music_wire() -> None:
    # 0.3 thousandths of an inch of .010 and three deviations.
    assert 3.0 * Tolerances().diameter == pytest.approx(0.0003 / 0.010)


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [(Tolerances, "diameter", 0.5), (Tolerances, "places", -1e-4), (Changes, "temperature", 100.0)],
)
def test_out_of_range_is_refused(kind: type, name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        from_tree(kind, {name: value})


def test_a_file_may_state_its_own(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        'title = "Mine"\nsource = "a bench and two hands"\nstring = "prototype"\nrange = [0.05, 0.15]\n'
        "drivers = [{sense = 0.02, drive = 0.03}, {sense = 0.18, drive = 0.17}]\n"
        "[tolerances]\nplaces = 1e-3\n[changes]\ntemperature = 10.0\n"
    )
    sensor = load_sensor(str(path))
    assert (sensor.tolerances.places, sensor.changes.temperature) == (1e-3, 10.0)
    assert sensor.tolerances.gain == Tolerances().gain
