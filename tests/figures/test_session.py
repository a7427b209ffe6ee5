"""Figures of a session: its streams over time, and its taps before and after alignment."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import POSE, WRENCH, Block, Feed, Readings
from monochord.figures.session import MAX_POINTS, SessionFigure, _thinned, levels
from monochord.figures.taps import LATE, Taps, tapped
from monochord.sessions import Description, SessionWriter, read_session

RATE = 16000
FEEDS = (
    Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3, rate=1000.0),
    Feed(stream="pose", columns=POSE, units=("m",) * 3 + ("",) * 4, rate=250.0),
)


def write(
    path: Path, feeds: tuple[Feed, ...] = FEEDS, labels: tuple[str, ...] = ("contact", "position")
) -> Path:
    description = Description(name="take", sample_rate=RATE, feeds=feeds)
    with SessionWriter(path, description) as writer:
        origin = writer.clock.origin
        half = np.full((2, RATE // 2), [[0.1], [1.0]], np.float32)
        writer.audio(Block(samples=half, start=0, adc_time=origin))
        writer.audio(Block(samples=half, start=RATE, dropped=RATE // 2, adc_time=origin + 1.0))
        for feed in feeds:
            time = np.arange(10) / 10
            none = np.full(10, -1)
            writer.readings(
                Readings(
                    stream=feed.stream,
                    time=origin + time,
                    values=np.outer(time, np.ones(len(feed.columns))),
                    sequence=none,
                    device_time=none,
                    status=np.zeros(10, np.uint32),
                )
            )
        if labels:
            writer.labels(origin + np.arange(3.0), {name: np.array([0.0, 1.0, np.nan]) for name in labels})
        writer.event(origin + 0.4, "tap")
    return path


@pytest.mark.parametrize(
    ("options", "panels"),
    [
        ({}, 5),
        ({"feeds": ()}, 2),
        ({"labels": ()}, 4),
        ({"labels": ("force", "slip"), "feeds": FEEDS[:1]}, 3),
    ],
)
def test_there_is_a_panel_for_each_stream(tmp_path: Path, options: dict[str, Any], panels: int) -> None:
    page = SessionFigure(path=write(tmp_path / "a.mcap", **options)).draw()
    assert len(page.axes) == panels
    page.savefig(tmp_path / "a.png")


def test_levels_are_those_of_the_samples_and_a_gap_is_marked(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap")
    time, decibels = levels(read_session(path).audio, 0.5)
    np.testing.assert_allclose(time, [0.25, 0.75, 1.25], atol=1e-6)
    np.testing.assert_allclose(decibels, [[-20.0, -100.0, -20.0], [0.0, -100.0, 0.0]], atol=1e-5)
    axes = SessionFigure(path=path).draw().axes[0]
    (gap,) = axes.patches
    left, right = gap.get_extents().transformed(axes.transData.inverted()).intervalx
    assert (left, right) == pytest.approx((0.5, 1.0), abs=1e-6)


def test_measured_forces_are_drawn(tmp_path: Path) -> None:
    axes = SessionFigure(path=write(tmp_path / "a.mcap")).draw().axes[1]
    np.testing.assert_allclose(np.asarray(axes.lines[0].get_ydata()), np.arange(10) / 10)


def test_a_long_curve_is_thinned_and_keeps_its_peaks() -> None:
    time, values = np.arange(1_000_000) / 7000.0, np.zeros(1_000_000)
    values[123_456], values[654_321] = 5.0, -3.0
    short, thinned = _thinned(time, values)
    assert len(short) == len(thinned) <= MAX_POINTS
    assert (thinned.max(), thinned.min()) == (5.0, -3.0)
    assert short[thinned.argmax()] == pytest.approx(time[123_456], abs=0.1)


def test_a_step_of_zero_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"step 0 s: allowed is a number above 0 s$"):
        SessionFigure(path=write(tmp_path / "a.mcap"), step=0.0).draw()


def test_taps_have_the_offsets_of_the_streams() -> None:
    numbers = json.loads(json.dumps(Taps().numbers()))
    assert numbers["reference"] == "wrench"
    assert numbers["flags"] == []
    for stream, width in (("audio", 0.5e-3), ("pose", 4e-3)):
        for offset, late in zip(numbers[stream]["offsets"], LATE[stream], strict=True):
            assert offset == pytest.approx(late, abs=width)
        assert numbers[stream]["taps"][0] >= 4


def test_taps_draw_each_stream_before_and_after_alignment(tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    tapped(groups=(1.5,), seconds=5.0).write(path)
    page = Taps(session=str(path), tap=2).draw()
    assert len(page.axes) == 6
    for axes in page.axes:
        assert any(len(line.get_xdata()) > 10 for line in axes.get_lines())  # pyright: ignore[reportArgumentType]
    page.savefig(tmp_path / "taps.png")
    with pytest.raises(InputError, match="tap 5: allowed is 0 to 4"):
        Taps(session=str(path), tap=5).draw()


def test_a_session_without_taps_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    tapped(groups=(), seconds=2.0).write(path)
    with pytest.raises(InputError, match="there are no taps in wrench"):
        Taps(session=str(path)).draw()
    with pytest.raises(InputError, match="tap -1"):
        Taps(tap=-1)
