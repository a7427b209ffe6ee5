"""The filter on scripted estimates: what it may believe, when, and how sure it may be."""

import math
from collections.abc import Callable, Iterable

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.reasons import Reason
from monochord.core.types import Estimate, Estimates, Floats, Prediction
from monochord.live.filter import FilterSettings, FilterState, Tracked, step
from monochord.live.switches import SwitchSettings

RATE, LENGTH, HOP = 44100, 0.1, 0.01
UNITS = {"contact": "", "slip": "", "position": "m", "force": "N"}
SETTINGS = FilterSettings()


def estimates(**values: float | tuple[float, float] | None) -> Estimates:
    """Return estimates by name: a value, a value with its standard error, or None for an abstention."""
    result = dict[str, Estimate]()
    for name, value in values.items():
        if value is None:
            result[name] = Estimate.abstain(UNITS[name], Reason.UNCERTAIN)
        else:
            number, std = value if isinstance(value, tuple) else (value, 0.1)
            result[name] = Estimate(value=number, std=std, unit=UNITS[name])
    return result


def touch(
    position: float | None = 0.08, std: float = 3e-4, force: float = 1.0, slip: float = 0.02
) -> Estimates:
    place = None if position is None else (position, std)
    return estimates(contact=0.99, slip=slip, position=place, force=(force, 0.3))


NONE = estimates(contact=0.01, slip=None, position=None, force=None)
BLIND = estimates(contact=None, slip=None, position=None, force=None)


def follow(
    series: Iterable[Estimates], hop: float = HOP, settings: FilterSettings = SETTINGS
) -> list[tuple[FilterState, Tracked]]:
    state, result = FilterState(), list[tuple[FilterState, Tracked]]()
    for k, each in enumerate(series):
        prediction = Prediction(start=round(k * hop * RATE), time=k * hop, estimates=each)
        state, tracked = step(state, prediction, LENGTH, settings)
        result.append((state, tracked))
    return result


def tracked(
    series: Iterable[Estimates], name: str, hop: float = HOP, settings: FilterSettings = SETTINGS
) -> list[Estimate]:
    return [said.estimates[name] for _, said in follow(series, hop, settings)]


def series(seconds: float, hop: float, of: Callable[[float], Estimates]) -> list[Estimates]:
    return [of(k * hop) for k in range(round(seconds / hop))]


def correlated(count: int, std: float, seed: int) -> Floats:
    """Return errors (count,) as of windows that overlap by nine tenths: a running mean of ten."""
    noise = np.random.default_rng(seed).standard_normal(count + 9)
    return std * np.convolve(noise, np.ones(10), mode="valid") / math.sqrt(10.0)


@pytest.mark.parametrize("name", ["contact", "slip"])
def test_a_decision_does_not_flicker(name: str) -> None:
    # The probability crosses one half with every window, as one near the threshold does.
    wobble = [{**touch(), name: Estimate(value=0.45 + 0.1 * (k % 2), std=0.5, unit="")} for k in range(200)]
    decisions = [said.decided[name] for _, said in follow([touch()] * 40 + wobble)]
    changes = sum(one != other for one, other in zip(decisions[40:], decisions[39:], strict=False))
    assert changes <= 1


def test_one_window_decides_nothing() -> None:
    steps = follow([NONE] * 20 + [touch()] + [NONE] * 20)
    assert not any(said.decided["contact"] for _, said in steps)
    steps = follow([touch()] * 20 + [NONE] + [touch()] * 20)
    assert all(said.decided["contact"] for _, said in steps[5:])


@pytest.mark.parametrize("hop", [0.0025, 0.02])
def test_contact_is_decided_as_soon_at_any_hop(hop: float) -> None:
    onset = 0.5
    windows = series(1.0, hop, lambda time: touch() if time >= onset else NONE)
    steps = follow(windows, hop)
    decided = next(state.time for state, said in steps if said.decided["contact"])
    assert onset + LENGTH <= decided <= onset + LENGTH + 0.01 + max(2 * hop, 0.02)
    assert next(s.contact.since for s, said in steps if said.decided["contact"]) == pytest.approx(0.6)


