"""The command `calibrate` on sessions of another rate: the command that it names mends them."""

import shlex
from pathlib import Path

import numpy as np
import pytest
import soundfile
import soxr

from monochord import VirtualSensor
from monochord.cli import run
from monochord.core.types import Audio
from monochord.sessions import read_session

RATE = 44100
TOUCHES = ((0.07, 0.6), (0.12, 1.2))
"""Position in m and force in N of each touch."""


@pytest.fixture(scope="module")
def touched() -> tuple[Audio, str]:
    """Sound (n, 2) of two touches of half a second, and their table."""
    twin, parts, table, frames = (
        VirtualSensor("prototype", seed=1),
        list[Audio](),
        "begin,end,position,force\n",
        0,
    )
    for position, force in TOUCHES:
        parts.append(twin.advance(0.6)[0])
        twin.press(position, force)
        parts.append(twin.advance(0.7)[0])
        twin.release()
        frames += parts[-2].shape[1] + parts[-1].shape[1]
        table += f"{frames / RATE - 0.5},{frames / RATE - 0.05},{position},{force}\n"
    parts.append(twin.advance(0.3)[0])
    return np.concatenate(parts, axis=1).T, table


@pytest.mark.parametrize("rate", [22050, 48000, 96000])
def test_another_rate_is_resampled_by_the_command_that_is_named(
    rate: int,
    touched: tuple[Audio, str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    sound, table = touched
    soundfile.write("take.wav", soxr.resample(sound, RATE, rate), rate, subtype="FLOAT")
    Path("touches.csv").write_text(table, encoding="ascii")
    assert run(["sessions", "import", "take.wav", "touches.csv", "--out", "my touches.mcap"]) == 0
    calibrate = ["calibrate", "demo", "--touches", "0", "--sessions"]
    capsys.readouterr()
    assert run([*calibrate, "my touches.mcap"]) == 2
    line = capsys.readouterr().err
    assert f"session my touches.mcap at {rate} Hz: expected 44100 Hz" in line
    program, *words = shlex.split(line.partition("resample it: ")[2])
    assert program == "monochord"
    assert run(words) == 0
    made = words[words.index("--out") + 1]
    assert read_session(Path(made)).description.sample_rate == RATE
    assert run([*calibrate, made]) == 0
