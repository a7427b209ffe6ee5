from pathlib import Path
from typing import Any

import pytest

from monochord.capture.jack import machine
from monochord.capture.jack.machine import MISSING, OK, WARN, checks
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
    assert check.remedy


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
    assert check.state == WARN
    assert "44100 Hz" in check.detail
    assert "-R" in check.remedy