def test_slip_ends_with_its_touch() -> None:
    sliding = touch(slip=0.9)
    decided = [said.decided for _, said in follow([touch()] * 20 + [sliding] * 30 + [NONE] * 10)]
    assert decided[45] == {"contact": True, "slip": True}
    assert decided[-1] == {"contact": False, "slip": False}


def test_nothing_is_decided_while_nothing_is_known() -> None:
    steps = follow([touch()] * 20 + [BLIND] * 100 + [touch()] * 20)
    assert steps[30][1].decided["contact"]  # a short gap changes nothing
    assert steps[100][1].decided == {}
    assert steps[100][1].estimates["contact"].reason is Reason.UNCERTAIN
    assert steps[-1][1].decided["contact"]


def test_a_touch_is_where_its_window_says_and_nowhere_without() -> None:
    slide = [touch(0.06 + 3e-4 * k) for k in range(50)]
    place = tracked([*slide, touch(None), *slide], "position")
    for windows, said in ((slide[5:], place[5:50]), (slide, place[51:])):
        assert [each["position"] for each in windows] == said
    assert place[50].reason is Reason.UNCERTAIN


def test_no_touch_has_no_position_though_a_window_says_one() -> None:
    steps = follow([NONE] * 20 + [touch()] + [NONE] * 20)
    assert steps[20][1].estimates["position"].reason is Reason.NO_CONTACT


def test_what_leaves_the_sensing_range_has_no_place_at_once() -> None:
    left = {
        name: Estimate.abstain(UNITS[name], Reason.OUTSIDE_RANGE) for name in ("slip", "position", "force")
    }
    series = [touch(0.051)] * 30 + [{**touch(), **left}] * 5
    for name in ("position", "force"):
        said = tracked(series, name)
        assert said[29].valid
        assert [each.reason for each in said[30:]] == [Reason.OUTSIDE_RANGE] * 5


def test_a_new_touch_starts_anew() -> None:
    once = [touch(0.06, force=0.4)] * 60 + [NONE] * 20 + [touch(0.12, force=1.5)] * 30
    alone = [NONE] * 20 + [touch(0.12, force=1.5)] * 30
    for name in ("position", "force"):
        one, other = tracked(once, name)[-1], tracked(alone, name)[-1]
        assert (one.value, one.std) == pytest.approx((other.value, other.std), rel=1e-9)


def test_estimates_that_are_no_numbers_are_abstentions() -> None:
    bad = {
        "contact": Estimate(value=0.99, std=0.1, unit=""),
        "position": Estimate(value=math.nan, std=1e-3, unit="m"),
        "force": Estimate(value=1.0, std=math.inf, unit="N"),
    }
    steps = follow([bad] * 30)
    assert steps[-1][1].decided == {"contact": True}
    assert not steps[-1][1].estimates["position"].valid
    assert not steps[-1][1].estimates["force"].valid


def test_an_estimator_without_contact_is_tracked_too() -> None:
    place = estimates(position=(0.05, 1e-3))
    steps = follow([place] * 30 + [estimates(position=None)] * 40 + [estimates(position=(0.15, 1e-3))] * 5)
    assert steps[25][1].estimates["position"].value == pytest.approx(0.05)
    assert not steps[69][1].estimates["position"].valid
    assert steps[-1][1].estimates["position"].value == pytest.approx(0.15)


def test_a_window_that_does_not_come_after_the_one_before_begins_a_stream() -> None:
    state = follow([touch()] * 30)[-1][0]
    prediction = Prediction(start=0, time=0.0, estimates=touch(0.15))
    assert step(state, prediction, LENGTH, SETTINGS) == step(FilterState(), prediction, LENGTH, SETTINGS)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: SwitchSettings(on=0.3, off=0.5),
        lambda: SwitchSettings(dwell=-1.0),
    ],
)
def test_settings_that_cannot_be_are_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        wrong()
