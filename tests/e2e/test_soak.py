"""A long recording whose JACK server is killed again and again: all is there or marked, and memory is flat.

``MONOCHORD_SOAK_SECONDS`` tells how long: 120 by default, 3600 for the hour.
"""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from tests.e2e.test_record_jack import sound_session
from tests.play_count import BLOCK, RATE, SCALE
from tests.ports import free_ports

from monochord.sessions import SessionReader

pytestmark = pytest.mark.jack
SECONDS = float(os.environ.get("MONOCHORD_SOAK_SECONDS", "120"))
KILLS = 5
SEED = 20
WARM = 0.4
"""Share of the time, from the start, that is left out when memory is looked at."""
PERIOD = 512
BACK = 15.0
"""Seconds in which a recorder must be back once there is something to connect to."""
MIN_SECONDS = 4.0
"""Seconds that a server lives at least once the recorder is back, so that events tell of each by itself."""
AWAY = (0.0, 1.0, 0.0, 1.0, 1.0)
"""Seconds after each kill without a server: some are back before silence is noticed, some are not."""
POSES = 250


class Counter:
    """A process that plays the count into a server, after the signal to begin."""

    def __init__(self, server: str, life: int, frames: int) -> None:
        script = Path(__file__).parents[1] / "play_count.py"
        command = [sys.executable, str(script), server, str(life), str(frames)]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)
        assert self.says(60.0) == "prepared"

    def begin(self) -> None:
        """Let it enter the server."""
        assert self._process.stdin
        self._process.stdin.write("go\n")
        self._process.stdin.flush()
        assert self.says(20.0) == "ready"

    def says(self, patience: float) -> str:
        """Return its next line, nothing where it says none in so many seconds."""
        assert self._process.stdout
        return (
            self._process.stdout.readline().strip()
            if select.select([self._process.stdout], [], [], patience)[0]
            else ""
        )

    def end(self) -> None:
        """Take it away."""
        self._process.terminate()
        self._process.communicate(timeout=20)


class PoseSender:
    """Sends poses as JSON with a count, so many a second, from a thread."""

    def __init__(self, port: int) -> None:
        self.sent = 0
        self._address, self._ended = ("127.0.0.1", port), threading.Event()
        self._thread = threading.Thread(target=self._send, daemon=True)
        self._thread.start()

    def close(self) -> int:
        """End; return how many were sent."""
        self._ended.set()
        self._thread.join()
        return self.sent

    def _send(self) -> None:
        begin = time.monotonic()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            while not self._ended.wait(max(0.0, begin + self.sent / POSES - time.monotonic())):
                pose = {
                    "stamp": self.sent / POSES,
                    "position": [1e-6 * (self.sent % 1000), 0, 0],
                    "sequence": self.sent,
                }
                sock.sendto(json.dumps(pose).encode(), self._address)
                self.sent += 1


class Memory:
    """Memory of a process in RAM, looked at every half second: its own, and what it shares with a server."""

    def __init__(self, pid: int) -> None:
        self._rows: list[tuple[float, int, int]] = []
        self._status, self._ended = Path(f"/proc/{pid}/status"), threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    def close(self) -> np.ndarray:
        """End; return times in s, and bytes of its own and shared ones, (3, n)."""
        self._ended.set()
        self._thread.join()
        rows = np.array(self._rows).T
        rows[0] -= rows[0, 0]
        return rows

    def _look(self) -> None:
        while not self._ended.wait(0.5):
            lines = (line.partition(":") for line in self._status.read_text().splitlines())
            size = {name: 1024 * int(text.split()[0]) for name, _, text in lines if name.startswith("Rss")}
            self._rows.append((time.monotonic(), size["RssAnon"] + size["RssFile"], size["RssShmem"]))


def kill_times() -> list[float]:
    """Return when the server is killed, in s after the start: once at random in each sixth but the first."""
    random = Random(SEED)
    return [SECONDS * (number + random.uniform(-0.3, 0.3)) / (KILLS + 1) for number in range(1, KILLS + 1)]


