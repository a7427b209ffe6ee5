"""Delays and false alarms of cases that can be counted by hand; always yes detects nothing."""

from collections.abc import Callable

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.metrics import detection_delays, false_alarms, stretches

EVENTS = np.array([[1.0, 2.0], [3.0, 4.0], [6.0, 7.0]])
NONE = np.zeros((0, 2))


def test_a_perfect_detector_is_not_late_and_raises_no_false_alarm() -> None:
    assert detection_delays(EVENTS, EVENTS).tolist() == [0.0, 0.0, 0.0]
    assert false_alarms(EVENTS, EVENTS) == 0


def test_always_yes_finds_nothing_and_is_false_once() -> None:
    always = np.array([[0.0, 8.0]])
    assert np.isnan(detection_delays(EVENTS, always)).all()
    assert false_alarms(EVENTS, always) == 1


def test_the_first_alarm_of_an_event_counts_and_later_ones_are_not_false() -> None:
    alarms = np.array([[1.25, 1.5], [1.75, 2.5], [6.5, 9.0]])
    np.testing.assert_array_equal(detection_delays(EVENTS, alarms), [0.25, np.nan, 0.5])
    assert false_alarms(EVENTS, alarms) == 0


def test_an_alarm_may_be_early_by_as_much_as_is_allowed() -> None:
    alarms = np.array([[2.875, 3.5]])
    assert np.isnan(detection_delays(EVENTS, alarms)).all()
    assert false_alarms(EVENTS, alarms) == 1
    np.testing.assert_array_equal(detection_delays(EVENTS, alarms, early=0.125), [np.nan, -0.125, np.nan])
    assert false_alarms(EVENTS, alarms, early=0.125) == 0


def test_an_alarm_at_the_end_of_an_event_is_none_of_it() -> None:
    assert false_alarms(EVENTS, np.array([[2.0, 2.5]])) == 1


def test_nothing_happened_and_nothing_was_said() -> None:
    assert detection_delays(NONE, EVENTS).size == 0
    assert np.isnan(detection_delays(EVENTS, NONE)).all()
    assert false_alarms(NONE, NONE) == 0


def test_stretches_begin_and_end_with_their_samples() -> None:
    time = np.linspace(0.0, 2.0, 9)
    on = np.array([1, 1, 0, 0, 1, 0, 0, 1, 1], bool)
    assert stretches(time, on, 0.25).tolist() == [[0.0, 0.5], [1.0, 1.25], [1.75, 2.25]]
    assert stretches(time, ~on, 0.25).tolist() == [[0.5, 1.0], [1.25, 1.75]]
    assert stretches(time, np.zeros(9, bool), 0.25).shape == (0, 2)


def test_a_pause_in_the_series_ends_a_stretch() -> None:
    time = np.array([0.0, 0.5, 2.0, 2.5])
    assert stretches(time, np.ones(4, bool), 0.5).tolist() == [[0.0, 1.0], [2.0, 3.0]]


def test_stretches_of_a_series_can_be_scored() -> None:
    time = np.linspace(0.0, 9.99, 1000)
    truth, detected = (time % 1.0) > 0.5, ((time - 0.03) % 1.0) > 0.5
    events, alarms = (stretches(time, on, 0.01) for on in (truth, detected))
    assert detection_delays(events, alarms)[1:] == pytest.approx(0.03, abs=0.011)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: detection_delays(np.zeros(2), NONE),
        lambda: detection_delays(EVENTS[::-1], NONE),
        lambda: detection_delays(EVENTS, np.array([[1.0, 1.0]])),
        lambda: detection_delays(EVENTS, np.array([[1.0, np.nan]])),
        lambda: false_alarms(EVENTS, EVENTS, early=-1.0),
        lambda: stretches(np.array([0.0, 0.0]), np.ones(2, bool), 0.1),
        lambda: stretches(np.array([0.0, 1.0]), np.ones(2, bool), 0.0),
        lambda: stretches(np.array([0.0, 1.0]), np.array([0, 2]), 1.0),  # pyright: ignore[reportArgumentType]
    ],
)
def test_what_is_no_stretch_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        wrong()
