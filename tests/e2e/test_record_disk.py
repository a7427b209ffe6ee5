"""A disk that fills up while recording: a clean end, a valid file, and a line that says so."""

import os
import resource
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tests.e2e.conftest import DISK_SIZE, paced

from monochord.sessions import check, read_session

RATE = 44100


@pytest.fixture
def fast(sound: Path) -> list[str]:
    """The options that record noise at twenty times the pace of real time."""
    return paced(sound, speed=20)


def ended_full(recorder: Any) -> dict[str, Any]:
    """Return the summary of a recorder whose disk filled up, and look its file over."""
    summary = recorder.end()
    assert recorder.process.returncode == 2
    assert summary["failure"]
    assert recorder.shown.splitlines()[-1].startswith("monochord: ")
    report = check(recorder.out)
    assert report.sound, report.faults
    frames = read_session(recorder.out).audio.samples.shape[1]
    # What is counted is surely there; of what was being written as the disk filled up, some may be.
    assert frames >= summary["frames"] > 5 * RATE
    assert frames - summary["frames"] < 20 * 0.5 * RATE
    return summary


def test_a_full_disk_ends_it_cleanly(
    start_recorder: Callable[..., Any], net_ft: list[str], fast: list[str], small_disk: Path
) -> None:
    free = ["--set", "disk.start=0", "--set", "disk.stop=0"]
    recorder = start_recorder(*fast, *net_ft, *free, out=small_disk / "take.mcap")
    summary = ended_full(recorder)
    assert summary["size"] > 0.5 * DISK_SIZE
    saved = len(read_session(recorder.out).readings("wrench").time)
    assert 0 <= saved - summary["instruments"]["net_ft"]["readings"] < 0.5 * 7000


@pytest.mark.real_time  # at this pace half a second's pause would fill the margin
def test_it_ends_before_the_disk_is_full(
    start_recorder: Callable[..., Any], fast: list[str], small_disk: Path
) -> None:
    free = ["--set", f"disk.start={DISK_SIZE // 2}", "--set", f"disk.stop={DISK_SIZE // 3}"]
    recorder = start_recorder(*fast, *free, out=small_disk / "take.mcap")
    ended_full(recorder)
    events = read_session(recorder.out).events
    assert sum(event.kind == "stop" for event in events) == 1
    disk = os.statvfs(small_disk)
    assert disk.f_bavail * disk.f_frsize > DISK_SIZE // 4


@pytest.mark.parametrize("limit", [5_300_000, 6_123_457])
@pytest.mark.slow
def test_a_limit_on_the_size_of_files_ends_it_cleanly(
    start_recorder: Callable[..., Any], fast: list[str], limit: int
) -> None:
    recorder = start_recorder(*fast)
    resource.prlimit(recorder.process.pid, resource.RLIMIT_FSIZE, (limit, limit))
    ended_full(recorder)
    assert 0.3 * limit < recorder.out.stat().st_size <= limit
    assert read_session(recorder.out).complete


@pytest.mark.slow
def test_a_limit_too_low_for_a_session_is_refused(
    start_recorder: Callable[..., Any], fast: list[str]
) -> None:
    limit = 1_000_000
    recorder = start_recorder(
        *fast, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
    )
    _, shown = recorder.process.communicate(timeout=60)
    assert recorder.process.returncode == 2
    assert str(limit) in shown.splitlines()[-1]
    assert not recorder.out.exists()
