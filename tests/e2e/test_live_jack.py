"""The live verb on a real JACK server: the same positions as offline, under load and through a crash."""

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

from monochord.cli import run

pytestmark = pytest.mark.jack
RATE = 44100
STRING = ["--length", "0.65", "--open-frequency", "110"]
KEYS = ["time", "frequency", "position", "position_std", "valid", "why_not"]
Records = dict[float, dict[str, Any]]


@pytest.fixture
def note(tmp_path: Path) -> Path:
    """Two seconds of one microphone on a plucked string of stiff partials."""
    t = np.arange(2 * RATE) / RATE
    partials = [(n, 130.8 * n * np.sqrt(1 + 1e-4 * n * n)) for n in range(1, 16)]
    samples = sum(0.2 / n * np.sin(2 * np.pi * f * t) * np.exp(-n * t / 2) for n, f in partials)
    soundfile.write(tmp_path / "note.wav", samples, RATE, subtype="FLOAT")
    return tmp_path / "note.wav"


def records(text: str) -> Records:
    lines = [json.loads(line) for line in text.splitlines()]
    return {line["time"]: {key: line[key] for key in KEYS} for line in lines}


def offline(file: Path, capsys: pytest.CaptureFixture[str]) -> Records:
    capsys.readouterr()
    assert run(["locate", str(file), *STRING, "--json"]) == 0
    return records(capsys.readouterr().out)


def live(server: Any, *more: str) -> list[str]:
    source = f"player: --source jack --set source.server={server.name} --set source.channels=1".split()
    return ["live", *source, *STRING, "--json", *more]


def counted(name: str, text: str) -> int:
    match = re.search(rf"\b{name} (\d+)", text)
    assert match, f"no {name} in {text}"
    return int(match[1])


@pytest.mark.parametrize("jack_server", [pytest.param(64, marks=pytest.mark.slow), 512], indirect=True)
def test_positions_are_those_of_offline_while_the_main_thread_is_busy(
    jack_server: Any, play: Any, note: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    expected = offline(note, capsys)
    play(note)
    script = Path(__file__).with_name("live_busy.py")
    command = [sys.executable, str(script), *live(jack_server, "--seconds", "1.2")]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=90, check=True)
    received = records(ended.stdout)
    # Every frame arrived, and every window that was not left out says what it says offline.
    assert (counted("dropped", ended.stderr), counted("gaps", ended.stderr)) == (0, 0)
    assert counted("frames", ended.stderr) >= 1.2 * RATE - 512
    assert counted("windows", ended.stderr) + counted("skipped", ended.stderr) == 111
    assert len(received) == counted("windows", ended.stderr) > 10
    assert received == {moment: expected[moment] for moment in received}
    assert any(line["valid"] for line in received.values())


class Running:
    """The live verb in a process of its own, writing to a file that is read as it grows."""

    def __init__(self, server: Any, out: Path) -> None:
        command = [str(Path(sys.executable).with_name("monochord")), *live(server)]
        self._out = out
        with out.open("w", encoding="utf-8") as file:
            self.process = subprocess.Popen(command, stdout=file, stderr=subprocess.PIPE, text=True)

    def lines(self) -> list[dict[str, Any]]:
        whole = self._out.read_text(encoding="utf-8").rpartition("\n")[0]
        return [json.loads(line) for line in whole.splitlines()]

    def wait_for(self, condition: Callable[[list[dict[str, Any]]], bool]) -> None:
        deadline = time.monotonic() + 40.0
        while not condition(self.lines()):
            assert self.process.poll() is None, "the verb ended"
            assert time.monotonic() < deadline, "waited in vain"
            time.sleep(0.05)

    def interrupt(self) -> str:
        self.process.send_signal(signal.SIGINT)
        return self.process.communicate(timeout=30)[1]


@contextmanager
def running(server: Any, out: Path) -> Generator[Running]:
    live = Running(server, out)
    try:
        yield live
    finally:
        if live.process.poll() is None:
            live.process.kill()
        live.process.communicate()


def test_live_outlives_a_killed_server(
    jack_server: Any, play: Any, note: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    expected = offline(note, capsys)
    play(note)
    with running(jack_server, tmp_path / "out.jsonl") as live:
        live.wait_for(lambda lines: lines != [] and lines[-1]["time"] > 1.0)
        jack_server.kill()
        time.sleep(0.5)
        before = len(live.lines())
        jack_server.restart()
        play(note)
        live.wait_for(lambda lines: sum(line["gaps"] and line["why_not"] != "gap" for line in lines) > 50)
        summary = live.interrupt()
        lines = live.lines()
        assert live.process.returncode == 0
    assert "Traceback" not in summary
    assert (counted("gaps", summary), counted("reconnects", summary)) == (1, 1)
    assert counted("dropped", summary) > 0.4 * RATE
    outputs = [{key: line[key] for key in KEYS} for line in lines]
    assert outputs[:before] == [expected[line["time"]] for line in outputs[:before]]
    # What touches the gap abstains and says why; then positions come again.
    lost = [line for line in outputs if line["why_not"] == "gap"]
    assert lost
    assert lost[0]["time"] > 0.9
    assert all(line["position"] is None for line in lost)
    after = [line for line in outputs if line["time"] > lost[-1]["time"]]
    assert len(after) > 20
    assert not any(line["why_not"] == "gap" for line in after)
    # The recording began anew, so its beginning is what they are compared with.
    known = np.median([line["position"] for t, line in expected.items() if line["valid"] and t < 0.5])
    again = np.median([line["position"] for line in after if line["valid"]])
    assert again == pytest.approx(known, abs=2e-3)
