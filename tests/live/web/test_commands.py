"""Commands of a page that follow each other at once, or come while a result is computed: none is lost."""

import itertools
import json
import threading
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tests.live.web.run_server import RunServer
from tests.live.web.test_server import free, live, told
from websockets.sync.client import ClientConnection

from monochord.core.types import Signal
from monochord.live.guides.run_tasks import RunTasks
from monochord.live.loop import opened
from monochord.live.settings import LiveRun
from monochord.live.update import Update
from monochord.live.web.run_page import View
from monochord.physics.sensors import load_sensor, with_sensor
from monochord.sessions import read_session

SENSOR = load_sensor("prototype")
SIGNAL = with_sensor(Signal(sample_rate=44100, channels=2), SENSOR)
TOUCHES = [
    {"start": 2.5 + 3.0 * k, "position": 0.06 + 0.03 * k, "force": 0.5 + 0.4 * k, "seconds": 1.7}
    for k in range(3)
]
CANCEL, TUNE = {"do": "cancel"}, {"do": "tune"}
CALIBRATE = {"do": "calibrate", "touches": 3}
RECORD, STOP = {"do": "record", "on": True}, {"do": "record", "on": False}


def lived(seconds: float) -> tuple[Update, ...]:
    """Return three touches of the twin as a run hands them over: untouched for 2.5 s before them."""
    source = {"name": "twin", "speed": 0.0, "script": TOUCHES, "world": "plausible", "build": 131}
    tree = {"source": source, "estimator": {"name": "model", "path": "demo"}, "sinks": {}, "seconds": seconds}
    with opened(LiveRun.read({**tree, "window": {"hop": 0.05}})) as run:
        return tuple(run)


@pytest.fixture(scope="module")
def untouched() -> tuple[Update, ...]:
    return lived(2.0)


@pytest.fixture(scope="module")
def updates() -> tuple[Update, ...]:
    return lived(11.0)


@contextmanager
def shown(updates: Sequence[Update], folder: Path, pause: float = 0.005) -> Generator[ClientConnection]:
    """Run a server that shows these updates over and over, usually ten times as fast, and connect to it."""
    ended = threading.Event()

    def play(writer: View) -> None:
        frames = updates[-1].window.start + updates[-1].window.samples.shape[1]
        for turn in itertools.count():
            for update in updates:
                window = replace(update.window, start=update.window.start + turn * frames)
                writer.write(replace(update, window=window))
                if ended.wait(pause):
                    return

    tasks = RunTasks(SIGNAL, SENSOR.string.length, folder, "demo")
    with (
        RunServer(port=free()) as server,
        server.show(SIGNAL, SENSOR.string.length, None, tasks=tasks) as writer,
    ):
        player = threading.Thread(target=play, args=(writer,))
        player.start()
        try:
            with live(server) as client:
                yield client
        finally:
            ended.set()
            player.join()


def send(client: ClientConnection, *commands: dict[str, Any]) -> None:
    for command in commands:
        client.send(json.dumps(command))


def guided(tasks: Any) -> Any:
    return tasks.get("guided", {}).get("name")


def computes(tasks: Any) -> bool:
    return "Computing" in tasks.get("guided", {}).get("says", "")


@pytest.mark.parametrize(
    ("before", "commands", "then"),
    [
        pytest.param(CALIBRATE, [CANCEL, RECORD], (None, True), id="cancel-record"),
        pytest.param(CALIBRATE, [CANCEL, TUNE], ("tuning", False), id="cancel-tune"),
        pytest.param(None, [CALIBRATE, CANCEL], (None, False), id="calibrate-cancel"),
        pytest.param(None, [CALIBRATE, CANCEL, TUNE, RECORD], ("tuning", True), id="all"),
        pytest.param(None, [RECORD, STOP], (None, False), id="record-stop"),
        pytest.param(None, [RECORD, CALIBRATE], ("calibration", True), id="record-calibrate"),
        pytest.param(RECORD, [STOP, RECORD], (None, True), id="stop-record"),
        pytest.param(RECORD, [STOP, TUNE], ("tuning", False), id="stop-tune"),
    ],
)
def test_of_commands_that_follow_at_once_each_takes_effect(
    untouched: Sequence[Update],
    tmp_path: Path,
    before: dict[str, Any] | None,
    commands: list[dict[str, Any]],
    then: tuple[str | None, bool],
) -> None:
    with shown(untouched, tmp_path, 0.05) as client:
        if before is not None:
            send(client, before)
            told(client, lambda tasks: "recording" in tasks or "share" in tasks.get("guided", {}))
        send(client, *commands)
        is_then = lambda tasks: (guided(tasks), "recording" in tasks) == then  # noqa: E731
        told(client, is_then)
        time.sleep(0.3)  # nothing comes after that
        assert is_then(told(client, bool))
    count = [*commands, before or {}].count(RECORD)
    sessions = [*tmp_path.glob("*.mcap")]
    assert len(sessions) == count or (then == (None, False) and count == 1)
    assert all(read_session(path).complete for path in sessions)


def test_a_step_that_cannot_begin_says_why(untouched: Sequence[Update], tmp_path: Path) -> None:
    with shown(untouched, tmp_path, 0.05) as client:
        send(client, CALIBRATE, TUNE)
        tasks = told(client, lambda tasks: tasks["answer"])
        assert guided(tasks) == "calibration"
        send(client, CANCEL)
        tasks = told(client, lambda tasks: not guided(tasks))
        assert not tasks["answer"]


@pytest.mark.slow
def test_a_recording_begins_while_a_result_is_computed(updates: Sequence[Update], tmp_path: Path) -> None:
    with shown(updates, tmp_path) as client:
        send(client, CALIBRATE)
        told(client, computes)
        send(client, RECORD)
        tasks = told(client, lambda tasks: tasks.get("recording", {}).get("seconds", 0.0) > 0.0)
        assert computes(tasks)
        send(client, STOP)
        told(client, lambda tasks: ".mcap" in tasks["saved"])
        assert told(client, lambda tasks: tasks["lines"])["lines"]
    (session,) = tmp_path.glob("*.mcap")
    recorded = read_session(session)
    assert recorded.complete
    assert recorded.audio.gaps == ()


@pytest.mark.slow
def test_a_computation_is_cancelled_and_the_next_step_begins(
    updates: Sequence[Update], tmp_path: Path
) -> None:
    with shown(updates, tmp_path) as client:
        send(client, CALIBRATE)
        told(client, computes)
        send(client, CANCEL, TUNE)
        tasks = told(client, lambda tasks: guided(tasks) == "tuning")
        assert not tasks["lines"]
        told(client, lambda tasks: tasks["lines"])
    assert not [*tmp_path.glob("calibrated_*")]  # what was cancelled is not saved
