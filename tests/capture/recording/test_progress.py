import dataclasses
import itertools
from pathlib import Path
from typing import Any

import pytest

from monochord.capture.recording import record
from monochord.capture.recording.progress import Progress


def test_each_look_goes_on_from_the_one_before(make_job: Any, force: Any) -> None:
    looks: list[Progress] = []
    record(make_job(seconds=0.8, instruments={"net_ft": force()[1]}), lambda now, _notices: looks.append(now))
    assert len(looks) > 2
    assert looks[-1].space.size > looks[0].space.size
    for before, after in itertools.pairwise(looks):
        assert after.time > before.time
        assert after.frames >= before.frames
        assert after.space.size >= before.space.size
        assert after.feeds[0].readings >= before.feeds[0].readings
    assert looks[-1].elapsed - looks[0].elapsed == pytest.approx(looks[-1].time - looks[0].time)
    with pytest.raises(dataclasses.FrozenInstanceError):
        looks[0].frames = 0  # pyright: ignore[reportAttributeAccessIssue]


def test_the_take_is_whole(make_job: Any, tmp_path: Path) -> None:
    looks: list[Progress] = []
    summary = record(make_job(source={"speed": 0.0, "repeat": 1}), lambda now, _notices: looks.append(now))
    assert looks[-1].frames == summary.frames == 88200
