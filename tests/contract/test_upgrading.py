"""What version 0.1 wrote, and what was written for it, is taken by the code as it is now.

``tests/fixtures/v0_1`` says how it was made. A version that takes some of it no more refuses it in one line:
its test then expects that line.
"""

import csv
import hashlib
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import monochord as mc
from monochord import cli
from monochord.capture.sources import SOURCES
from monochord.core.config import load_toml
from monochord.core.errors import InputError
from monochord.core.types import Block
from monochord.lab.plan import Group, assignments
from monochord.lab.plans import load_plan
from monochord.live import LiveRun
from monochord.perception.training.settings import TrainingSettings
from monochord.physics.sensors import load_sensor, sensor_design, sensor_tuning
from monochord.sessions import SessionWriter
from monochord.sessions.check import check

V0_1 = Path(__file__).parents[1] / "fixtures" / "v0_1"
PLACE, FORCE = 0.08, 1.2
"""The touch of `touches.mcap` in m and N, from 0.9 to 1.7 s; its labels are of 1.05 to 1.65 s."""


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of all of it, where the program runs."""
    folder = tmp_path / "home"
    shutil.copytree(V0_1, folder)
    monkeypatch.chdir(folder)
    return folder


@pytest.fixture
def tally(home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The package of a third party, installed as pip does it."""
    site = tmp_path / "site"
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", "--no-index"]
    command = [*pip, "--no-deps", "--no-build-isolation", "--target", str(site), str(home / "tally")]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    monkeypatch.syspath_prepend(site)
    yield
    sys.modules.pop("monochord_tally", None)


def test_a_recorded_session_is_read() -> None:
    session = mc.read_session(V0_1 / "recorded.mcap")
    audio, about = session.audio, session.description
    assert (session.complete, session.damaged, session.streams) == (True, 0, ("wrench", "arm"))
    assert (audio.samples.shape, audio.samples.dtype, audio.sample_rate) == ((2, 8379), np.float32, 16000)
    sound = hashlib.sha256(audio.samples.tobytes()).hexdigest()
    assert sound == "d92741aba9084ca550811dbcf8e1891de6d2f05233ea779931cc4f1073b2fe4d"
    wrench, arm = session.readings("wrench"), session.readings("arm")
    assert wrench.values.shape == (273, 6)
    np.testing.assert_allclose(wrench.column("fz")[:3], [1.368757, 1.364484, 1.360155], atol=1e-9)
    assert wrench.sequence.tolist() == list(range(1, 274))
    assert wrench.time[[0, -1]] == pytest.approx([0.508706, 1.053283], abs=1e-5)
    assert arm.values.shape == (25, 7)
    np.testing.assert_allclose(arm.values[0], [0.1, 0.0, 0.002, 0.0, 0.0, 0.0, 1.0], atol=1e-9)
    assert [(event.kind, event.text) for event in session.events] == [("stop", "the time is over")]
    assert set(session.clocks.offsets) == {"monotonic_raw", "realtime"}
    assert (about.name, about.object, about.simulated) == ("recorded", "a rod", True)
    assert about.string is not None
    assert (about.string.length, about.string.tension) == (0.2, 65.0)
    assert about.versions["monochord"] == "0.1.0"


@pytest.mark.parametrize("name", ["recorded", "touches"])
def test_a_session_is_whole_and_as_it_was_written(name: str) -> None:
    report = check(V0_1 / f"{name}.mcap")
    assert (report.faults, report.remarks) == ((), ())
    assert (
        report.content_checksum
        == {
            "recorded": "c6c96a35d4ced71f5036582743d89be90e668a76dacb394b62ed054ca1b61bc1",
            "touches": "830e4343363456b82b12896a789244e443ac8a206e6907d5f70ab109edcd06b3",
        }[name]
    )


