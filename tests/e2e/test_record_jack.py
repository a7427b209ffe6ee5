"""The recorder on a real JACK server and a force sensor of 7000 readings a second, all separate processes."""

import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
import soundfile

from monochord.sessions import SessionReader, check, read_session

pytestmark = pytest.mark.jack
RATE = 44100


def jack(server: Any) -> list[str]:
    return ["--set", f"source.server={server.name}", "--set", "source.ports=player:"]


def sound_session(path: Path) -> SessionReader:
    report = check(path)
    assert report.sound, report.faults
    return read_session(path)


def test_what_is_played_is_in_the_session_beside_force_and_pose(
    jack_server: Any,
    play: Callable[[Path], Any],
    recording: Path,
    net_ft: list[str],
    pose_dds: list[str],
    start_recorder: Any,
) -> None:
    play(recording)
    recorder = start_recorder(*jack(jack_server), *net_ft, *pose_dds, "--seconds", "2.5")
    summary = recorder.end()
    assert recorder.process.returncode == 0
    session = sound_session(recorder.out)
    played = soundfile.read(recording, always_2d=True)[0].T.astype(np.float32)
    first = int(np.argmax(np.any(session.audio.samples != 0.0, axis=0)))
    lead = int(np.argmax(np.any(played != 0.0, axis=0)))
    length = played.shape[1] - lead
    assert np.array_equal(session.audio.samples[:, first : first + length], played[:, lead:])
    assert (summary["dropped"], summary["gaps"], session.audio.gaps) == (0, 0, ())
    assert summary["instruments"]["net_ft"]["missing"] == session.readings("wrench").missing == 0
    pose = session.readings("pose")
    assert np.allclose(pose.values, [0.1, 0.0, -0.001, 0.0, 0.0, 0.0, 1.0])
    assert len(pose.time) == pytest.approx(2.5 * 250, rel=0.2)
    assert np.all(session.audio.device_frame >= 0)
    assert set(session.clocks.offsets) == {"jack", "monotonic_raw", "realtime"}


def test_a_killed_server_is_a_gap_and_the_force_goes_on(
    jack_server: Any, play: Callable[[Path], Any], recording: Path, net_ft: list[str], start_recorder: Any
) -> None:
    play(recording)
    recorder = start_recorder(*jack(jack_server), *net_ft)
    recorder.wait_for_bytes(500_000)
    killed = time.monotonic()
    jack_server.kill()
    time.sleep(0.6)
    recorder.wait_for_more(100_000)  # force alone
    jack_server.restart()
    play(recording)
    returned = time.monotonic()
    recorder.wait_for_more(500_000)
    summary = recorder.end(signal.SIGINT)
    assert recorder.process.returncode == 0
    session = sound_session(recorder.out)
    (gap,) = session.audio.gaps
    away = (gap[1] - gap[0]) / RATE
    assert away == pytest.approx(returned - killed, abs=0.7)
    assert (summary["gaps"], summary["dropped"], summary["reconnects"]) == (1, gap[1] - gap[0], 1)
    events = {event.kind: event for event in session.events if event.data.get("stream") == "audio"}
    assert events["gap"].data["frames"] == gap[1] - gap[0]
    assert {"silent", "back", "reconnect"} <= set(events)
    assert events["silent"].time < events["back"].time
    wrench = session.readings("wrench")
    assert wrench.missing == summary["instruments"]["net_ft"]["missing"] == 0
    meanwhile = (wrench.time > events["silent"].time) & (wrench.time < events["back"].time)
    span = events["back"].time - events["silent"].time
    assert np.count_nonzero(meanwhile) == pytest.approx(7000 * span, rel=0.2)
    # The gap is as long as the time that passed: the last and the first anchor beside it are on one clock.
    begins = session.audio.anchor_time - session.audio.anchor_frame / RATE
    after = int(np.argmax(session.audio.anchor_frame >= gap[1]))
    assert begins[after] == pytest.approx(begins[after - 1], abs=0.1)


@pytest.mark.slow
def test_a_clock_set_wrong_by_a_killed_client_is_reported(
    jack_server: Any, play: Callable[[Path], Any], recording: Path, start_recorder: Any
) -> None:
    play(recording)
    first = start_recorder(*jack(jack_server))
    first.wait_for_bytes(200_000)
    first.kill()
    second = start_recorder(*jack(jack_server))
    second.wait_for_bytes(500_000)
    summary = second.end(signal.SIGINT)
    session = sound_session(second.out)
    audio, (stop,) = session.audio, [event for event in session.events if event.kind == "stop"]
    newest = audio.anchor_time[-1] + (audio.samples.shape[1] - audio.anchor_frame[-1]) / RATE
    assert abs(stop.time - newest) < 0.3 or summary["flags"].get("clock_doubt")


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_a_minute_costs_a_quarter_of_a_core_at_most_and_memory_is_flat(
    jack_server: Any,
    play: Callable[[Path], Any],
    recording: Path,
    net_ft: list[str],
    pose_dds: list[str],
    start_recorder: Any,
    record_property: Callable[[str, object], None],
) -> None:
    play(recording)
    recorder = start_recorder(*jack(jack_server), *net_ft, *pose_dds, "--seconds", "60")
    recorder.wait_for_bytes(3_000_000)
    process = psutil.Process(recorder.process.pid)
    begin, before, memory = time.monotonic(), process.cpu_times(), process.memory_info().rss
    time.sleep(50.0)
    after, now = process.cpu_times(), process.memory_info().rss
    spent = after.user + after.system - before.user - before.system
    share = spent / (time.monotonic() - begin)
    summary = recorder.end()
    record_property("cpu", share)
    record_property("grown_mb", 1e-6 * (now - memory))
    assert share <= 0.25
    assert now - memory < 5e6
    assert summary["dropped"] == 0
    wrench = summary["instruments"]["net_ft"]
    assert (wrench["missing"], wrench["faulty"]) == (0, 0)
    assert wrench["readings"] == pytest.approx(60 * 7000, rel=0.01)
    assert summary["instruments"]["pose_dds"]["readings"] == pytest.approx(60 * 250, rel=0.05)
    assert sound_session(recorder.out).readings("wrench").missing == 0
