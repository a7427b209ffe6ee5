"""Figures of a session: its streams over time, and its taps before and after alignment."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from studies.taps import LATE, tapped

from monochord.core.curves import MAX_POINTS
from monochord.core.errors import InputError
from monochord.core.types import POSE, WRENCH, Block, Feed, Floats, Readings
from monochord.figures.session import SessionFigure, levels
from monochord.figures.taps import Taps
from monochord.sessions import Description, SessionWriter, read_session

RATE = 16000
FEEDS = (
    Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3, rate=1000.0),
    Feed(stream="pose", columns=POSE, units=("m",) * 3 + ("",) * 4, rate=250.0),
)


def write(
    path: Path,
    feeds: tuple[Feed, ...] = FEEDS,
    labels: tuple[str, ...] = ("contact", "position"),
    force: Floats | None = None,
) -> Path:
    """A session of 1.5 s with a gap; readings rise with the time, or those of a force are given."""
    description = Description(name="take", sample_rate=RATE, feeds=feeds)
    with SessionWriter(path, description) as writer:
        origin = writer.clock.origin
        half = np.full((2, RATE // 2), [[0.1], [1.0]], np.float32)
        writer.audio(Block(samples=half, start=0, adc_time=origin))
        writer.audio(Block(samples=half, start=RATE, dropped=RATE // 2, adc_time=origin + 1.0))
        for feed in feeds:
            time: Floats = np.arange(10) / 10 if force is None else 1e-4 * np.arange(float(force.size))
            count, none = time.size, np.full(time.size, -1)
            values = np.outer(time if force is None else force, np.ones(len(feed.columns)))
            writer.readings(
                Readings(
                    stream=feed.stream, time=origin + time, values=values, sequence=none, device_time=none,
                    status=np.zeros(count, np.uint32),
                )
            )  # fmt: skip
        writer.labels(origin + np.arange(3.0), {name: np.array([0.0, 1.0, np.nan]) for name in labels})
        writer.event(origin + 0.4, "tap")
    return path


def test_there_is_a_panel_for_each_stream(tmp_path: Path) -> None:
    few = write(tmp_path / "few.mcap", feeds=FEEDS[:1], labels=("force", "slip"))
    assert len(SessionFigure(path=few).draw().axes) == 3
    page = SessionFigure(path=write(tmp_path / "all.mcap")).draw()
    assert len(page.axes) == 5
    np.testing.assert_allclose(np.asarray(page.axes[1].lines[0].get_ydata()), np.arange(10) / 10)
    page.savefig(tmp_path / "all.png")
    with pytest.raises(InputError, match="step"):
        SessionFigure(path=few, step=0.0).draw()


def test_levels_are_those_of_the_samples_and_a_gap_is_marked(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap")
    time, decibels = levels(read_session(path).audio, 0.5)
    np.testing.assert_allclose(time, [0.25, 0.75, 1.25], atol=1e-6)
    np.testing.assert_allclose(decibels, [[-20.0, -100.0, -20.0], [0.0, -100.0, 0.0]], atol=1e-5)
    axes = SessionFigure(path=path).draw().axes[0]
    (gap,) = axes.patches
    left, right = gap.get_extents().transformed(axes.transData.inverted()).intervalx
    assert (left, right) == pytest.approx((0.5, 1.0), abs=1e-6)


def test_a_long_curve_is_thinned_and_keeps_its_peaks(tmp_path: Path) -> None:
    force = np.zeros(5000)
    force[1234], force[4321] = 5.0, -3.0
    (curve,) = SessionFigure(path=write(tmp_path / "a.mcap", FEEDS[:1], force=force)).draw().axes[1].lines[:1]
    time, thinned = np.asarray(curve.get_xdata()), np.asarray(curve.get_ydata())
    assert len(time) <= MAX_POINTS
    assert (thinned.max(), thinned.min()) == (5.0, -3.0)
    assert time[thinned.argmax()] == pytest.approx(0.1234, abs=1e-3)


def test_taps_have_the_offsets_of_the_streams(tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    replace(tapped(), late=LATE).write(path)
    numbers = json.loads(json.dumps(Taps(session=path).numbers()))
    assert numbers["reference"] == "wrench"
    assert numbers["flags"] == []
    for stream, width in (("audio", 0.5e-3), ("pose", 4e-3)):
        for offset, late in zip(numbers[stream]["offsets"], LATE[stream], strict=True):
            assert offset == pytest.approx(late, abs=width)
        assert numbers[stream]["taps"][0] >= 4


def test_taps_draw_each_stream_before_and_after_alignment(tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    tapped(groups=(1.5,), seconds=5.0).write(path)
    page = Taps(session=path, tap=2).draw()
    assert len(page.axes) == 6
    for axes in page.axes:
        assert any(len(line.get_xdata()) > 10 for line in axes.get_lines())  # pyright: ignore[reportArgumentType]
    with pytest.raises(InputError, match="tap 5"):
        Taps(session=path, tap=5).draw()


def test_a_session_without_taps_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "session.mcap"
    tapped(groups=(), seconds=2.0).write(path)
    with pytest.raises(InputError, match="wrench"):
        Taps(session=path).draw()
    with pytest.raises(InputError, match="tap' = -1"):
        Taps(session=path, tap=-1)
