import time
from pathlib import Path
from typing import Any

import numpy as np

from monochord.capture.recording.pumps import Polled, Pumps
from monochord.capture.recording.tally import QUIET, Tally
from monochord.capture.sources.base import Source
from monochord.core.types import Block, Readings

RATE = 44100


def block(start: int, frames: int, dropped: int = 0) -> Block:
    return Block(samples=np.full((2, frames), 0.25, np.float32), start=start, dropped=dropped)


def test_it_adds_up_what_comes(make_job: Any, force: Any, tmp_path: Path) -> None:
    _, instrument = force()
    source: Source = make_job().source
    with source.open() as stream, instrument.open() as sensor:
        tally = Tally(stream, {"net_ft": sensor}, tmp_path, reserve=0.0)
        pumps = Pumps(stream, {"net_ft": sensor}, room=1000)
        tally.add(block(0, 64))
        tally.add(block(100, 64, dropped=36))
        readings = Readings(
            stream="wrench",
            time=np.zeros(5),
            values=np.ones((5, 6)),
            sequence=np.arange(5),
            device_time=np.arange(5),
            status=np.zeros(5, np.uint32),
        )
        tally.add(Polled(name="net_ft", readings=readings))
        now = tally.look(size=1000, pumps=pumps)
        assert (now.frames, now.dropped, now.gaps) == (128, 36, 1)
        assert tally.audio_end == 164 / RATE
        assert [feed.readings for feed in now.feeds] == [5]
        assert now.feeds[0].values["fz"] == 1.0
        assert [round(level.rms, 3) for level in now.levels] == [0.25, 0.25]
        assert now.space.size == 1000
        assert now.time - tally.begin == now.elapsed < 5.0


def test_audio_that_is_late_is_silent_unless_its_blocks_are_long(make_job: Any, tmp_path: Path) -> None:
    source: Source = make_job().source
    with source.open() as stream:
        tally = Tally(stream, {}, tmp_path, reserve=0.0)
        pumps = Pumps(stream, {}, room=1000)
        time.sleep(QUIET + 0.05)
        assert tally.look(0, pumps).silent > QUIET
        tally.add(block(0, 64))
        assert tally.look(0, pumps).silent == 0.0
        tally.add(block(64, RATE))
        time.sleep(QUIET + 0.05)
        assert tally.look(0, pumps).silent == 0.0
