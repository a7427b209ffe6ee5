"""A command and the function of its name give the same: files byte for byte, results value for value."""

import json
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from tests.capture.recording.test_loop import GoneSource
from tests.cli.running import Capture, records
from tests.lab.tiny import tiny

import monochord as mc
from monochord.cli import run
from monochord.core.config import dump_toml, to_tree
from monochord.evaluation.table import Scores
from monochord.front.train import TrainedModel
from monochord.lab.plan import Group

STANDS_ASIDE = ("out", "path", "wall", "kept")
"""Entries of a result that differ with the folder and the clock."""
HOLD = "groups=[{name='hold', sessions=3, grid=[2, 1], forces=[0.4, 1.4], hold=0.3}]"


def alike(tree: Any) -> Any:
    """Return a result without what differs with the folder and the clock, as JSON has it."""
    if isinstance(tree, dict):
        return {key: alike(value) for key, value in tree.items() if key not in STANDS_ASIDE}
    return [alike(each) for each in tree] if isinstance(tree, list) else tree


def plain(tree: Any) -> Any:
    return alike(json.loads(json.dumps(tree)))


def contents(folder: Path) -> dict[str, bytes]:
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}


@pytest.fixture(scope="module")
def collected(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three short sessions, and the dataset of them."""
    folder = tmp_path_factory.mktemp("front")
    sessions = mc.collect("quick", folder / "sessions", settings=[HOLD], workers=1)
    mc.build(sessions, folder / "dataset", seed=1)
    return folder


def test_collect(tmp_path: Path, capsys: Capture) -> None:
    options = ["--only", "hold_000", "--seed", "3", "--set", HOLD]
    (printed,) = records(capsys, "collect", "quick", "--out", tmp_path / "command", *options)
    sessions = mc.collect("quick", tmp_path / "function", only="hold_000", seed=3, settings=[HOLD])
    assert plain(sessions.tree()) == alike(printed)
    assert contents(tmp_path / "function") == contents(tmp_path / "command")
    assert [session.path for session in sessions] == [tmp_path / "function" / "hold_000.mcap"]
    again = mc.collect("quick", tmp_path / "function", only="hold_000", seed=3, settings=[HOLD])
    assert (again.kept, again.checksum) == (1, sessions.checksum)


def test_a_plan_is_a_name_a_file_or_a_plan(tmp_path: Path) -> None:
    plan = tiny(groups=(Group(name="hold", grid=(2, 1), forces=(0.8, 1.2), hold=0.3),))
    (tmp_path / "plan.toml").write_text(dump_toml(to_tree(plan)), encoding="utf-8")
    of_file = mc.collect(tmp_path / "plan.toml", tmp_path / "file", settings=["pose_rate=50"])
    of_plan = mc.collect(plan, tmp_path / "plan", settings=["pose_rate=50"])
    assert [one.windows for one in of_file] == [one.windows for one in of_plan]
    with pytest.raises(mc.InputError, match="sensr"):
        mc.collect(plan, tmp_path / "more", settings=["sensr=long"])


def test_workers_and_a_cluster_exclude_each_other(tmp_path: Path) -> None:
    both = {"workers": 2, "cluster": "tcp://127.0.0.1:1"}
    for call in (mc.collect, mc.build, mc.train, mc.evaluate):
        with pytest.raises(mc.InputError, match="a cluster has its own workers"):
            call("quick", tmp_path / "out", **both)  # pyright: ignore[reportArgumentType, reportCallIssue]
    assert not list(tmp_path.iterdir())


def test_build_and_audit(collected: Path, tmp_path: Path, capsys: Capture) -> None:
    out = tmp_path / "dataset"
    (printed,) = records(capsys, "build", collected / "sessions", "--out", out, "--seed", "1")
    assert contents(out) == contents(collected / "dataset")
    data = mc.load_dataset(collected / "dataset")
    counts = {"windows": data.manifest.windows, "seed": data.split.seed, "split": data.split.by}
    assert {key: printed[key] for key in counts} == counts
    (audited,) = records(capsys, "audit", out)
    audit = mc.audit(data)
    assert audited == {"clean": audit.clean, "leaks": [], "notes": list(audit.notes)}


def test_build_takes_sessions_paths_and_patterns_and_raises_on_leaks(
    collected: Path, tmp_path: Path, capsys: Capture
) -> None:
    first, others = collected / "sessions" / "hold_000.mcap", f"{collected}/sessions/hold_00[12].mcap"
    of_both = mc.build([first, others], tmp_path / "both", seed=1)
    assert of_both.dataset.checksum == mc.load_dataset(collected / "dataset").dataset.checksum
    twice = tmp_path / "twice"
    twice.mkdir()
    for name in ("a", "b", "c"):
        (twice / f"{name}.mcap").write_bytes(first.read_bytes())
    with pytest.raises(mc.InputError) as error:
        mc.build(twice, tmp_path / "leaks")
    assert run(["build", str(twice), "--out", str(tmp_path / "leaks too")]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == f"monochord: {error.value}"


def test_evaluate(collected: Path, tmp_path: Path, capsys: Capture) -> None:
    options = ["--dataset", collected / "dataset", "--sensor", "prototype", "--no-baselines"]
    words = ["evaluate", "--estimator", "closed_form", *options]
    (printed,) = records(capsys, *words, "--out", tmp_path / "command")
    data = mc.load_dataset(collected / "dataset")
    report = mc.evaluate(
        data=data, estimator="closed_form", sensor="prototype", baselines=False, progress=lambda *_: None
    )
    assert plain(report.tree()) == alike(printed)
    report.write(tmp_path / "function")
    assert contents(tmp_path / "function") == contents(tmp_path / "command")
    assert run([*map(str, words)]) == 0
    assert capsys.readouterr().out == f"{report}\n"
    check_table(report.table())


def check_table(table: Scores) -> None:
    (row,) = table
    assert (row["object"], row["condition"], row["estimator"]) == ("plastic", "clean", "closed_form")
    assert str(table).splitlines()[0].split()[:3] == ["object", "condition", "estimator"]
    assert f"{1e3 * row['position_error']:.3g} mm" in str(table)
    assert table._repr_html_().count("<td>") == len(row)
    frame = table.to_pandas()
    assert frame["position_error"][0] == row["position_error"]


def test_a_model_in_memory_is_evaluated_and_calibrated_as_its_folder_is(
    collected: Path, tmp_path: Path, capsys: Capture
) -> None:
    sessions = str(collected / "sessions" / "hold_000.mcap")
    (printed,) = records(capsys, "evaluate", "demo", "--sessions", sessions, "--no-baselines")
    assert plain(mc.evaluate(mc.load("demo"), sessions=sessions, baselines=False).tree()) == alike(printed)
    out = tmp_path / "command"
    (printed,) = records(capsys, "calibrate", "demo", "--sessions", sessions, "--out", out)
    better = mc.calibrate(mc.load("demo"), sessions, tmp_path / "function")
    assert plain(better.tree()) == alike(printed)
    assert contents(tmp_path / "function") == contents(out)
    loose = mc.calibrate("demo", sessions)
    assert loose.calibration.heads == better.calibration.heads
    with pytest.raises(mc.InputError, match="trained on"):
        mc.evaluate(loose, sessions=sessions)
    other = mc.evaluate(loose, sessions=str(collected / "sessions" / "hold_001.mcap"), baselines=False)
    assert {"contact", "force", "position", "slip"} <= other.results.value.keys()


def test_tune(tmp_path: Path, capsys: Capture) -> None:
    twin = mc.VirtualSensor("prototype", seed=1)
    sound = twin.advance(1.5)[0]
    soundfile.write(tmp_path / "take.wav", sound.T, twin.sample_rate, subtype="FLOAT")
    words = ["tune", tmp_path / "take.wav", "--sensor", "prototype", "--out", tmp_path / "sensor.toml"]
    (printed,) = records(capsys, *words)
    tuned = mc.tune(tmp_path / "take.wav", sensor="prototype")
    measured = plain({name: getattr(tuned.measured(), name) for name in printed["tuning"]})
    assert {**measured, "time": ""} == {**printed["tuning"], "time": ""}
    assert (tuned.nominal, tuned.deviation) == (printed["nominal"], printed["deviation"])


@pytest.fixture
def touched(tmp_path: Path) -> Path:
    """A second of a virtual sensor that is pressed, as a file."""
    twin = mc.VirtualSensor("prototype", seed=1)
    twin.press(0.08, 1.0, material="plastic")
    soundfile.write(tmp_path / "touched.wav", twin.advance(1.0)[0].T, twin.sample_rate, subtype="FLOAT")
    return tmp_path / "touched.wav"


@pytest.mark.parametrize("words", [("live", "demo"), ("locate", "demo"), ("locate",)])
def test_listen(touched: Path, capsys: Capture, words: tuple[str, ...]) -> None:
    printed = records(capsys, *words, touched, "--string", "prototype")
    model = "demo" if "demo" in words else "closed_form"
    updates = list(mc.listen(touched, model, string="prototype"))
    assert len(updates) == len(printed) == 91
    for update, line in zip(updates, printed, strict=True):
        values = update.position.value, update.position.std
        assert line["time"] == update.time
        assert [line["position"], line["position_std"]] == [None if np.isnan(x) else x for x in values]
        assert (line["valid"], line["why_not"]) == (update.position.valid, update.position.reason)
    if words[0] == "live":
        tracked = [update.tracked.estimate("position") for update in updates]
        assert [line["tracked_position"] for line in printed] == [
            each.value if each.valid else None for each in tracked
        ]
        events = [[event.name for event in update.events] for update in updates]
        assert [[event["name"] for event in line["events"]] for line in printed] == events


def test_simulate(tmp_path: Path, capsys: Capture) -> None:
    words = ["simulate", "appendix", "--at", "0.2275", "--force", "0.5", "--route", "modal"]
    (printed,) = records(capsys, *words, "--out", tmp_path / "sound.wav")
    sound = mc.simulate("appendix", position=0.2275, force=0.5, route="modal")
    assert plain(sound.summary).items() <= printed.items()
    written, rate = soundfile.read(tmp_path / "sound.wav", dtype="float64", always_2d=True)
    assert rate == printed["sample_rate"] == sound.sample_rate
    np.testing.assert_allclose(written.T, printed["gain"] * sound.microphones, atol=2**-23)


def test_record(touched: Path, tmp_path: Path, capsys: Capture) -> None:
    about = {"object": "a rod", "material": "plastic", "radius": 0.004, "notes": "one touch"}
    options = [word for name, value in about.items() for word in (f"--{name}", value)]
    source = ["--source", "wav", "--set", f"source.path={touched}"]
    (printed,) = records(capsys, "record", tmp_path / "command.mcap", *source, *options)
    with mc.record(tmp_path / "function.mcap", touched, **about) as recording:  # pyright: ignore[reportArgumentType]
        assert recording.wait(60.0)
    assert recording.summary is not None
    by_clock = {"path", "seconds", "size"}
    summary = {name: value for name, value in recording.summary.tree().items() if name not in by_clock}
    assert plain(summary) == {name: value for name, value in printed.items() if name not in by_clock}
    one, other = (mc.read_session(tmp_path / f"{name}.mcap") for name in ("command", "function"))
    assert np.array_equal(one.audio.samples, other.audio.samples)
    assert one.description.object == other.description.object == "a rod"
    assert replace(one.description, name="same") == replace(other.description, name="same")


@pytest.mark.parametrize("kind", ["sources", "sinks", "estimators", "exports", "sensors", "plans", "models"])
def test_available(kind: str, capsys: Capture) -> None:
    (listed,) = records(capsys, "list", kind)
    assert mc.available(kind) == [entry["name"] for entry in listed[kind]]
    with pytest.raises(mc.InputError, match=f"did you mean '{kind}'"):
        mc.available(kind[:-1])


@pytest.mark.slow
@pytest.mark.usefixtures("made_up_features")
def test_train(learnable: Path, lesson: dict[str, Any], tmp_path: Path, capsys: Capture) -> None:
    pytest.importorskip("torch")
    file = tmp_path / "lesson.toml"
    file.write_text(dump_toml(lesson), encoding="utf-8")
    words = ["train", file, "--out", tmp_path / "command", "--set", "optimiser.epochs=2"]
    (printed,) = records(capsys, *words)
    data = mc.load_dataset(learnable)
    model = mc.train(data, tmp_path / "function", config=file, settings=["optimiser.epochs=2"])
    assert isinstance(model, TrainedModel)
    assert plain(model.tree()) == alike(printed)
    assert contents(tmp_path / "function" / "model") == contents(tmp_path / "command" / "model")
    assert mc.load(model.run).definition == model.definition
    report = mc.evaluate(model, data, baselines=False)
    assert report.card.windows == len(data.split.test)


@pytest.mark.real_time
def test_a_recording_runs_while_its_block_does(tmp_path: Path) -> None:
    path, threads = tmp_path / "take.mcap", threading.active_count()
    with mc.record(path, source="twin", seed=1, object="finger", notes="of a block") as recording:
        time.sleep(0.5)
        assert recording.running
        assert recording.summary is None
    assert threading.active_count() == threads
    assert recording.summary is not None
    assert recording.summary.interrupted
    session = mc.read_session(path)
    assert session.complete
    assert (session.description.object, session.description.notes) == ("finger", "of a block")
    assert recording.seconds == pytest.approx(recording.summary.seconds)
    assert 0.3 < recording.seconds < 5.0


def test_a_recording_that_cannot_begin_raises_before_its_block(tmp_path: Path) -> None:
    with pytest.raises(mc.InputError, match="tiwn"), mc.record(tmp_path / "take.mcap", "twin", tiwn=1):
        pytest.fail("the block is not entered")
    with (
        pytest.raises(mc.DeviceError),
        mc.record(tmp_path / "take.mcap", source="jack", server="nobody-plays-here"),
    ):
        pytest.fail("the block is not entered")
    assert not list(tmp_path.iterdir())


def test_a_device_that_is_lost_for_good_is_raised_after_its_block(tmp_path: Path) -> None:
    path = tmp_path / "take.mcap"
    with pytest.raises(mc.DeviceError, match="48000 Hz"), mc.record(path, GoneSource()) as recording:
        assert recording.wait(30.0)
    session = mc.read_session(path)
    assert session.complete
    assert session.audio.samples.shape[1] == GoneSource().blocks * 512


def test_a_block_that_fails_leaves_a_whole_session_and_its_own_error(tmp_path: Path) -> None:
    path = tmp_path / "take.mcap"
    with pytest.raises(KeyError, match="mine"), mc.record(path, source="twin", speed=0.0):
        raise KeyError("mine")
    assert mc.read_session(path).complete


def test_instruments_and_settings_are_those_of_the_command(tmp_path: Path) -> None:
    for given, allowed in ((["net-fft"], "net_ft"), (["a:pose_udp", "a:pose_udp"], "a different name")):
        with (
            pytest.raises(mc.InputError, match=allowed),
            mc.record(tmp_path / "take.mcap", source="twin", instruments=given),
        ):
            pytest.fail("the block is not entered")