def test_a_session_with_labels_is_read() -> None:
    session = mc.read_session(V0_1 / "touches.mcap")
    labels, about = session.labels, session.description
    assert session.audio.samples.shape == (2, 30429)
    touched = labels.columns["contact"] == 1.0
    assert labels.time[touched][[0, -1]] == pytest.approx([1.05, 1.65], abs=0.02)
    assert np.unique(labels.columns["position"][touched]).tolist() == [PLACE]
    assert np.unique(labels.columns["force"][touched]).tolist() == [FORCE]
    assert np.isnan(labels.columns["force"][~touched]).all()
    assert (about.object, about.material, about.notes) == ("a rod", "plastic", "one touch")
    assert about.string is not None
    assert about.string.tension == pytest.approx(64.9057088, abs=1e-6)


def test_a_session_of_a_world_that_is_gone_is_read_checked_and_evaluated(tmp_path: Path) -> None:
    session, file = mc.read_session(V0_1 / "touches.mcap"), tmp_path / "touches.mcap"
    about = replace(session.description, more={"world": "plausible_1", "mount": ""})
    with SessionWriter(file, about, session.clock) as writer:
        writer.audio(Block(samples=session.audio.samples[:], start=0, adc_time=0.0))
        writer.labels(session.labels.time, dict(session.labels.columns))
    assert mc.read_session(file).description.more["world"] == "plausible_1"
    assert check(file).faults == ()
    (row,) = (
        row
        for row in mc.evaluate(sessions=file, baselines=False).tree()["table"]
        if row["state"] == "touched"
    )
    assert row["position"]["mae"]["value"] < 5e-4


def test_a_world_that_is_gone_is_refused_with_what_to_take() -> None:
    world: Any = "plausible_1"
    one_line = r"^option '.*' = 'plausible_1': expected ideal, plausible.*; did you mean 'plausible'\?$"
    for ask in (
        lambda: mc.VirtualSensor(world=world),
        lambda: SOURCES.build("twin", {"world": world}),
        lambda: load_plan("small", [f"world={world}"]),
        lambda: Group(name="hold", world=world),
    ):
        with pytest.raises(InputError, match=one_line):
            ask()


def test_a_sensor_as_tuned_is_read() -> None:
    file = str(V0_1 / "sensor.toml")
    sensor, tuning = load_sensor(file), sensor_tuning(file)
    assert sensor_design(file) == "prototype"
    assert (sensor.string.length, sensor.range) == (0.2, (0.05, 0.15))
    assert sensor.string.tension == pytest.approx(64.9057088, abs=1e-6)
    assert tuning is not None
    assert tuning.open_frequency == pytest.approx(1009.83186, abs=1e-4)
    assert tuning.open_frequency_std == pytest.approx(1.95315, abs=1e-4)
    assert (tuning.partials, tuning.microphones) == ((2, 1, 7, 6), (1, 2))


def test_a_model_is_refused_with_what_to_do() -> None:
    with pytest.raises(InputError, match=r"model\.json of format 2: expected format 3 to 5.*train it again"):
        mc.load(V0_1 / "model")


def test_a_script_of_0_1_runs_with_warnings() -> None:
    script = """
import monochord as mc
from monochord.core.errors import InputError
from monochord.live.sinks.base import Moment
from monochord.perception.model import load
from monochord.physics.sensors import load_sensor

for prediction in mc.listen("touches.mcap", model="closed_form", seconds=1.3):
    position, force = prediction["position"], prediction["force"]
try:
    load_sensor("prototpye")
except InputError as error:
    print(isinstance(prediction, Moment), error.given, "prototype" in error.allowed, error.remedy)
print(prediction.time, prediction.start, prediction.latency < 10.0, sorted(prediction.estimates))
print(position.value, position.std, force.valid, prediction.estimate("hardness").why_not)
"""
    run = subprocess.run(
        [sys.executable, "-W", "always", "-c", script], cwd=V0_1, capture_output=True, text=True, check=True
    )
    refusal, first, second = run.stdout.splitlines()
    assert refusal == "True sensor 'prototpye' True did you mean 'prototype'?"
    assert first.startswith("1.2 19200 True ['contact', 'force', ")
    place, std, *rest = second.split()
    assert float(place) == pytest.approx(PLACE, abs=5e-4)
    assert 0.0 < float(std) < 2e-3
    assert rest == ["True", "not", "estimated"]
    said = [line.split("Warning: ")[1] for line in run.stderr.splitlines() if "DeprecationWarning" in line]
    assert set(said) == {
        "update['position'] is deprecated: use update.position",
        "update['force'] is deprecated: use update.force",
        "Estimate.why_not is deprecated: use Estimate.reason",
        "Moment is deprecated: use Update",
    }


