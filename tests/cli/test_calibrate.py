"""Sessions of another rate than the model's: a higher one is resampled, a lower one by the named command."""

import shlex
from collections.abc import Callable
from pathlib import Path

import pytest
import soundfile
import soxr
from tests.cli.running import Capture
from tests.twins import sound_of

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
    twin, table = VirtualSensor("prototype", seed=1), "begin,end,position,force\n"
    sound, _ = sound_of(twin, *(step for touch in TOUCHES for step in (0.6, touch, 0.7, None)), 0.3)
    for end, (position, force) in zip((1.3, 2.6), TOUCHES, strict=True):
        table += f"{end - 0.5},{end - 0.05},{position},{force}\n"
    return sound.T, table


Imported = Callable[[int], None]


@pytest.fixture
def imported(touched: tuple[Audio, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Imported:
    """Return what imports the touches at a rate in Hz, as ``my touches.mcap`` in the working folder."""
    monkeypatch.chdir(tmp_path)
    sound, table = touched
    Path("touches.csv").write_text(table, encoding="ascii")

    def write(rate: int) -> None:
        soundfile.write("take.wav", soxr.resample(sound, RATE, rate), rate, subtype="FLOAT")
        assert run(["sessions", "import", "take.wav", "touches.csv", "--out", "my touches.mcap"]) == 0

    return write


CALIBRATE = ["calibrate", "demo", "--touches", "0", "--sessions"]


def test_a_lower_rate_is_resampled_by_the_command_that_is_named(imported: Imported, capsys: Capture) -> None:
    imported(22050)
    capsys.readouterr()
    assert run([*CALIBRATE, "my touches.mcap"]) == 2
    line = capsys.readouterr().err
    assert "session my touches.mcap at 22050 Hz: expected 44100 Hz or more" in line
    program, *words = shlex.split(line.partition("resample it: ")[2])
    assert program == "monochord"
    assert run(words) == 0
    made = words[words.index("--out") + 1]
    assert read_session(Path(made)).description.sample_rate == RATE
    assert run([*CALIBRATE, made]) == 0


@pytest.mark.parametrize(
    ("rate", "command"),
    [
        (96000, CALIBRATE),
        (48000, ["evaluate", "demo", "--no-baselines", "--sessions"]),
    ],
)
def test_a_higher_rate_gives_what_a_resampled_copy_gives(
    rate: int, command: list[str], imported: Imported, capsys: Capture
) -> None:
    imported(rate)
    Path("by_hand").mkdir()
    assert run(["sessions", "resample", "my touches.mcap", "--out", "by_hand/my touches.mcap"]) == 0
    capsys.readouterr()
    said: list[str] = []
    for folder in ("", "by_hand/"):
        assert run([*command, f"{folder}my touches.mcap", "--json"]) == 0
        said.append(capsys.readouterr().out.replace("by_hand/", ""))
    assert len(said[0]) > 100
    assert said[0] == said[1]
