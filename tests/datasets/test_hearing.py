"""What lies between two rows of a dataset is heard as well, and only what is there."""

import numpy as np
from numpy.testing import assert_array_equal
from tests.datasets.conftest import RATE, Make

from monochord.datasets.hearing import heard

TICK = 0.02


def test_between_rows_come_the_windows_of_every_tick_and_last_the_rows_own(make: Make) -> None:
    dataset = make({"one": {}})
    every = list(heard(dataset, range(3, 6), TICK))
    assert [row for row, _ in every] == [3, *[4] * 5, *[5] * 5]
    assert [window.start for _, window in every] == [round(at * TICK * RATE) for at in range(15, 26)]
    audio = dataset.audio(0)
    for _, window in every:
        assert_array_equal(window.samples, audio[:, window.start : window.start + dataset.manifest.window])
    assert [row for row, _ in heard(dataset, range(3, 6))] == [3, 4, 5]


def test_rows_that_do_not_follow_each_other_have_nothing_between(make: Make) -> None:
    dataset = make({"one": {}})
    assert [row for row, _ in heard(dataset, [0, 2, 3], TICK)] == [0, 2, *[3] * 5]


def test_a_hop_that_no_tick_divides_keeps_to_the_ticks_of_the_whole_session(make: Make) -> None:
    dataset = make({"one": {}}, hop=0.05)
    starts = [window.start / RATE for _, window in heard(dataset, range(4), TICK)]
    assert np.allclose(starts, [0.0, 0.02, 0.04, 0.05, 0.06, 0.08, 0.1, 0.12, 0.14, 0.15])


def test_lost_sound_and_sound_that_no_row_covers_is_not_heard(make: Make) -> None:
    lost = make({"one": {"lost": (8200, 8300)}})
    gap = np.flatnonzero(lost.has_gap).tolist()
    around = list(heard(lost, range(gap[0] - 1, gap[-1] + 2), TICK))
    assert [row for row, _ in around] == list(range(gap[0] - 1, gap[-1] + 2))
    assert [window.has_gap for _, window in around] == [False, *[True] * len(gap), False]
    assert len(list(heard(make({"two": {}}, hop=0.2), range(5), TICK))) == 5


def test_other_sound_may_stand_for_the_sessions_own(make: Make) -> None:
    dataset = make({"one": {}})
    silence = np.zeros_like(dataset.audio(0))
    assert not any(window.samples.any() for _, window in heard(dataset, range(3), TICK, silence))