def by_physics(text: str) -> str:
    """Return a configuration of live with the closed form in place of the model, which is refused."""
    return re.sub(r'(\[estimator\]\n)name = "model"\npath = "model"\n', r'\1name = "closed_form"\n', text)


@pytest.mark.filterwarnings("ignore:Moment is deprecated:DeprecationWarning")
@pytest.mark.filterwarnings("ignore:filter\\.:DeprecationWarning")
def test_a_sink_of_a_third_party_is_refused_in_one_line(
    home: Path, tally: None, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("live.toml").write_text(by_physics(Path("live.toml").read_text()))
    assert cli.run(["live", "--config", "live.toml"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "sink 'monochord_tally' of Monochord 0.1" in line
    assert "docs/how-to/upgrade.md" in line


@pytest.mark.filterwarnings("ignore:filter\\.:DeprecationWarning")
def test_a_configuration_of_live_runs(home: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = by_physics(Path("live.toml").read_text()).split("[sinks.tally]")[0]
    Path("live.toml").write_text(f'{text}[sinks.csv]\npath = "windows.csv"\n')
    assert cli.run(["live", "--config", "live.toml"]) == 0, capsys.readouterr().err
    with Path("windows.csv").open() as lines:
        windows = list(csv.DictReader(lines))
    assert len(windows) == 181
    held = next(each for each in windows if float(each["time"]) == pytest.approx(1.29))
    assert float(held["position"]) == pytest.approx(PLACE, abs=5e-4)
    assert 0.0 < float(held["position_std"]) < 2e-3


def test_settings_of_live_mean_what_they_did(home: Path) -> None:
    with pytest.warns(DeprecationWarning, match="has no effect") as said:
        settings = LiveRun.read({**load_toml(home / "live.toml"), "sinks": {}})
    assert [str(each.message) for each in said] == [
        "filter.position has no effect: position is that of the window",
        "filter.force has no effect: force is that of the window",
    ]
    assert settings.resolved()["source"] == {
        "name": "session", "path": "touches.mcap", "block": 512, "speed": 0.0, "aligned": True,
    }  # fmt: skip
    assert (settings.window.length, settings.window.hop) == (0.1, 0.01)
    assert (settings.filter.contact.dwell, settings.filter.slip.on) == (0.03, 0.15)
    assert (settings.health.appear, settings.health.clear) == (1.0, 1.0)


def test_settings_of_a_training_mean_what_they_did() -> None:
    with pytest.warns(DeprecationWarning, match="context has no effect"):
        settings = TrainingSettings.read(load_toml(V0_1 / "train.toml"))
    assert (settings.sensor, settings.seed, settings.feature["name"]) == ("prototype", 3, "fft_harmonic")
    assert {name: task.hidden for name, task in settings.tasks().items()} == {
        "contact": (), "slip": (), "position": (16,), "force": (16,),
    }  # fmt: skip
    assert (settings.noise.kinds, settings.noise.ratios) == (("white", "hum"), (10.0, 30.0))
    assert settings.corrections == {"force": ("ratio place", "ratio open - open")}
    assert (settings.optimiser.rate, settings.optimiser.epochs) == (3e-3, 30)


def test_a_plan_means_what_it_did() -> None:
    plan = load_plan(str(V0_1 / "plan.toml"))
    assert (plan.sample_rate, plan.force_rate, plan.label_rate) == (16000, 500.0, 200.0)
    names = [session.name for session in assignments(plan)]
    assert names == [f"hold_{n:03}" for n in range(3)] + [f"slide_{n:03}" for n in range(5)]
