"""The first minutes with one's own sensor, through real JACK: tune, record known touches, calibrate, live.

The sensor is simulated: a build that no model was trained on, a third of a semitone above its design. Its
length is read off a ruler.
"""

import csv
import json
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile
from tests.e2e.conftest import MONOCHORD

from monochord.core.types import Floats
from monochord.perception.training.adapt import MIN_GAIN
from monochord.physics.sensors import load_sensor
from monochord.physics.theory import open_frequency
from monochord.physics.twin.virtual_sensor import VirtualSensor
from monochord.sessions import read_session

pytestmark = [pytest.mark.jack, pytest.mark.slow]
BUILD, DAY = 7077, 5
NOMINAL = 1010.6
"""Open frequency of the design in Hz."""
REST, HELD, APART = 4.0, 1.6, 1.0
"""Seconds without a touch at the start, of a touch, and between two."""
MARGIN = 0.3
"""Time left out at either end of a touch: the object comes down and goes, in s."""


@dataclass(frozen=True)
class Take:
    """Sound of a sensor in a file, its pitch and measured length, and begin, end, position, force (n, 4)."""

    file: Path
    pitch: float
    length: float
    touches: Floats

    @property
    def seconds(self) -> float:
        return soundfile.info(self.file).duration


def take(file: Path, places: Floats, seed: int) -> Take:
    """Render held touches at places (n, 2), m and N, of one object."""
    twin = VirtualSensor("prototype", seed=seed, build=BUILD, day=DAY, world="plausible")
    parts, rows = [twin.advance(REST)[0]], list[tuple[float, ...]]()
    rest = parts[0][0, twin.sample_rate :]
    spectrum = np.abs(np.fft.rfft(rest * np.hanning(rest.size)))
    frequency = np.fft.rfftfreq(rest.size, 1.0 / twin.sample_rate)
    near = np.abs(frequency / NOMINAL - 1.0) < 0.1
    for position, force in places.tolist():
        begin = twin.time
        twin.press(position, force, material="plastic")
        parts.append(twin.advance(HELD)[0])
        rows.append((begin + MARGIN, twin.time, position, force))
        twin.release()
        parts.append(twin.advance(APART)[0])
    soundfile.write(file, np.concatenate(parts, axis=1).T, twin.sample_rate, subtype="FLOAT")
    pitch, length = frequency[near][spectrum[near].argmax()], twin.sensor.measured_length
    assert length is not None
    return Take(file=file, pitch=pitch, length=length, touches=np.array(rows))


def test_ten_known_touches_make_a_model_of_ones_own(
    jack_server: Any, play: Callable[..., Any], tmp_path: Path
) -> None:
    rng = np.random.default_rng(11)
    places = np.stack([rng.uniform(0.05, 0.15, 18), rng.uniform(0.2, 1.8, 18)], axis=1)
    known, others = (
        take(tmp_path / "known.wav", places[:10], 5),
        take(tmp_path / "others.wav", places[10:], 5),
    )

    def through_jack(file: Path, *words: str) -> str:
        player = play(file)
        source = ("--source", "jack", "--set", f"source.server={jack_server.name}")
        line = [MONOCHORD, *words, *source, "--set", "source.ports=player:"]
        run = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
        assert run.returncode == 0, run.stderr
        player.terminate()
        return run.stdout

    length = f"{known.length:.4f}"
    through_jack(known.file, "tune", "--sensor", "prototype", "--length", length, "--out", "sensor.toml")
    heard = open_frequency(load_sensor(str(tmp_path / "sensor.toml")).string)
    assert heard == pytest.approx(known.pitch, rel=2e-3)
    assert heard > 1.015 * NOMINAL

    record = ["record", "take.mcap", "--sensor", "sensor.toml", "--simulated", "--seconds"]
    through_jack(known.file, *record, f"{known.seconds + 1.0:g}")
    session = read_session(tmp_path / "take.mcap")
    first = np.argmax(np.any(session.audio.samples != 0.0, axis=0)) / 44100
    with (tmp_path / "touches.csv").open("w", encoding="utf-8", newline="") as table:
        rows = csv.writer(table)
        rows.writerow(("begin", "end", "position", "force"))
        rows.writerows((begin + first, end + first, *what) for begin, end, *what in known.touches.tolist())
    for words in (
        ("sessions", "import", "take.mcap", "touches.csv", "--out", "touches.mcap"),
        ("calibrate", "demo", "--sessions", "touches.mcap", "--out", "mine", "--json"),
    ):
        run = subprocess.run(
            [MONOCHORD, *words], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
        )
        assert run.returncode == 0, run.stderr
    heads = json.loads(run.stdout)["heads"]
    assert heads["force"]["touches"] == 10
    # Where the model knows the force as well as ten touches can teach it, they are not used.
    gain = 1.0 - heads["force"]["after"] / heads["force"]["before"]
    assert heads["force"]["used"] == (gain >= MIN_GAIN)
    assert min(heads["force"]["before"], heads["force"]["after"]) < 0.3
    assert heads["position"]["before"] < 1e-3

    live = ["live", "mine", "--sensor", "sensor.toml", "--json", "--seconds", f"{others.seconds:g}"]
    windows = [json.loads(line) for line in through_jack(others.file, *live).splitlines()]
    begin = next(each["time"] for each in windows if each["why_not"] != "silence")
    time = np.array([each["time"] for each in windows]) - begin
    off: dict[str, list[float]] = {"position": [], "force": []}
    answered: list[bool] = []
    for start, end, position, force in others.touches.tolist():
        held = np.flatnonzero((time > start) & (time < end - MARGIN))
        assert held.size
        answered += [windows[k]["valid"] for k in held]
        for name, truth in (("position", position), ("force", force)):
            off[name] += [abs(windows[k][name] - truth) for k in held if windows[k][name] is not None]
    assert np.mean(answered) > 0.8
    assert np.median(off["position"]) < 1e-3
    assert np.mean(off["force"]) < 0.35
