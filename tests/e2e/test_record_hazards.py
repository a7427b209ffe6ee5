"""A closed terminal, a second recorder, a clock that is set, a machine that sleeps."""

import os
import pty
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from tests.cli.running import refusal
from tests.e2e.conftest import HOUR, MONOCHORD, ClockToSet, paced

from monochord.sessions import SessionReader, check, read_session

RATE = 44100
BEGUN = 60_000


def whole(recorder: Any, sound: Path) -> SessionReader:
    """Return the session, in which every frame of the sound must be, one after the other."""
    report = check(recorder.out)
    assert report.sound, report.faults
    session = read_session(recorder.out)
    assert session.complete
    recorded = session.audio.samples
    expected = soundfile.read(sound, always_2d=True)[0].astype(np.float32)
    assert session.audio.gaps == ()
    assert np.array_equal(recorded, np.resize(expected, (recorded.shape[1], 2)).T)
    return session


def test_a_second_recorder_on_the_same_file_is_refused(
    start_recorder: Callable[..., Any], sound: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recorder = start_recorder(*paced(sound))
    recorder.wait_for_bytes(BEGUN)
    assert refusal(capsys, "record", str(recorder.out), *paced(sound))
    recorder.wait_for_more(50_000)
    recorder.end(signal.SIGINT)
    whole(recorder, sound)


@pytest.mark.slow
def test_of_two_recorders_that_begin_at_once_one_is_refused(
    start_recorder: Callable[..., Any], sound: Path, tmp_path: Path
) -> None:
    out = tmp_path / "one.mcap"
    both = [start_recorder(*paced(sound), "--seconds", "1", out=out) for _ in range(2)]
    ended = [(each, each.process.communicate(timeout=60)[1]) for each in both]
    assert sorted(each.process.returncode for each, _ in ended) == [0, 2]
    refused = next(shown for each, shown in ended if each.process.returncode == 2)
    assert "Traceback" not in refused
    whole(both[0], sound)


def test_a_terminal_that_is_closed_ends_it_with_everything_saved(sound: Path) -> None:
    terminal, side = pty.openpty()
    out = sound.with_name("take.mcap")
    # A process that begins a session of its own takes the terminal that it opens for its own.
    code = "import os, sys; os.close(os.open(os.ttyname(0), os.O_RDWR)); os.execv(sys.argv[1], sys.argv[1:])"
    command = [sys.executable, "-c", code, MONOCHORD, "record", str(out), *paced(sound)]
    with subprocess.Popen(command, stdin=side, stdout=side, stderr=side, start_new_session=True) as process:
        os.close(side)
        deadline = time.monotonic() + 150.0
        while not (out.exists() and out.stat().st_size > 300_000):
            assert process.poll() is None
            assert time.monotonic() < deadline
            os.set_blocking(terminal, False)
            try:
                os.read(terminal, 65536)
            except BlockingIOError:
                time.sleep(0.02)
        os.close(terminal)
        process.wait(60)
    report = check(out)
    assert report.sound, report.faults
    assert read_session(out).complete
    assert report.seconds > 0.5


@pytest.mark.slow
def test_a_hangup_that_is_ignored_ends_nothing(start_recorder: Callable[..., Any], sound: Path) -> None:
    recorder = start_recorder(
        *paced(sound, 4), preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN)
    )
    recorder.wait_for_bytes(BEGUN)
    recorder.process.send_signal(signal.SIGHUP)
    recorder.wait_for_more(300_000)
    assert not recorder.end(signal.SIGINT)["failure"]
    whole(recorder, sound)


def test_a_folder_that_cannot_be_written_is_refused(sound: Path, tmp_path: Path) -> None:
    folder = tmp_path / "theirs"
    folder.mkdir()
    out = folder / "take.mcap"
    command = [MONOCHORD, "record", str(out), *paced(sound)]
    if os.geteuid() == 0:
        if not shutil.which("setpriv"):
            pytest.skip("setpriv is not installed, and root may write everywhere")
        os.chown(folder, 65534, 65534)
        command = ["setpriv", "--bounding-set=-all", *command]  # root that may no more than others
    else:
        folder.chmod(0o555)
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    folder.chmod(0o755)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert str(out) in done.stderr
    assert not out.exists()


@pytest.mark.real_time
def test_setting_the_wall_clock_is_recorded_and_moves_nothing(
    start_recorder: Callable[..., Any], net_ft: list[str], sound: Path, clock_to_set: ClockToSet
) -> None:
    recorder = start_recorder(*paced(sound), *net_ft, env=clock_to_set.environment)
    recorder.wait_for_bytes(800_000)
    clock_to_set.set()
    recorder.wait_for_more(800_000)
    summary = recorder.end(signal.SIGINT)
    assert summary["flags"]["clock_step"] == 1
    session = whole(recorder, sound)
    (step,) = [event for event in session.events if event.kind == "clock_step"]
    assert step.data["clock"] == "realtime"
    assert step.data["seconds"] == pytest.approx(HOUR, abs=0.5)
    wrench = session.readings("wrench")
    for times in (wrench.time, session.audio.anchor_time, session.clocks.time):
        assert -0.1 <= times[0] < times[-1] < HOUR / 10
    assert np.all(np.diff(session.audio.anchor_time) > 0.0)


@pytest.mark.real_time
def test_a_machine_that_sleeps_loses_only_what_came_meanwhile(
    start_recorder: Callable[..., Any], net_ft: list[str], sound: Path
) -> None:
    """It is stopped, as a machine's sleep does; the network keeps more than two of the seconds."""
    recorder, seconds = start_recorder(*paced(sound), *net_ft), 5.0
    recorder.wait_for_bytes(600_000)
    recorder.process.send_signal(signal.SIGSTOP)
    before = recorder.out.read_bytes()
    time.sleep(seconds)
    assert recorder.out.stat().st_size == len(before)
    recorder.process.send_signal(signal.SIGCONT)
    recorder.wait_for_bytes(len(before) + 600_000)
    summary = recorder.end(signal.SIGINT)
    assert recorder.process.returncode == 0
    assert recorder.out.read_bytes().startswith(before[: before.rindex(b"/description")])
    session = whole(recorder, sound)  # a file waits: it has no gap
    wrench = session.readings("wrench")
    hole = np.diff(wrench.time).max()
    # The network kept what its buffer holds; the rest is lost, counted, and nothing stands in its place.
    assert hole > 0.5 * seconds
    assert wrench.missing > 0
    assert summary["instruments"]["net_ft"]["missing"] == wrench.missing
    assert summary["flags"]["missing"] >= 1
