"""What the source does before and without audio; capture itself is tested in tests/e2e/test_jack.py."""

import json
import os
import subprocess
import sys
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.conftest import Play

from monochord.capture.jack.ring import FRAME_TIME_SPAN, Period
from monochord.capture.jack.server import JackServer
from monochord.capture.sources._ring_stream import Timeline
from monochord.capture.sources.jack import Jack
from monochord.core.errors import DeviceError, InputError

RATE = 44100


def test_without_a_server_there_is_one_line_at_once(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(DeviceError, match=r"nobody|JACK library"), Jack(server="nobody").open():
        pass
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("options", "given"), [({"channels": 0}, "0"), ({"channels": 65}, "65"), ({"client_name": ""}, "''")]
)
def test_options_out_of_range_are_refused(options: Any, given: str) -> None:
    with pytest.raises(InputError, match=given), Jack(**options).open():
        pass


def period(frame_time: int, frames: int = 64) -> Period:
    return Period(samples=np.zeros((2, frames), np.float32), frame_time=frame_time % FRAME_TIME_SPAN)


def test_gaps_come_from_the_servers_count_even_across_its_wrap() -> None:
    timeline, begin = Timeline(RATE), FRAME_TIME_SPAN - 100
    counts = [begin, begin + 64, begin + 64 * 4, begin + 64 * 5, begin + 64 * 5 + 100_000]
    blocks = [timeline.place(period(count), None, 0.0) for count in counts]
    assert [block.start for block in blocks] == [count - begin for count in counts]
    assert [block.dropped for block in blocks] == [0, 0, 128, 0, 100_000 - 64]
    health = timeline.health(xruns=5, reconnects=0, clock_offsets={})
    assert (health.frames, health.dropped, health.gaps, health.xruns) == (320, 128 + 100_000 - 64, 2, 5)


def test_a_count_that_steps_back_never_takes_the_index_back() -> None:
    timeline = Timeline(RATE)
    blocks = [timeline.place(period(count), None, 0.0) for count in (1000, 1064, 1100, 1164)]
    assert all(b.start == a.start + 64 + b.dropped for a, b in pairwise(blocks))
    assert [block.dropped for block in blocks] == [0, 0, 0, 0]


def test_after_an_interruption_the_gap_comes_from_the_clock() -> None:
    timeline = Timeline(RATE)
    timeline.place(period(5_000_000), 10.0, 10.1)
    timeline.interrupt()
    back = timeline.place(period(7), 12.5, 12.6)
    assert back.dropped == round(2.5 * RATE) - 64
    assert timeline.place(period(71), 12.5 + 64 / RATE, 12.6).dropped == 0


def test_without_converter_times_the_arrival_measures_the_interruption() -> None:
    timeline = Timeline(RATE)
    timeline.place(period(5_000_000), None, 10.0)
    timeline.interrupt()
    back = timeline.place(period(7), None, 11.0)
    assert back.dropped == RATE - 64
    assert back.adc_time is None


def test_a_device_that_is_away_loses_frames_as_time_passes_and_in_one_gap() -> None:
    timeline = Timeline(RATE)
    timeline.place(period(1000), 10.0, 10.1)
    assert timeline.lose(2, 10.9) is None
    blocks = [block for now in (11.1, 11.2, 11.6, 12.0) if (block := timeline.lose(2, now))]
    assert timeline.health(xruns=0, reconnects=0, clock_offsets={}, away="unplugged").away == "unplugged"
    blocks.append(timeline.place(period(1000 + 3 * RATE), 13.0, 13.1))
    assert [block.samples.shape[1] for block in blocks] == [0, 0, 0, 64]
    assert [block.start for block in blocks] == pytest.approx(
        [0.9 * RATE, 1.4 * RATE, 1.8 * RATE, 3 * RATE], abs=2
    )
    assert sum(block.dropped for block in blocks) == 3 * RATE - 64
    health = timeline.health(xruns=0, reconnects=0, clock_offsets={}, away="unplugged")
    assert (health.gaps, health.away) == (1, "")


def test_frames_of_a_server_that_stood_still_come_after_what_was_lost() -> None:
    timeline = Timeline(RATE)
    timeline.place(period(1000), 10.0, 10.1)
    lost = timeline.lose(2, 12.0)
    assert lost
    back = timeline.place(period(1064), 12.0, 12.1)
    assert (back.start, back.dropped) == (lost.start, 0)
    assert timeline.place(period(1128), 12.0 + 64 / RATE, 12.1).dropped == 0


@pytest.mark.jack
def test_what_list_devices_shows_can_be_typed(jack_server: JackServer, play: Play, recording: Path) -> None:
    for client in ("USB Audio (hw:1,0)", "Mikrofon (2,0) grün", os.fsdecode(b"St\xc3")):
        play(recording, client)
    ports = listed(jack_server.name)
    assert len(ports) == 6
    assert all(port.isprintable() for port in ports)
    for pair in (ports[:2], ports[2:4], ports[4:]):
        with Jack(ports=", ".join(pair), server=jack_server.name).open() as stream:
            assert any(block.samples.any() for block in islice(stream, 200))
    others = Jack(ports="system:capture_1,system:capture_2", server=jack_server.name)
    with others.open() as stream:
        assert next(iter(stream)).samples.shape[0] == 2


def listed(server: str) -> list[str]:
    """Return the names of the players' ports as the command shows them."""
    command = [sys.executable, "-m", "monochord", "list", "devices", "--json"]
    environment = {**os.environ, "JACK_DEFAULT_SERVER": server}
    done = subprocess.run(command, capture_output=True, check=True, env=environment)
    return [device["name"] for device in json.loads(done.stdout)["devices"] if ":out_" in device["name"]]
