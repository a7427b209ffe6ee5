import re
from pathlib import Path
from typing import Any

import pytest

from monochord.capture.jack import libjack, machine
from monochord.capture.jack.client import JackClient
from monochord.capture.jack.libjack import START_JACK
from monochord.capture.jack.machine import MISSING, OK, WARN, checks
from monochord.capture.jack.server import JackServer
from monochord.core.errors import DeviceError


def test_everything_is_looked_at_once_and_what_is_not_ok_has_a_remedy() -> None:
    results = list(checks())
    assert len({check.name for check in results}) == len(results) == 8
    for check in results:
        assert check.state in {OK, WARN, MISSING}
        assert check.detail
        assert bool(check.remedy) == (check.state != OK), check


def test_a_cache_that_cannot_be_written_is_a_warning(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert machine.compile_cache().state == OK
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "no" / "such"))
    check = machine.compile_cache()
    assert check.state == WARN
    assert "NUMBA_CACHE_DIR" in check.remedy


def test_a_missing_libjack_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent() -> str:
        raise DeviceError("JACK library libjack: not found")

    monkeypatch.setattr(machine, "jack_library", absent)
    check = machine.jack()
    assert (check.state, check.required) == (MISSING, False)
    assert START_JACK in check.remedy


def test_one_hint_says_how_to_come_to_jack(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    assert all(word in START_JACK for word in ("apt install jackd2", "hw:USB", "Scarlett", "pw-jack"))
    page = (Path(__file__).parents[3] / "docs" / "how-to" / "jack.md").read_text(encoding="utf-8")
    assert re.findall("jackd .*-d alsa .*?-p [0-9]+", START_JACK) == re.findall("jackd .*-d alsa .*", page)
    monkeypatch.setattr(libjack, "NAMES", ("libnone.so.0",))
    with pytest.raises(DeviceError) as no_library:
        libjack.path.__wrapped__()
    monkeypatch.undo()
    with pytest.raises(DeviceError) as no_server:
        JackClient("test", server="nobody")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(DeviceError) as no_jackd:
        JackServer().start()
    for error in (no_library, no_server, no_jackd):
        assert str(error.value).endswith(START_JACK)
        assert str(error.value).count("jackd2") == 1


@pytest.mark.parametrize(("text", "state"), [("performance", OK), ("powersave", WARN)])
def test_the_governor_is_read(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, text: str, state: str) -> None:
    file = tmp_path / "scaling_governor"
    file.write_text(f"{text}\n", encoding="ascii")
    monkeypatch.setattr(machine, "GOVERNOR", file)
    assert machine.governor().state == state


@pytest.mark.jack
def test_a_running_server_is_described(jack_server: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("JACK_DEFAULT_SERVER", jack_server.name)
    jack_server.real_time = False
    jack_server.restart()
    check = machine.jack()
    assert check.detail == "a server runs at 44100 Hz, with periods of 11.6 ms, not in real time"
    assert (check.state, check.remedy) == (WARN, "start it with -R, or it will lose frames under load")
