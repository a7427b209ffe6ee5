from itertools import pairwise

import numpy as np
import pytest

from monochord.lab.rendering import Happening, Rendering, first_reading, joined


def stretch(start: int, stop: int) -> Rendering:
    """Streams whose values are their own times in ms."""
    told: dict[str, list[float]] = {}
    for name, rate in (("wrench", 7000.0), ("pose", 250.0), ("labels", 1000.0)):
        first, last = first_reading(start, rate, 44100), first_reading(stop, rate, 44100)
        told[name] = [1e3 * i / rate for i in range(first, last)]
    return Rendering(
        start=start,
        sample_rate=44100,
        force_rate=7000.0,
        pose_rate=250.0,
        label_rate=1000.0,
        microphones=np.zeros((2, stop - start), np.float32),
        wrench=np.repeat(np.array(told["wrench"])[:, None], 6, axis=1),
        pose=np.repeat(np.array(told["pose"])[:, None], 7, axis=1),
        labels={"contact": np.array(told["labels"])},
        events=(Happening(time=start / 44100, kind="phase", text="hold"),),
    )


@pytest.mark.parametrize("edges", [(0, 1, 2, 5000), (0, 441, 882, 44100), (100, 12345, 50001)])
def test_stretches_join_without_a_reading_twice_or_left_out(edges: tuple[int, ...]) -> None:
    parts = [stretch(a, b) for a, b in pairwise(edges)]
    whole, once = joined(parts), stretch(edges[0], edges[-1])
    for name in ("wrench", "pose", "microphones"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(once, name))
    for time, values in (
        (whole.wrench_time, whole.wrench[:, 0]), (whole.pose_time, whole.pose[:, 0]),
        (whole.label_time, whole.labels["contact"]),
    ):  # fmt: skip
        np.testing.assert_allclose(1e3 * time, values, atol=1e-9)
    assert (whole.begin, whole.seconds) == (once.begin, once.seconds)
    assert len(whole.events) == len(parts)


def test_nothing_cannot_be_joined() -> None:
    with pytest.raises(ValueError, match="nothing"):
        joined([])