@pytest.mark.slow
@pytest.mark.timeout(600 + 3 * SECONDS)
def test_a_long_recording_through_five_killed_servers_has_all_or_says_what_it_lacks(
    jack_server: Any, net_ft: list[str], start_recorder: Any, record_property: Callable[[str, object], None]
) -> None:
    port = free_ports(1)[0]
    options = ["--set", f"source.server={jack_server.name}", "--set", "source.ports=player:", *net_ft]
    options += ["--instrument", f"pose_udp={port}", "--set", f"pose_udp.rate={POSES}"]
    times = [*kill_times(), SECONDS]
    played: list[int] = []
    killed: list[float] = []
    tape = round(RATE * (max(np.diff([0.0, *times])) + 40.0))
    player = Counter(jack_server.name, 0, tape)
    player.begin()
    recorder = start_recorder(*options, env={**os.environ, "PYTHONFAULTHANDLER": "1"})
    recorder.wait_for_bytes(200_000)
    poses, memory, begin = PoseSender(port), Memory(recorder.process.pid), time.monotonic()
    for life, until in enumerate(times):
        _wait_until_recorded(player, recorder)
        following = Counter(jack_server.name, life + 1, tape) if life < KILLS else None
        end = max(begin + until, time.monotonic() + MIN_SECONDS)
        while time.monotonic() < end:
            time.sleep(0.1)
            assert recorder.process.poll() is None, recorder.process.communicate()
        if following:
            killed.append(time.monotonic())
            jack_server.kill()
            played.append(int(player.says(20.0)))
            player.end()
            player = following
            time.sleep(AWAY[life])
            jack_server.start()
            player.begin()
    sent = poses.close()
    time.sleep(0.3)
    looks = memory.close()
    summary = recorder.end(signal.SIGINT)
    player.end()
    session = sound_session(recorder.out)
    figures = {**_memory(looks), **_audio(session, summary, played, killed)}
    figures |= _wrench(session, summary) | _poses(session, summary, sent)
    for name, value in figures.items():
        record_property(name, value)
    print(json.dumps(figures))  # noqa: T201
    _tells_of_kills(session, summary, killed)
    assert figures["memory_growth_share"] < 0.01, figures


def _wait_until_recorded(player: Counter, recorder: Any) -> None:
    """Wait for the recorder to be connected; where it is not, let it say what it is at."""
    if player.says(BACK) != "playing":
        recorder.process.send_signal(signal.SIGABRT)
        pytest.fail(
            f"not connected {BACK:g} s after the player was there:\n{recorder.process.communicate()[1]}"
        )


def _memory(looks: np.ndarray) -> dict[str, float]:
    """Return how memory grew from the warm-up to the end, by a straight line through all looks in between.

    What is shared with a JACK server, some 100 MB that come and go with it, is counted by itself.
    """
    seconds, own, shared = looks
    warm = seconds > WARM * seconds[-1]
    slope, _ = np.polyfit(seconds[warm], own[warm], 1)
    grown = slope * (seconds[warm][-1] - seconds[warm][0])
    return {
        "memory_begin_mb": 1e-6 * float(np.median(own[warm][:20])),
        "memory_end_mb": 1e-6 * float(np.median(own[warm][-20:])),
        "memory_growth_share": float(grown / own[warm].mean()),
        "memory_mb_an_hour": 1e-6 * float(slope) * 3600.0,
        "shared_begin_mb": 1e-6 * float(shared[~warm].max()),
        "shared_end_mb": 1e-6 * float(shared[warm].max()),
    }


