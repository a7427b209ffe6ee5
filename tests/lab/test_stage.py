"""The whole bench in real time: jackd, a force sensor over UDP, a robot over DDS, each a process."""

import json
from pathlib import Path
from typing import Any

import pytest

from monochord.config import from_tree
from monochord.lab.plan import Plan, assignments
from monochord.lab.stage import Stage, perform
from monochord.sessions import check, read_session
from monochord.sessions.alignment import align

pytestmark = pytest.mark.jack
PLAN = {
    "name": "tiny",
    "force_rate": 1000.0,
    "delays": {"audio": [0.03, 0.05], "wrench": [0.004, 0.012], "pose": [0.02, 0.06]},
    "groups": [{"name": "hold", "grid": [1, 2], "hold": 0.5, "forces": [0.5, 1.5]}],
}


@pytest.mark.timeout(240)
def test_offsets_that_were_put_in_are_found(jack_server: Any, tmp_path: Path) -> None:
    session = assignments(from_tree(Plan, PLAN))[0]
    path = tmp_path / "hold.mcap"
    summary = perform(session, path, Stage(server=jack_server.name, domain=77))
    assert not summary.failure
    report, made = check(path), read_session(path)
    assert report.sound
    assert (summary.dropped, summary.gaps) == (0, 0)
    audio = made.audio
    assert audio.samples.shape[1] == summary.frames
    frames = audio.device_frame - audio.anchor_frame
    assert (frames == frames[0]).all(), "every frame that the server counted is there"
    told = json.loads(made.description.more["delays"])
    found = align(made)
    for stream, near in (("audio", 0.5e-3), ("pose", 1.0 / session.plan.pose_rate)):
        true = told[stream] - told["wrench"]
        for offset in found.lateness[stream].offsets:
            assert offset.value == pytest.approx(true, abs=near), stream
    assert not found.flags
    wrench = made.readings("wrench")
    assert wrench.missing == summary.instruments["net_ft"].missing
    assert wrench.missing <= 20
    assert made.labels.columns["contact"].max() == 1.0
    kinds = {event.kind for event in made.events}
    assert {"phase", "tap", "drivers", "stop"} <= kinds
