"""A session in real time: jackd, a force sensor over UDP, a robot over DDS, each a process."""

import json
from pathlib import Path

import pytest
from tests.conftest import own_server

from monochord.capture.recording import RecordingSummary
from monochord.core.config import from_tree
from monochord.lab.assignment import Assignment, assignments
from monochord.lab.offline import make
from monochord.lab.plan import Plan
from monochord.lab.real_time import perform
from monochord.sessions import check, read_session
from monochord.sessions.alignment import Limits, align

pytestmark = pytest.mark.jack
PLAN = {
    "name": "tiny",
    "force_rate": 1000.0,
    "delays": {"audio": [0.03, 0.05], "wrench": [0.004, 0.012], "pose": [0.02, 0.06]},
    "groups": [{"name": "hold", "grid": [1, 2], "hold": 0.5, "forces": [0.5, 1.5]}],
}


Played = tuple[Assignment, Path, RecordingSummary]
MAX_UNEVENNESS = 3e-4  # delays to half a millisecond require a server with better timing


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Played:
    """A session played in real time."""
    session = assignments(from_tree(Plan, PLAN))[0]
    path = tmp_path_factory.mktemp("stage") / "hold.mcap"
    with own_server() as server:
        return session, path, perform(session, path, server=server.name, domain=77)


@pytest.mark.timeout(240)
def test_every_frame_that_the_server_counted_is_there(played: Played) -> None:
    _, path, summary = played
    assert not summary.failure
    assert check(path).sound
    assert (summary.dropped, summary.gaps) == (0, 0)
    audio = read_session(path).audio
    assert audio.samples.shape[1] == summary.frames
    frames = audio.device_frame - audio.anchor_frame
    assert (frames == frames[0]).all()


@pytest.mark.timeout(240)
def test_the_delays_are_recovered(played: Played) -> None:
    session, path, _ = played
    made = read_session(path)
    delays, alignment = json.loads(made.description.more["delays"]), align(made)
    uneven = made.audio.unevenness
    if uneven > Limits().stray:
        assert [flag for flag in alignment.flags if "stray" in flag], "a starved server goes unnoticed"
        return
    # On a server that kept its time, to half a millisecond; else worse by what the session shows of it.
    audio = 0.5e-3 + (uneven if uneven > MAX_UNEVENNESS else 0.0)
    for stream, near in (("audio", audio), ("pose", 1.0 / session.plan.pose_rate)):
        true = delays[stream] - delays["wrench"]
        for offset in alignment.lateness[stream].offsets:
            assert offset.value == pytest.approx(true, abs=near), stream
    assert not alignment.flags


@pytest.mark.timeout(240)
def test_it_has_the_form_of_one_that_was_made_offline(played: Played, tmp_path: Path) -> None:
    session, path, summary = played
    live, offline = read_session(path), read_session(make(session, tmp_path).path)
    assert set(live.topics) == set(offline.topics)
    assert live.streams == offline.streams
    for stream in live.streams:
        mine, other = live.description.feed(stream), offline.description.feed(stream)
        assert (mine.columns, mine.units) == (other.columns, other.units)
        assert live.readings(stream).missing <= 20
    assert list(live.labels.columns) == list(offline.labels.columns)
    assert len(live.labels.time) == len(offline.labels.time)
    kinds = {"phase", "tap", "drivers"}
    assert [event.text for event in live.events if event.kind in kinds] == [
        event.text for event in offline.events if event.kind in kinds
    ]
    assert summary.instruments["net_ft"].missing == live.readings("wrench").missing
    assert live.description.more["played"] == "in real time"
