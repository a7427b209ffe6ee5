"""The live verb on a real JACK server: the same positions as offline, under load and through a crash."""

import json
import re
import subprocess
import sys
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
    samples = np.sum([0.2 / n * np.sin(2 * np.pi * f * t) * np.exp(-n * t / 2) for n, f in partials], axis=0)
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
    command = [sys.executable, str(script), *live(jack_server, "--seconds", "1.9")]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=90, check=True)
    received = records(ended.stdout)
    # Every frame arrived, and every window that was not left out says what it says offline. Evidence of a
    # note's windows adds up, so that what is left out moves later ones by far less than their error.
    assert (counted("dropped", ended.stderr), counted("gaps", ended.stderr)) == (0, 0)
    assert counted("frames", ended.stderr) >= 1.9 * RATE - 512
    assert counted("windows", ended.stderr) + counted("skipped", ended.stderr) == 181
    # How many were left out depends on what else the machine does, which may be all of them.
    assert len(received) == counted("windows", ended.stderr)
    for moment, line in received.items():
        offline_line = expected[moment]
        if not counted("skipped", ended.stderr):
            assert line == offline_line
        assert line["valid"] == offline_line["valid"]
        if line["valid"]:
            assert line["position"] == pytest.approx(offline_line["position"], abs=0.1 * line["position_std"])
