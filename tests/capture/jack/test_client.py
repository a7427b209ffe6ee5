import time
from typing import Any

import pytest

from monochord.capture.jack import libjack
from monochord.capture.jack.client import JackClient
from monochord.core.errors import DeviceError

pytestmark = pytest.mark.jack


def test_without_the_library_there_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(libjack, "NAMES", ("libjack-that-nobody-has.so.0",))
    with pytest.raises(DeviceError, match="libjack"):
        libjack.path.__wrapped__()


def test_it_tells_what_the_server_is(jack_server: Any) -> None:
    jack_server.real_time = False
    jack_server.restart()
    client = JackClient("test", jack_server.name)
    assert client.name == "test"
    assert (client.sample_rate, client.period, client.realtime) == (44100, 512, False)
    assert client.outputs(physical=True) == ["system:capture_1", "system:capture_2"]
    assert client.outputs("_2$") == ["system:capture_2"]
    assert client.outputs("guitar") == []
    assert not client.connect("system:capture_1", "nobody:in")
    client.close()
    client.close()


def test_its_clock_is_the_monotonic_one_but_for_the_offset(jack_server: Any) -> None:
    client = JackClient("test", jack_server.name)
    raw = time.clock_gettime(time.CLOCK_MONOTONIC_RAW) - time.monotonic()
    assert client.clock_offset() == pytest.approx(raw, abs=2e-3)
    client.close()


def test_a_taken_name_is_made_unique(jack_server: Any) -> None:
    first, second = JackClient("test", jack_server.name), JackClient("test", jack_server.name)
    assert second.name == "test-01"
    second.close()
    first.close()
