"""What version 0.1 wrote is taken by the code as it is now, or refused by name.

``tests/fixtures/v0_1`` says how it was made. A version that takes some of it no more refuses it in one line:
its test then expects that line.
"""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import monochord as mc
from monochord.core.config import load_toml
from monochord.core.errors import InputError
from monochord.core.types import Block
from monochord.lab.assignment import assignments
from monochord.lab.plans import load_plan
from monochord.live import LiveRun
from monochord.perception.training.settings import TrainingSettings
from monochord.physics.sensors import load_sensor, sensor_design, sensor_tuning
from monochord.sessions import SessionWriter
from monochord.sessions.check import check

V0_1 = Path(__file__).parents[1] / "fixtures" / "v0_1"
PLACE, FORCE = 0.08, 1.2
"""The touch of `touches.mcap` in m and N, from 0.9 to 1.7 s; its labels are of 1.05 to 1.65 s."""


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


def test_settings_that_are_gone_are_refused_by_name() -> None:
    live = load_toml(V0_1 / "live.toml") | {"sinks": {}, "estimator": {"name": "closed_form"}}
    with pytest.raises(InputError, match=r"option 'filter\.position': expected contact, slip"):
        LiveRun.read(live)
    with pytest.raises(InputError, match="option 'context': expected title, dataset"):
        TrainingSettings.read(load_toml(V0_1 / "train.toml"))


def test_a_plan_means_what_it_did() -> None:
    plan = load_plan(str(V0_1 / "plan.toml"))
    assert (plan.sample_rate, plan.force_rate, plan.label_rate) == (16000, 500.0, 200.0)
    names = [session.name for session in assignments(plan)]
    assert names == [f"hold_{n:03}" for n in range(3)] + [f"slide_{n:03}" for n in range(5)]
