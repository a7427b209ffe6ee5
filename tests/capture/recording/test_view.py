import fcntl
import io
import os
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from monochord.capture.recording.counters import FeedState, Level, RecordingState
from monochord.capture.recording.disk import DiskSpace
from monochord.capture.recording.view import draw, plain_line, viewed
from monochord.core.types import WRENCH, Feed, InstrumentHealth, StreamHealth
from monochord.sessions import Event

WRENCHES = Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3, rate=7000.0)
NOW = RecordingState(
    time=1000.0,
    elapsed=75.0,
    frames=3307500,
    dropped=64,
    gaps=1,
    silent=0.0,
    health=StreamHealth(xruns=3),
    levels=(Level(rms=0.1, peak=0.3, peak_hold=0.5), Level(rms=1e-5, peak=1e-4, peak_hold=1e-4)),
    feeds=(
        FeedState(
            name="net_ft",
            feed=WRENCHES,
            health=InstrumentHealth(missing=2),
            readings=7000,
            rate=6998.6,
            values=dict.fromkeys(WRENCH, 1.234),
        ),
    ),
    space=DiskSpace(free=74.2e9, size=61.5e6, left=90_000.0),
)
TAKE = Path("take.mcap")


def text(now: RecordingState, columns: int = 100) -> str:
    return "\n".join(line.plain for line in draw(TAKE, now, ["1:02  net_ft: silent for 0.5 s"], columns))


def test_the_picture_has_the_counts_and_fits() -> None:
    clipping = Level(rms=1.0, peak=1.0, peak_hold=1.0, clipped=9, clipping=True)
    for shown in (text(NOW, 80), plain_line(NOW)):
        assert all(part in shown for part in ("6999", "gaps 1", "net_ft"))
        assert "CLIP" not in shown
    drawn = text(replace(NOW, levels=(clipping, NOW.levels[1])), 80)
    assert all(
        part in drawn for part in ("61.5 MB", "fz 1.23 N", "missing 2", "dropped 64", "xruns 3", "CLIP")
    )
    assert max(map(len, drawn.splitlines()[:4])) <= 80
    assert plain_line(NOW).isascii()


def test_silence_and_what_is_no_number_are_shown() -> None:
    silent = replace(NOW, levels=(Level(not_numbers=1), Level(quiet=2.0)))
    for shown in (text, plain_line):
        assert "silence" in shown(silent)
        assert "silence" not in shown(NOW)
    assert "not numbers" in text(silent)
    away = replace(NOW, silent=3.2, feeds=(replace(NOW.feeds[0], silent=2.0),))
    assert text(away).count("silent for") == text(NOW).count("silent for") + 2


def test_without_a_terminal_lines_are_printed_and_every_notice() -> None:
    out = io.StringIO()
    notice = Event(time=1000.0, kind="gap", text="audio: 64 frames lost in 1 gap")
    with viewed(TAKE, Console(file=out)) as view:
        for _ in range(3):
            view.show(NOW, [notice])
        time.sleep(0.3)
        view.show(replace(NOW, elapsed=80.0), [])
    lines = out.getvalue().splitlines()
    assert sum(notice.text in line for line in lines) == 3
    assert "75.0 s" in lines[3]
    assert "80.0 s" in lines[-1]
    assert len(lines) == 5


def drawing() -> bool:
    return any(thread.name == "record view" for thread in threading.enumerate())


def test_a_terminal_that_accepts_no_output_blocks_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm-256color")
    ours, theirs = os.pipe()
    fcntl.fcntl(theirs, fcntl.F_SETPIPE_SZ, 4096)
    with os.fdopen(ours, "rb", buffering=0) as shown, os.fdopen(theirs, "w", encoding="utf-8") as file:
        console = Console(file=file, force_terminal=True, width=100, height=30)
        with viewed(TAKE, console) as view:
            for k in range(300):  # nobody reads, and the pipe has space for a drawing or two
                view.show(replace(NOW, elapsed=75.0 + k, levels=(Level(rms=k / 300, peak_hold=k / 300),)), [])
                time.sleep(1e-3)
            assert drawing()
        drawn = b""
        while drawing():
            drawn += shown.read(4096)
            time.sleep(1e-3)
        os.set_blocking(shown.fileno(), False)  # a slow machine draws little, and is done before
        drawn += shown.read(1 << 16) or b""
    assert drawn.startswith(b"\r\x1b[?25l")
    assert b"take.mcap" in drawn
