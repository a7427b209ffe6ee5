"""Tuning and calibration step by step, on the twin: they do what the commands do."""

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.capture.sources import SOURCES
from monochord.live.guides.run_tasks import MAX_WAITING, RunTasks
from monochord.live.loop import opened
from monochord.live.settings import LiveRun
from monochord.live.update import Update
from monochord.page.commands import Commands
from monochord.perception.model import load
from monochord.physics.sensors import load_sensor
from monochord.sessions import read_session

TOUCHES = [
    {"start": 2.5 + 3.5 * k, "position": 0.05 + 0.03 * k, "force": 0.5 + 0.4 * k, "seconds": 2.2}
    for k in range(3)
]


def performed(tasks: RunTasks, seconds: float, during: Callable[[Update], Update]) -> dict[str, Any]:
    """Let a run pass by, and return what the page shows once the step is over."""
    source = {"name": "twin", "speed": 0.0, "script": TOUCHES, "world": "plausible", "build": 131}
    tree = {"source": source, "estimator": {"name": "model", "path": "demo"}, "sinks": {}, "seconds": seconds}
    setup = LiveRun.read({**tree, "window": {"hop": 0.05}})
    with opened(setup) as live:
        for update in live:
            tasks.take(during(update))
    deadline = time.monotonic() + 120.0
    while "guided" in (state := tasks.state()):
        assert time.monotonic() < deadline, state
        time.sleep(0.05)
    return dict(state)


@pytest.fixture
def tasks(tmp_path: Path) -> RunTasks:
    with SOURCES.build("twin", {"speed": 0.0}).open() as stream:
        return RunTasks(stream.signal, 0.2, tmp_path, "demo")


def begun(tasks: RunTasks) -> None:
    deadline = time.monotonic() + 30.0
    while "share" not in tasks.state().get("guided", {}):
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_the_sensor_as_tuned_is_written(tasks: RunTasks, tmp_path: Path) -> None:
    assert tasks.tune()
    begun(tasks)
    assert not tasks.calibrate(3)  # one step at a time
    state = performed(tasks, 3.2, lambda update: update)
    (file,) = tmp_path.iterdir()
    assert str(file) in state["lines"][-1]
    tuned = load_sensor(str(file)).string.tension
    assert tuned == pytest.approx(load_sensor("prototype").string.tension, rel=0.05)
    tasks.close()
    assert not tasks.tune()


@pytest.mark.slow
@pytest.mark.parametrize("typed", [False, True])
def test_a_model_is_adapted_to_touches_that_are_held(tasks: RunTasks, tmp_path: Path, *, typed: bool) -> None:
    assert tasks.calibrate(3)
    begun(tasks)

    def during(update: Update) -> Update:
        if not typed:
            return update
        for touch in TOUCHES:
            if abs(update.prediction.time - touch["start"] - 0.2) < 0.02:
                assert tasks.hold(touch["position"], touch["force"])
                assert not tasks.hold(touch["position"], touch["force"])  # it is held already
        assert not tasks.hold(-1.0, 1.0)
        assert not tasks.hold(0.1, 51.0)  # grams
        return replace(update, truth={})

    state = performed(tasks, 13.0, during)
    (folder,) = tmp_path.iterdir()
    assert str(folder) in state["lines"][-1]
    before, after = (load(each).definition.heads["force"].correction for each in ("demo", folder))
    assert before is not None
    assert after is not None
    assert after.touches in (before.touches, before.touches + 3)  # as it was, where they did not help
    tasks.close()


