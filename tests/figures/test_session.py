from pathlib import Path
from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import POSE, WRENCH, Block, Feed, Readings
from monochord.figures.session import POINTS, SessionFigure, _thinned, levels
from monochord.sessions import Description, SessionWriter, read_session

RATE = 16000
FEEDS = (
    Feed(stream="wrench", columns=WRENCH, units=("N",) * 3 + ("N m",) * 3, rate=1000.0),
    Feed(stream="pose", columns=POSE, units=("m",) * 3 + ("",) * 4, rate=250.0),
)


def write(
    path: Path, feeds: tuple[Feed, ...] = FEEDS, labels: tuple[str, ...] = ("contact", "position")
) -> Path:
    told = Description(name="take", sample_rate=RATE, feeds=feeds)
    with SessionWriter(path, told) as writer:
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
def test_there_is_a_panel_for_each_thing_that_a_session_holds(
    tmp_path: Path, options: dict[str, Any], panels: int
) -> None:
    page = SessionFigure(path=write(tmp_path / "a.mcap", **options)).draw()
    assert len(page.axes) == panels
    assert page.axes[0].get_title() == "take"
    assert page.axes[-1].get_xlabel() == "time since the session's begin (s)"
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


def test_forces_drawn_are_those_measured(tmp_path: Path) -> None:
    axes = SessionFigure(path=write(tmp_path / "a.mcap")).draw().axes[1]
    np.testing.assert_allclose(np.asarray(axes.lines[0].get_ydata()), np.arange(10) / 10)


def test_a_long_curve_is_thinned_and_keeps_its_peaks() -> None:
    time, values = np.arange(1_000_000) / 7000.0, np.zeros(1_000_000)
    values[123_456], values[654_321] = 5.0, -3.0
    short, kept = _thinned(time, values)
    assert len(short) == len(kept) <= POINTS
    assert (kept.max(), kept.min()) == (5.0, -3.0)
    assert short[kept.argmax()] == pytest.approx(time[123_456], abs=0.1)


def test_a_step_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"^step 0\.0 s: allowed is more than 0 s$"):
        SessionFigure(path=write(tmp_path / "a.mcap"), step=0.0).draw()
