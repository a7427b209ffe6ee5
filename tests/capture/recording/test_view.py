import fcntl
import io
import os
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from monochord.capture.recording.counters import FeedNow, Level, Progress
from monochord.capture.recording.disk import Space
from monochord.capture.recording.view import draw, plain_line, viewed
from monochord.core.types import WRENCH, Feed, InstrumentHealth, StreamHealth
from monochord.sessions import Event

WRENCHES = Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3, rate=7000.0)
NOW = Progress(
    time=1000.0,
    elapsed=75.0,
    frames=3307500,
    dropped=64,
    gaps=1,
    silent=0.0,
    health=StreamHealth(xruns=3),
    levels=(Level(rms=0.1, peak=0.3, peak_hold=0.5), Level(rms=1e-5, peak=1e-4, peak_hold=1e-4)),
    feeds=(
        FeedNow(
            name="net_ft",
            feed=WRENCHES,
            health=InstrumentHealth(missing=2),
            readings=7000,
            rate=6998.6,
            values=dict.fromkeys(WRENCH, 1.234),
        ),
    ),
    space=Space(free=74.2e9, size=61.5e6, left=90_000.0),
)
TAKE = Path("take.mcap")


def text(now: Progress, columns: int = 100) -> str:
    return "\n".join(line.plain for line in draw(TAKE, now, ["1:02  net_ft: silent for 0.5 s"], columns))


def test_the_picture_tells_what_matters() -> None:
    shown = text(NOW)
    for part in (
        "take.mcap",
        "1:15",
        "61.5 MB",
        "mic 1",
        "-20.0 dBFS",
        "-100.0 dBFS",
        "fz 1.23 N",
        "6999 of 7000 a second",
        "missing 2",
        "gaps 1",
        "dropped 64",
        "xruns 3",
        "74.2 GB free, space for 25 h",
        "! 1:02  net_ft: silent for 0.5 s",
    ):
        assert part in shown
    assert "CLIP" not in shown


@pytest.mark.parametrize("columns", [80, 110])
def test_its_meters_fit(columns: int) -> None:
    clipping = Level(rms=1.0, peak=1.0, peak_hold=1.0, clipped=9, clipping=True)
    lines = text(replace(NOW, levels=(clipping, NOW.levels[1])), columns).splitlines()
    assert max(map(len, lines[:4])) <= columns
    assert "CLIP" in lines[2]


def test_silence_is_shown_by_its_microphone() -> None:
    silent = replace(NOW, levels=(NOW.levels[0], Level(quiet=2.0)))
    assert "silence, microphone 2" in plain_line(silent)
    assert "silence" not in plain_line(NOW)
    assert "silence" in text(silent)


def bar(level: Level) -> str:
    (line,) = [line for line in text(replace(NOW, levels=(level,))).splitlines() if "mic 1" in line]
    return line[9 : 9 + 66]


def test_a_bar_is_as_long_as_the_sound_is_loud_and_the_peak_stands_beyond() -> None:
    quiet, loud = (bar(Level(rms=rms, peak=rms, peak_hold=0.5)) for rms in (0.01, 0.1))
    assert quiet.count("█") == pytest.approx(66 * (1 - 40 / 60), abs=1)
    assert loud.count("█") == pytest.approx(66 * (1 - 20 / 60), abs=1)
    assert quiet.rindex("▏") == loud.rindex("▏") == pytest.approx(66 * 0.9, abs=1)


def test_silence_and_nan_are_shown() -> None:
    now = replace(NOW, silent=3.2, levels=(Level(), Level(not_numbers=1)))
    assert "silence" in text(now)
    assert "not numbers" in text(now)
    assert "audio    silent for 3.2 s" in text(now)
    silent = replace(NOW.feeds[0], silent=2.0)
    assert "silent for 2.0 s" in text(replace(NOW, feeds=(silent,)))
    assert "of 7000" not in text(replace(NOW, feeds=(silent,)))


def test_a_pose_is_shown_in_millimetres() -> None:
    feed = Feed(stream="pose", columns=("x", "y", "z", "qw"), units=("m", "m", "m", ""))
    values = {"x": 0.1, "y": 0.0, "z": -0.0012, "qw": 1.0}
    pose = FeedNow(name="pose_dds", feed=feed, health=InstrumentHealth(), rate=250.0, values=values)
    assert "x 100.0 mm   y 0.0 mm   z -1.2 mm   250 a second" in text(replace(NOW, feeds=(pose,)))


def test_a_line_for_where_nothing_can_be_drawn() -> None:
    line = plain_line(replace(NOW, silent=1.0))
    for part in ("75.0 s", "peak -6 / -80 dBFS", "gaps 1", "silent for 1.0 s", "net_ft 6999 a second"):
        assert part in line
    assert line.isascii()


def test_without_a_terminal_lines_are_printed_and_every_notice() -> None:
    out = io.StringIO()
    notice = Event(time=1000.0, kind="gap", text="audio: 64 frames lost in 1 gap")
    with viewed(TAKE, Console(file=out)) as view:
        for _ in range(3):
            view.show(NOW, [notice])
        time.sleep(0.3)
        view.show(replace(NOW, elapsed=80.0), [])
    lines = out.getvalue().splitlines()
    assert sum("64 frames lost" in line for line in lines) == 3
    assert "75.0 s  peak" in lines[3]
    assert "80.0 s  peak" in lines[-1]
    assert len(lines) == 5


def drawing() -> bool:
    return any(thread.name == "record view" for thread in threading.enumerate())


def test_a_terminal_that_accepts_no_output_blocks_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm-256color")
    ours, theirs = os.pipe()
    fcntl.fcntl(theirs, fcntl.F_SETPIPE_SZ, 4096)
    longest, begin = 0.0, time.monotonic()
    with os.fdopen(ours, "rb", buffering=0) as shown, os.fdopen(theirs, "w", encoding="utf-8") as file:
        console = Console(file=file, force_terminal=True, width=100, height=30)
        with viewed(TAKE, console) as view:
            for k in range(300):  # nobody reads, and the pipe has space for a drawing or two
                before = time.monotonic()
                view.show(replace(NOW, elapsed=75.0 + k, levels=(Level(rms=k / 300, peak_hold=k / 300),)), [])
                longest = max(longest, time.monotonic() - before)
                time.sleep(1e-3)
            assert drawing()
        assert time.monotonic() - begin < 10.0
        drawn = b""
        while drawing():
            drawn += shown.read(4096)
            time.sleep(1e-3)
        os.set_blocking(shown.fileno(), False)  # a slow machine draws little, and is done before
        drawn += shown.read(1 << 16) or b""
    assert longest < 0.2
    assert drawn.startswith(b"\r\x1b[?25l")
    assert b"take.mcap" in drawn
