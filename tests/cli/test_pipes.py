"""What draws on a terminal puts no control sequence into a pipe, whatever the environment says of colours."""

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.cli.terminal import on_a_terminal

ESCAPE = "\x1b"
COLORAMA = "\x1b[0m"
"""What a library of numba's leaves at the end on any terminal."""
COLOUR = re.compile(r"\x1b\[(?:[39]\d|38;|1;3\d)[\d;]*m")
FEW = "groups=[{name='hold', sessions=1, grid=[1, 1], hold=0.3}]"
DRAWING = {
    "demo": ["demo", "--no-browser", "--seconds", "1"],
    "live": ["live", "--estimator", "closed_form", "--source", "twin", "--seconds", "0.5"],
    "record": [
        "record",
        "take.mcap",
        "--source",
        "wav",
        "--set",
        "source.path=take.wav",
        "--set",
        "source.speed=1",
    ],
    "collect": ["collect", "quick", "--out", "sessions", "--set", FEW],
    "doctor": ["doctor"],
    "help": ["live", "--help"],
}
"""Commands that draw: pictures that are renewed, progress bars, and click's help.

A picture and the help are not slow; of a bar in a pipe `tests/core/test_progress.py` tells.
"""
FORCED = [{"FORCE_COLOR": "1"}, {"FORCE_COLOR": "3", "TTY_COMPATIBLE": "1", "CLICOLOR_FORCE": "1"}]
SOURCES = Path(__file__).parents[2] / "src" / "monochord"


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with half a second of noise in two channels."""
    noise = 0.1 * np.random.default_rng(0).standard_normal((22050, 2))
    soundfile.write(tmp_path / "take.wav", noise, 44100)
    return tmp_path


def environment(**changed: str) -> dict[str, str]:
    names = ("FORCE_COLOR", "NO_COLOR", "TTY_COMPATIBLE", "CLICOLOR_FORCE")
    own = {name: value for name, value in os.environ.items() if name not in names}
    return {**own, "TERM": "xterm-256color", "COLUMNS": "100", "LINES": "30", **changed}


def drawn(words: list[str], folder: Path, **changed: str) -> str:
    """Return what a command prints on a terminal of its own."""
    command = [sys.executable, "-m", "monochord", *words]
    return on_a_terminal(command, folder=folder, environment=environment(**changed))


@pytest.mark.parametrize(
    "forced", [pytest.param(FORCED[0], marks=pytest.mark.slow), FORCED[1]], ids=["FORCE_COLOR", "all"]
)
@pytest.mark.parametrize(
    "words",
    [
        pytest.param(words, id=name, marks=[pytest.mark.slow] * (name not in {"record", "help"}))
        for name, words in DRAWING.items()
    ],
)
def test_a_pipe_gets_plain_text(place: Path, words: list[str], forced: dict[str, str]) -> None:
    command = [sys.executable, "-m", "monochord", *words]
    run = subprocess.run(
        command,
        cwd=place,
        env=environment(**forced),
        capture_output=True,
        text=True,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    assert run.stdout + run.stderr
    assert ESCAPE not in run.stdout + run.stderr


def test_a_terminal_is_drawn_on_in_colours_unless_the_environment_refuses_them(place: Path) -> None:
    words = DRAWING["record"]
    assert COLOUR.search(drawn(words, place))
    (place / "take.mcap").unlink()
    plain = drawn(words, place, NO_COLOR="1")
    assert ESCAPE in plain
    assert not COLOUR.search(plain)


@pytest.mark.parametrize(
    "name", ["record", *(pytest.param(each, marks=pytest.mark.slow) for each in ("live", "collect"))]
)
def test_a_terminal_that_cannot_move_its_cursor_gets_lines(place: Path, name: str) -> None:
    shown = drawn(DRAWING[name], place, TERM="dumb", FORCE_COLOR="1")
    assert ESCAPE not in shown.removesuffix(COLORAMA)


def test_one_place_makes_consoles() -> None:
    makers = [path for path in SOURCES.rglob("*.py") if re.search(r"\b_?Console\(", path.read_text("utf-8"))]
    assert [path.name for path in makers] == ["screen.py"]


@pytest.mark.slow
@pytest.mark.parametrize("sinks", [(), ("terminal", "csv=live.csv"), ("jsonl", "csv=live.csv")])
def test_a_run_ends_where_the_reader_of_its_standard_output_goes_away(
    sinks: tuple[str, ...], tmp_path: Path
) -> None:
    named = [word for sink in sinks for word in ("--sink", sink)]
    live = [sys.executable, "-m", "monochord", "live", "demo", "--source", "twin", *named]
    with subprocess.Popen(live, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
        assert run.stdout is not None
        assert run.stdout.readline()
        run.stdout.close()
        assert run.wait(60) == 1
        assert run.stderr is not None
        assert run.stderr.read() == b""
