"""`sessions label` as a process of its own: what a person types, what is kept, and who takes the session."""

import json
import shlex
import subprocess
import sys
import time
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.cli.running import Capture
from tests.twins import sound_of

from monochord.cli import run
from monochord.physics.twin.virtual_sensor import VirtualSensor
from monochord.sessions import read_session

LABEL = [sys.executable, "-m", "monochord", "sessions", "label"]
PLACES = ((0.1, 0.8), (0.0662, 1.2), (0.12, 0.6))


def command(*words: object, status: int = 0) -> str:
    line = [sys.executable, "-m", "monochord", *map(str, words)]
    run = subprocess.run(line, capture_output=True, text=True, stdin=subprocess.DEVNULL, check=False)
    assert run.returncode == status, run.stderr
    assert "Traceback" not in run.stderr
    return run.stdout or run.stderr


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three touches, held for as long as a person takes to read a scale; nothing states their truth."""
    twin = VirtualSensor("prototype", seed=3)
    steps = (step for touch in PLACES for step in (touch, 2.6, None, 2.2))
    file = tmp_path_factory.mktemp("sound") / "take.wav"
    soundfile.write(file, sound_of(twin, 2.6, *steps)[0].T, twin.sample_rate, subtype="FLOAT")
    return file


class Typist:
    """Somebody at the keyboard of a running command."""

    def __init__(self, process: "subprocess.Popen[str]") -> None:
        self.process, self.said = process, list[str]()

    def until(self, words: str) -> str:
        assert self.process.stderr
        for line in self.process.stderr:
            self.said.append(line)
            if words in line:
                return line
        pytest.fail("".join(self.said))

    def type(self, line: str) -> None:
        assert self.process.stdin
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()


@contextmanager
def labelling(sound: Path, out: Path, *words: str) -> Generator[Typist]:
    line = [*LABEL, str(out), "--source", "wav", "--device", str(sound), "--set", "source.speed=1.0"]
    pipe = subprocess.PIPE
    line += ["--sensor", "prototype", *words]
    with subprocess.Popen(line, stdin=pipe, stdout=pipe, stderr=pipe, text=True) as process:
        try:
            yield Typist(process)
        finally:
            process.kill()


def touches(session: Path) -> list[tuple[float, float]]:
    """Return position and force of the labelled touches of a session, in order."""
    columns = read_session(session).labels.columns
    on = columns["contact"] == 1.0
    rows = np.column_stack([columns["position"][on], columns["force"][on]])
    return list(dict.fromkeys((round(x, 4), round(force, 3)) for x, force in rows.tolist()))


@pytest.mark.slow
@pytest.mark.real_time
def test_position_and_force_are_typed_and_corrected(sound: Path, tmp_path: Path) -> None:
    out = tmp_path / "touches.mcap"
    with labelling(sound, out, "--touches", "3", "--object", "rod", "--unit", "g") as person:
        assert "103 mm with about 77 g" in person.until("Press near")
        person.until("Recorded")
        person.type("100 9000")  # 88 N
        assert "impossible" in person.until("impossible")
        person.type("10cm 82")
        assert "10cm" in person.until("no effect")
        person.type("100 82")
        person.until("1 of 3 touches. Press near")
        person.until("Recorded")
        person.type("66.2 1.2 N")
        person.until("2 of 3")
        person.until("Recorded")
        person.type("u")
        person.type("s")
        person.until("2 of 3")
        person.type("q")
        printed = person.process.communicate(timeout=120)
    assert person.process.returncode == 0, printed
    assert touches(out) == [(0.1, 0.804), (0.0662, 1.2)]
    session = read_session(out)
    assert session.description.object == "rod"
    assert session.description.sensor["range"] == [0.05, 0.15]
    assert (session.labels.columns["contact"] == 0.0).any()
    assert {path.name for path in tmp_path.iterdir()} == {"touches.mcap", "touches.csv"}
    assert "already exists" in command("sessions", "label", out, "--source", "twin", status=2)
    out.rename(tmp_path / "killed.recorded.mcap")  # as of a program that was killed before the first touch
    again = command("sessions", "label", tmp_path / "killed.mcap", "--source", "twin", status=2)
    assert "no touch in it was labelled: remove it" in again


@pytest.mark.slow
@pytest.mark.real_time
def test_a_kill_loses_no_label(sound: Path, tmp_path: Path) -> None:
    out = tmp_path / "touches.mcap"
    with labelling(sound, out, "--touches", "3") as person:
        for place, force in PLACES[:2]:
            person.until("Recorded")
            person.type(f"{1e3 * place} {force} N")
        person.until("2 of 3")
        time.sleep(0.5)
        person.process.kill()
    assert not out.exists()
    printed = command("sessions", "label", out, "--sensor", "prototype", "--json")
    assert json.loads(printed)["labels"]["rows"] > 100
    assert touches(out) == [*PLACES[:2]]
    assert command("sessions", "check", out).startswith("ok")
    result = json.loads(command("calibrate", "demo", "--sessions", out, "--touches", 0, "--json"))
    assert result["heads"]["position"]["touches"] == 2
    assert result["heads"]["position"]["before"] < 0.005


@pytest.mark.parametrize("terminal", [False, True])
def test_seconds_are_counted_down_on_a_terminal_only(
    tmp_path: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch, *, terminal: bool
) -> None:
    path = tmp_path / "quiet.wav"
    soundfile.write(path, 1e-3 * np.random.default_rng(0).standard_normal((3 * 44100, 2)), 44100)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: terminal)
    # Nothing touches, so there is no session.
    assert run(["sessions", "label", str(tmp_path / "a.mcap"), "--source", "wav", "--device", str(path)]) == 2
    counted = [line for line in capsys.readouterr().err.splitlines() if line.endswith("...")]
    assert bool(counted) == terminal


@pytest.mark.slow
def test_build_audit_evaluate_and_calibrate_take_the_session(tmp_path: Path) -> None:
    out = tmp_path / "my touches.mcap"
    twin = ("--source", "twin", "--set", "source.speed=0", "--set", "source.seed=5")
    printed = command("sessions", "label", out, *twin, "--touches", 4, "--object", "plastic")
    assert str(out) in shlex.split(printed.splitlines()[-1])
    command("build", out, "--out", tmp_path / "dataset")
    assert "no leak" in command("audit", tmp_path / "dataset")
    scores = json.loads(command("evaluate", "demo", "--sessions", out, "--no-baselines", "--json"))
    assert scores
    result = json.loads(command("calibrate", "demo", "--sessions", out, "--out", tmp_path / "mine", "--json"))
    assert result["heads"]["force"]["touches"] == 4
