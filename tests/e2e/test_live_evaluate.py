"""What `monochord live` writes of a session is what `monochord evaluate` scores of it, to the last bit."""

import json
from pathlib import Path

import numpy as np
import pytest

from monochord.cli import run
from monochord.evaluation.results import read_results
from monochord.physics.sensors import SensorTuning, sensor_toml

PLAN = """
sensor = "prototype"
build = 1
[[groups]]
name = "slide"
protocol = "slide"
grid = [2, 1]
forces = [0.3, 1.4]
hold = 0.5
strokes = 2
days = [10]
"""


@pytest.fixture(scope="module", params=["prototype", "tuned", "measured"])
def session(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A session of the prototype, of one recorded as tuned 5 % low, or with a measured length besides."""
    folder, sensor = tmp_path_factory.mktemp("sessions"), "prototype"
    if request.param != "prototype":
        length = 0.1983 if request.param == "measured" else None
        sensor = str(folder / "sensor.toml")
        text = sensor_toml("prototype", SensorTuning(open_frequency=960.0, length=length))
        Path(sensor).write_text(text, encoding="utf-8")
    plan = PLAN.replace("prototype", sensor)
    (folder / "plan.toml").write_text(plan, encoding="utf-8")
    assert run(["collect", str(folder / "plan.toml"), "--out", str(folder)]) == 0
    (file,) = folder.glob("*.mcap")
    return file


@pytest.mark.parametrize("options", [["demo"], ["--estimator", "closed_form"]])
@pytest.mark.slow
def test_every_estimate_is_the_same(
    options: list[str], session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["evaluate", *options, "--sessions", str(session), "--out", str(tmp_path / "report")]) == 0
    results = read_results(tmp_path / "report" / "results.npz")
    capsys.readouterr()
    assert run(["live", *options, str(session), "--source", "session", "--hop", "0.02", "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    line_of = {round(line["time"] * 44100): line for line in lines}
    starts = np.rint(results.start * 44100).astype(int).tolist()
    assert len(starts) > 50
    assert {*starts} <= line_of.keys()
    assert {"contact", "position", "force"} <= results.value.keys()
    for name in results.value:
        for columns, key in ((results.value, name), (results.std, f"{name}_std")):
            live = np.array([line_of[start][key] for start in starts], dtype=float)
            np.testing.assert_array_equal(columns[name], live, strict=True)
    assert np.isfinite(results.value["position"]).sum() > 10
    settled = results.truth["settled"] == 1.0
    assert np.nanmax(np.abs(results.value["position"] - results.truth["position"])[settled]) < 2e-3
    reasons = [results.reasons[number] for number in results.reason_index["position"].tolist()]
    assert reasons == [line_of[start]["why_not"] for start in starts]
