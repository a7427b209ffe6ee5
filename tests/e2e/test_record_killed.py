"""A recorder killed at any moment: what it had captured is on disk, but for the last half second at most."""

import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from mcap.exceptions import McapError
from mcap.records import Chunk, Message
from mcap.stream_reader import StreamReader
from tests.e2e.conftest import paced

from monochord.sessions import read_session, recover

RATE = 44100
LOST = 0.5
HEADER = 60_000


def independently(path: Path) -> dict[str, int]:
    """Count messages by topic with the library of the file format, up to where the file was cut off."""
    topics: dict[int, str] = {}
    counts: dict[str, int] = {}
    with path.open("rb") as file:
        try:
            for record in StreamReader(file).records:
                assert not isinstance(record, Chunk)  # they are opened
                if isinstance(record, Message):
                    topic = topics[record.channel_id]
                    counts[topic] = counts.get(topic, 0) + 1
                elif hasattr(record, "topic"):
                    channel: Any = record
                    topics[channel.id] = channel.topic
        except McapError:
            pass  # the end of a file that was cut off
    return counts


def look_over(path: Path, killed: float) -> dict[str, float]:
    """Check what a kill left, and return how long before it each stream ends, in s."""
    session = read_session(path)
    assert not session.complete
    audio, wrench, origin = session.audio, session.readings("wrench"), session.clock.origin
    assert audio.gaps == ()
    assert wrench.missing == 0
    newest = audio.anchor_time[-1] + (audio.samples.shape[1] - audio.anchor_frame[-1]) / RATE
    counts = independently(path)
    for topic in session.topics:
        assert counts.get(topic, 0) == sum(1 for _ in session.messages(topic))
    return {"audio": killed - origin - newest, "wrench": killed - origin - float(wrench.time[-1])}


def test_a_kill_costs_half_a_second_at_most(
    start_recorder: Callable[..., Any], net_ft: list[str], sound: Path
) -> None:
    recorder = start_recorder(*paced(sound), *net_ft)
    recorder.wait_for_bytes(HEADER)
    time.sleep(0.7)
    lost = look_over(recorder.out, recorder.kill())
    assert max(lost.values()) <= LOST
    recorded = read_session(recorder.out).audio.samples
    expected = soundfile.read(sound, always_2d=True)[0].T.astype(np.float32)
    assert np.array_equal(recorded, np.resize(expected.T, (recorded.shape[1], 2)).T)
    frames = recorded.shape[1]
    recover(recorder.out)
    assert read_session(recorder.out).audio.samples.shape[1] == frames


@pytest.mark.jack
@pytest.mark.slow
@pytest.mark.timeout(600)
def test_fifty_kills_at_random_moments(
    start_recorder: Callable[..., Any],
    net_ft: list[str],
    jack_server: Any,
    play: Callable[[Path], "subprocess.Popen[str]"],
    sound: Path,
    record_property: Callable[[str, object], None],
) -> None:
    chance = np.random.default_rng(0)
    jack = ["--set", f"source.server={jack_server.name}", "--set", "source.ports=player:"]
    lost: dict[str, list[float]] = {"audio": [], "wrench": []}
    for k in range(50):
        live = k % 5 == 0
        if live:
            # Anew each time: a client's death puts a synchronous server's clock wrong by seconds.
            jack_server.restart()
            play(sound)
        recorder = start_recorder(*(jack if live else paced(sound)), *net_ft)
        recorder.wait_for_bytes(HEADER)
        time.sleep(chance.uniform(0.0, 1.5))
        for stream, span in look_over(recorder.out, recorder.kill()).items():
            lost[stream].append(span)
        recorder.out.unlink()
    for stream, spans in lost.items():
        record_property(f"{stream}_ms", [round(1e3 * span) for span in spans])
    assert max(lost["audio"]) <= LOST
    assert max(lost["wrench"]) <= LOST
