"""A calibrated model remembers the sensor of its touches, and says so on another one."""

from pathlib import Path

import pytest
from tests.cli.running import Capture, record

import monochord as mc
from monochord.cli import run
from monochord.core.identity import SensorIdentity

SAID = "was calibrated on another sensor (prototype, build 77; this is "


def collected(folder: Path, build: int) -> list[str]:
    plan = [f"groups=[{{name='hold', sessions=1, grid=[3, 2], hold=0.4, builds=[{build}]}}]"]
    return [str(each.path) for each in mc.collect("quick", folder / f"build {build}", settings=plan)]


@pytest.mark.slow
def test_a_calibrated_model_says_that_the_sensor_is_another_one(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capsys: Capture
) -> None:
    own, other = (collected(tmp_path, build) for build in (77, 300))
    model = mc.calibrate("demo", own, tmp_path / "mine")
    assert model.definition.calibrated_on == SensorIdentity(name="prototype", build=77)
    assert "calibrated on prototype, build 77" in str(mc.load(tmp_path / "mine"))
    mine = str(tmp_path / "mine")

    def said() -> list[str]:
        lines = [line for line in caplog.messages if "another sensor" in line]
        caplog.clear()
        return lines

    for build, lines in ((77, 0), (300, 1)):
        sensor = mc.VirtualSensor("prototype", build=build)
        next(iter(mc.listen(sensor, model=mine, seconds=0.5)))
        assert len(said()) == lines
    twin = ["--source", "twin", "--seconds", "0.5", "--sink", "jsonl=/dev/null", "--set", "source.build=300"]
    assert run(["live", mine, *twin]) == 0
    (line,) = said()
    assert SAID + "prototype, build 300)" in line
    mc.calibrate(mine, own, touches=0)
    assert not said()
    mc.calibrate(mine, other, touches=0)
    (line,) = said()
    assert SAID in line
    capsys.readouterr()
    assert SAID + "build 300)" in " ".join(
        record(capsys, "evaluate", mine, "--sessions", other[0], "--no-baselines")["notes"]
    )


@pytest.mark.parametrize(
    ("one", "other", "apart"),
    [
        ({}, {}, False),
        ({"name": "prototype"}, {"name": "long"}, True),
        ({"name": "prototype"}, {"build": 3}, False),
        ({"build": 0}, {"build": 3}, True),
        ({"build": 3}, {"build": 3, "name": "long"}, False),
        ({"length": 0.2}, {"length": 0.2006}, False),
        ({"length": 0.2}, {"length": 0.2016}, True),
    ],
)
def test_only_what_is_known_tells_two_sensors_apart(
    *, one: dict[str, object], other: dict[str, object], apart: bool
) -> None:
    first, second = (SensorIdentity(**each) for each in (one, other))  # pyright: ignore[reportArgumentType]
    assert first.is_other(second) is second.is_other(first) is apart
