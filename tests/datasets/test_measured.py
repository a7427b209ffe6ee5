"""What force and pose tell of a touch that is known."""

from typing import Any

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import POSE, WRENCH, Feed
from monochord.datasets.measured import Thresholds, measured_truth
from monochord.sessions import LabelTrack, ReadingTrack

SECONDS = 20.0


def track(stream: str, columns: tuple[str, ...], time: np.ndarray, **values: np.ndarray) -> ReadingTrack:
    table = np.stack([values.get(name, np.zeros(time.size)) for name in columns], axis=1)
    counts: Any = np.arange(time.size)
    status: Any = np.zeros(time.size, np.uint32)
    feed = Feed(stream=stream, columns=columns, units=("1",) * len(columns))
    return ReadingTrack(
        feed=feed, time=time, values=table, sequence=counts, device_time=counts, status=status
    )


def touched(time: np.ndarray) -> np.ndarray:
    """From 5 to 8 s and from 12 to 15 s."""
    return ((time >= 5.0) & (time < 8.0)) | ((time >= 12.0) & (time < 15.0))


def sliding(time: np.ndarray) -> np.ndarray:
    return (time >= 13.0) & (time < 14.5)


def bench(*, bias: float = 0.0, drift: float = 0.0, noise: float = 0.01) -> tuple[ReadingTrack, ReadingTrack]:
    rng = np.random.default_rng(0)
    time = np.arange(0.0, SECONDS, 1 / 1000)
    force = 0.8 * touched(time) + bias + drift * time / SECONDS + noise * rng.normal(size=time.size)
    wrench = track("wrench", WRENCH, time, fz=force + 0.2 * touched(time) * np.sin(2 * np.pi * 300 * time))
    moments = np.arange(0.0, SECONDS, 1 / 250)
    place = 0.05 + 0.01 * np.clip(moments - 13.0, 0.0, 1.5) + 1e-5 * rng.normal(size=moments.size)
    return wrench, track("pose", POSE, moments, x=place, y=1e-5 * rng.normal(size=moments.size))


def truth(**options: float) -> LabelTrack:
    return measured_truth(*bench(**options))


@pytest.mark.parametrize(("bias", "drift"), [(0.0, 0.0), (1.0, 0.0), (-3.0, 0.1), (0.2, -0.1)])
def test_contact_is_exact_to_some_ms_under_bias_and_drift(bias: float, drift: float) -> None:
    labels = truth(bias=bias, drift=drift)
    edges = labels.time[1:][np.diff(labels.columns["contact"]) != 0]
    assert edges == pytest.approx([5.0, 8.0, 12.0, 15.0], abs=0.015)


@pytest.mark.parametrize("bias", [0.0, -2.0])
def test_force_and_position_are_those_applied(bias: float) -> None:
    labels = truth(bias=bias)
    hold = (labels.time > 5.1) & (labels.time < 7.9)
    assert labels.columns["force"][hold] == pytest.approx(0.8, abs=0.03)
    assert labels.columns["force"][hold].mean() == pytest.approx(0.8, abs=0.005)
    assert labels.columns["position"][hold] == pytest.approx(0.05, abs=1e-4)
    assert labels.columns["force"][labels.time < 4.9] == pytest.approx(0.0, abs=0.02)


def test_a_tool_that_moves_in_contact_slides() -> None:
    labels = truth()
    slips = labels.columns["slip"] == 1.0
    assert (slips == sliding(labels.time))[np.abs(labels.time - 13.0) > 0.03].mean() > 0.995
    middle = (labels.time > 13.1) & (labels.time < 14.4)
    assert labels.columns["slip_along"][middle].mean() == pytest.approx(0.01, rel=0.02)
    assert labels.columns["slip_across"][middle].mean() == pytest.approx(0.0, abs=5e-4)


def test_a_tool_that_moves_in_the_air_does_not() -> None:
    wrench, pose = bench()
    flying = track("pose", POSE, pose.time, x=0.05 + 0.02 * pose.time, y=0 * pose.time)
    labels = measured_truth(wrench, flying).columns
    assert not labels["slip"][labels["contact"] == 0.0].any()
    assert labels["slip_along"][100:-100] == pytest.approx(0.02, rel=0.01)


def test_missing_readings_leave_what_is_between_unknown() -> None:
    wrench, pose = bench()
    keep = (wrench.time < 6.0) | (wrench.time > 6.5)
    holed = track("wrench", WRENCH, wrench.time[keep], fz=wrench.column("fz")[keep])
    labels = measured_truth(holed, pose)
    gap = (labels.time > 6.01) & (labels.time < 6.49)
    assert all(np.isnan(values[gap]).all() for values in labels.columns.values())
    assert np.isfinite(labels.columns["contact"][~gap]).mean() > 0.998


def test_a_session_touched_throughout_has_contact() -> None:
    time = np.arange(0.0, 3.0, 1e-3)
    wrench = track("wrench", WRENCH, time, fz=np.where(time < 0.4, 0.0, 1.0))
    still = track("pose", POSE, time[::4], x=np.full(time[::4].size, 0.05))
    labels = measured_truth(wrench, still)
    assert (labels.columns["contact"] == (labels.time >= 0.4)).mean() > 0.99


def test_streams_without_readings_and_odd_thresholds_are_refused() -> None:
    wrench, _ = bench()
    with pytest.raises(InputError, match="stream 'pose' without readings"):
        measured_truth(wrench, track("pose", POSE, np.zeros(0)))
    for odd in ({"on": 0.01}, {"off": 0.0}, {"smooth": 0.0}, {"span": 2.0}, {"moving": 0.0}):
        with pytest.raises(InputError, match=r"above (0|on)"):
            Thresholds(**odd)
