"""What the sound comes from goes away while it is estimated: it is said at once, and taken up again."""

import time
from ctypes import c_char_p, c_int, c_void_p
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from tests.e2e.faults.conftest import Live, StartLive, notes, touched

from monochord.capture.jack import libjack
from monochord.capture.jack.client import JackClient
from monochord.sessions import read_session

pytestmark = [pytest.mark.jack, pytest.mark.slow]
HOP = 0.01


def ended_well(live: Live) -> None:
    """End the run; no window is missing, and none without sound has an estimate."""
    live.end()
    rows = live.rows()
    times = [float(row["time"]) for row in rows]
    assert sum(round((b - a) / HOP) - 1 for a, b in pairwise(times)) <= live.counted("skipped")
    away = [row for row in rows if "no_sound" in notes(row)]
    assert away
    assert not any(row["position"] for row in away)
    assert live.counted("gaps") == 1
    assert touched(rows[-1])


@pytest.mark.parametrize("gone", ["server", "port"])
def test_a_server_or_a_port_that_goes_away_is_said_while_it_is_away(
    jack_server: Any, play: Any, touch: Path, start_live: StartLive, gone: str
) -> None:
    player = play(touch)
    live = start_live()
    live.wait_for_touch()
    jack_server.kill() if gone == "server" else player.terminate()
    live.wait_for_note("no_sound")
    time.sleep(2.0)
    if gone == "server":
        jack_server.restart()
    play(touch)
    assert "no_sound" not in notes(live.wait_for_note("reconnected"))
    live.wait_for_touch()
    ended_well(live)
    assert live.counted("reconnects") == 1


def patch(server: str, output: str, into: str, *, connected: bool) -> None:
    """Connect or disconnect two ports, as a patch bay does: from a client of its own."""
    client = JackClient("patchbay", server)
    try:
        if connected:
            assert client.connect(output, into)
            return
        disconnect = libjack.library().jack_disconnect
        disconnect.restype, disconnect.argtypes = c_int, [c_void_p, c_char_p, c_char_p]
        assert disconnect(client.handle, output.encode(), into.encode()) == 0
    finally:
        client.close()


@pytest.mark.parametrize("channel", [1, 2])
def test_a_port_that_is_unplugged_is_named_until_it_is_plugged_in_again(
    jack_server: Any, play: Any, touch: Path, start_live: StartLive, tmp_path: Path, channel: int
) -> None:
    play(touch)
    estimates = tmp_path / "estimates.mcap"
    live = start_live("--sink", f"mcap={estimates}")
    live.wait_for_touch()
    ports = f"player:out_{channel}", f"monochord:in_{channel}"
    patch(jack_server.name, *ports, connected=False)
    live.wait_for_note("no_sound")
    time.sleep(2.0)
    patch(jack_server.name, *ports, connected=True)
    live.wait_for(lambda row: touched(row) and "no_sound" not in notes(row))
    ended_well(live)
    said = [event.text for event in read_session(estimates).events if event.data.get("key") == "no_sound"]
    assert ports[1] in said[0]
