"""Events from decisions: each change once, with its onset, in the order in which it must be read."""

import math

from monochord.core.types import Estimate, Estimates, Prediction
from monochord.live import events
from monochord.live.events import AnnouncedState, Event
from monochord.live.filter import FilterSettings, FilterState, step


def window(contact: float | None, slip: float | None = None) -> Estimates:
    values = {"contact": contact, "slip": slip}
    return {
        name: Estimate.abstain("", "gap") if value is None else Estimate(value=value, std=0.1, unit="")
        for name, value in values.items()
    }


def happened(windows: list[Estimates], offset: float | None = None) -> list[Event]:
    state, announced, settings, result = FilterState(), AnnouncedState(), FilterSettings(), list[Event]()
    for k, each in enumerate(windows):
        prediction = Prediction(start=441 * k, time=0.01 * k, estimates=each)
        state, tracked = step(state, prediction, 0.1, settings)
        announced, changes = events.step(announced, state, tracked, offset)
        result += changes
    return result


NONE, REST, SLIDE, BLIND = window(0.01), window(0.99, 0.02), window(0.99, 0.9), window(None)


def test_a_slide_is_four_events_in_order() -> None:
    seen = happened([NONE] * 20 + [REST] * 30 + [SLIDE] * 30 + [REST] * 40 + [SLIDE] * 30 + [NONE] * 20)
    assert [(each.name, each.on) for each in seen] == [
        ("contact", True),
        ("slip", True),
        ("slip", False),
        ("slip", True),
        ("slip", False),
        ("contact", False),
    ]
    assert all(0.0 <= each.delay < 0.2 and each.confidence > 0.5 for each in seen)


def test_the_onset_is_the_end_of_the_first_window_that_showed_it() -> None:
    first, *_ = happened([NONE] * 20 + [REST] * 30)
    assert math.isclose(first.time, 0.2 + 0.1, abs_tol=1e-9)
    assert 0.0 < first.delay <= 0.03
    assert first.adc_time is None


def test_the_converters_clock_is_carried_over() -> None:
    first, *_ = happened([NONE] * 20 + [REST] * 30, offset=5000.0)
    assert first.adc_time is not None
    assert math.isclose(first.adc_time, 5000.3, abs_tol=1e-9)


def test_what_is_not_known_is_no_event() -> None:
    assert len(happened([NONE] * 20 + [SLIDE] * 40 + [BLIND] * 200)) == 2
    seen = happened([NONE] * 20 + [REST] * 40 + [BLIND] * 200 + [REST] * 40)
    assert [(each.name, each.on) for each in seen] == [("contact", True)]
    seen = happened([NONE] * 20 + [REST] * 40 + [BLIND] * 200 + [NONE] * 40)
    assert [(each.name, each.on) for each in seen] == [("contact", True), ("contact", False)]


def test_nothing_touched_is_no_event() -> None:
    assert not happened([NONE] * 100)
    assert not happened([{"position": Estimate.abstain("m", "silence")}] * 20)