def _audio(
    session: SessionReader, summary: dict[str, Any], played: list[int], killed: list[float]
) -> dict[str, float]:
    """Compare the file with the count that was played, the server's own frame times, and the clock."""
    audio = session.audio
    total = audio.samples.shape[1]
    assert summary["frames"] + summary["dropped"] == total
    assert sum(stop - first for first, stop in audio.gaps) == summary["dropped"]
    number, tag = np.rint(audio.samples.astype(np.float64) / SCALE).astype(np.int64) - 1
    lost = np.zeros(total, bool)
    for first, stop in audio.gaps:
        lost[first:stop] = True
    assert not np.any(audio.samples[:, lost])
    place = np.flatnonzero((tag >= 0) & (number >= 0))
    life, count = tag[place] >> 10, number[place] + BLOCK * (tag[place] & 1023)
    assert np.array_equal(np.unique(life), np.arange(KILLS + 1))
    tails: list[int] = []
    for each in range(KILLS + 1):
        here, counted = place[life == each], count[life == each]
        assert counted[0] == 0
        # Frame by frame the count goes on; where it does not, a gap is marked at that very place.
        steps = np.diff(counted)
        assert np.all(steps > 0)
        assert np.all(lost[here[1:][steps != 1] - 1]), "frames of the count are missing without a gap"
        assert np.all(lost[here[1:][np.diff(here) != 1] - 1]), "a hole that is not marked"
        if each < KILLS:
            tails.append(played[each] - 1 - int(counted[-1]))
            assert 0 <= tails[-1] <= 4 * PERIOD, tails
    within = place.size + int(lost.sum())
    silence = total - within  # recorded as zeros: a server without its player
    # JACK's own count of frames goes on with the file's, but for what its restarts make of it.
    jumps = np.diff((audio.device_frame - audio.anchor_frame).astype(np.int64))
    assert np.count_nonzero(jumps) <= summary["gaps"], jumps[jumps != 0]
    elapsed = audio.anchor_time[-1] - audio.anchor_time[0]
    by_clock = elapsed * RATE - (audio.anchor_frame[-1] - audio.anchor_frame[0])
    # A server that is starved loses periods without counting them; then the recorder says by how much.
    uncounted = sum(float(event.data["seconds"]) for event in session.events if event.kind == "uncounted")
    clock_doubts = summary["flags"].get("clock_doubt", 0)
    assert clock_doubts or abs(by_clock - uncounted * RATE) <= 0.1 * RATE, (by_clock, uncounted)
    return {
        "frames": summary["frames"],
        "gap_frames": summary["dropped"],
        "gaps": summary["gaps"],
        "counted_frames": int(place.size),
        "silent_frames": silence,
        "played_but_lost_in_kills": sum(tails),
        "frames_less_than_by_clock": float(by_clock),
        "of_these_uncounted": uncounted * RATE,
        "clock_doubts": clock_doubts,
    }


def _tells_of_kills(session: SessionReader, summary: dict[str, Any], killed: list[float]) -> None:
    assert summary["reconnects"] == KILLS
    assert summary["gaps"] >= KILLS
    assert summary["flags"]["reconnect"] == KILLS
    about = [event for event in session.events if event.data.get("stream") == "audio"]
    bounds = [at - session.clock.origin for at in killed] + [np.inf]
    for away, (begin, end) in zip(AWAY, pairwise(bounds), strict=True):
        kinds = {event.kind for event in about if begin <= event.time < end}
        assert {"gap", "reconnect"} <= kinds
        assert not away or {"silent", "back"} <= kinds


def _wrench(session: SessionReader, summary: dict[str, Any]) -> dict[str, float]:
    track, health = session.readings("wrench"), summary["instruments"]["net_ft"]
    steps = np.diff(track.sequence)
    assert np.all(steps >= 1)
    missing = int((steps - 1).sum())
    assert len(track.time) + missing == track.sequence[-1] - track.sequence[0] + 1
    assert (health["readings"], health["missing"]) == (len(track.time), missing)
    assert missing == track.missing
    assert health["faulty"] == 0
    # The device's own samples go on with its records: what is counted is what was measured.
    assert np.array_equal(np.diff(track.device_time), steps)
    assert len(track.time) + missing == pytest.approx(7000 * summary["seconds"], rel=0.02)
    return {"force_readings": len(track.time), "force_missing": missing}


def _poses(session: SessionReader, summary: dict[str, Any], sent: int) -> dict[str, float]:
    track, health = session.readings("pose"), summary["instruments"]["pose_udp"]
    assert len(track.time) + track.missing == sent - track.sequence[0]
    assert (health["readings"], health["missing"]) == (len(track.time), track.missing)
    assert np.allclose(track.values[:, 0], 1e-6 * (track.sequence % 1000))
    return {"poses": len(track.time), "poses_sent": sent}