def test_a_touch_outside_the_sensing_range_is_told_and_not_counted(tasks: RunTasks) -> None:
    assert tasks.calibrate(3)
    begun(tasks)
    script = [
        {"start": 2.3, "position": 0.03, "force": 1.0, "seconds": 2.0},
        {"start": 5.6, "position": 0.15, "force": 1.0, "seconds": 2.0},  # its very end, as 32 bits have it
    ]
    source = {"name": "twin", "speed": 0.0, "script": script}
    tree = {"source": source, "estimator": {"name": "closed_form"}, "sinks": {}, "seconds": 7.6}
    says: list[tuple[float, str]] = []
    with opened(LiveRun.read({**tree, "window": {"hop": 0.05}})) as live:
        for update in live:
            tasks.take(update)
            says.append((update.prediction.time, tasks.state()["guided"]["says"]))
    outside = [time_ for time_, words in says if "outside" in words]
    assert 2.2 < min(outside) < max(outside) < 4.4
    assert len(outside) > 30
    assert tasks.state()["guided"]["count"] == 1
    assert tasks.cancel()
    tasks.close()


def test_a_touch_that_cannot_be_is_not_taken_and_the_page_says_why(tasks: RunTasks) -> None:
    assert tasks.calibrate(3)
    begun(tasks)
    tree = {"source": {"name": "twin", "speed": 0.0, "script": [TOUCHES[0]]}, "sinks": {}, "seconds": 2.4}
    with opened(LiveRun.read({**tree, "estimator": {"name": "tuning"}})) as live:
        for update in live:
            tasks.take(replace(update, truth={}))
    for position, force in ((0.1, 51.0), (0.1, -1.0), (0.3, 1.0)):
        assert not tasks.hold(position, force)
    asked = tasks.state()["guided"]["says"]
    grams = b'{"do": "hold", "position": 0.1, "force": 1224, "unit": "g"}'
    commands = Commands(tasks.commands)
    commands.carry_out(commands.read(grams))  # 12 N
    assert tasks.state()["guided"]["says"] != asked
    tasks.close()


def test_more_than_can_be_written_is_refused_and_said(tasks: RunTasks, tmp_path: Path) -> None:
    asked = [tasks.record(on=number % 2 == 0) for number in range(20 * MAX_WAITING)]
    assert not all(asked)
    assert tasks.state()["answer"]
    tasks.close()
    assert len([*tmp_path.glob("*.mcap")]) <= sum(asked)


def test_a_step_is_cancelled(tasks: RunTasks, tmp_path: Path) -> None:
    assert tasks.calibrate(3)
    begun(tasks)
    assert tasks.cancel()
    assert "guided" not in tasks.state()
    tasks.close()
    assert not [*tmp_path.iterdir()]


def test_labelled_touches_become_a_session(tasks: RunTasks, tmp_path: Path) -> None:
    assert tasks.label(3)
    begun(tasks)
    assert not tasks.touch("undo")  # there is none

    def during(update: Update) -> Update:
        for touch in TOUCHES:
            if abs(update.prediction.time - touch["start"] - 0.2) < 0.02:
                assert tasks.hold(touch["position"], touch["force"])
        if abs(update.prediction.time - TOUCHES[2]["start"] - 1.2) < 0.02:
            assert tasks.touch("undo")
            assert tasks.cancel()  # two are enough
        return replace(update, truth={})

    state = performed(tasks, 13.0, during)
    (session,) = tmp_path.glob("touches_*.mcap")
    assert str(session) in state["lines"][-1]
    labels = read_session(session).labels
    touched = labels.columns["contact"] == 1.0
    places = sorted({*np.round(labels.columns["position"][touched], 3).tolist()})
    assert places == [touch["position"] for touch in TOUCHES[:2]]
    assert np.isnan(labels.columns["position"][~touched]).all()
    assert (labels.columns["contact"] == 0.0).sum() > 100
    (table,) = tmp_path.glob("touches_*.csv")
    assert {*tmp_path.iterdir()} == {session, table}
    tasks.close()


def test_a_labelling_without_a_touch_leaves_nothing(tasks: RunTasks, tmp_path: Path) -> None:
    assert tasks.label(3)
    begun(tasks)
    assert tasks.cancel()
    tasks.close()
    assert not [*tmp_path.iterdir()]
