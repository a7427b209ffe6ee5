"""The guide through labelled touches, as heard, by key and on strings that state the truth."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from tests.live.sinks.made import window_update

from monochord.core.types import Estimate, Signal
from monochord.live.touch_guide import GUARD, HOLD, REST, SETTLE, UNTOUCHED, TouchGuide
from monochord.physics.known_touches import in_newtons
from monochord.physics.sensors import load_sensor, with_sensor

HOP = 0.02
SIGNAL = with_sensor(Signal(sample_rate=44100, channels=2), load_sensor("prototype"))
UPDATE = window_update(0)


class Person:
    """Somebody who touches the string, and a model that hears it, or does not."""

    def __init__(self, guide: TouchGuide) -> None:
        self.guide, self.now = guide, 0.0

    def wait(self, seconds: float, *, contact: bool | None) -> None:
        decided: Mapping[str, bool] = {} if contact is None else {"contact": contact}
        for _ in range(round(seconds / HOP)):
            self.now += HOP
            self.guide.take(replace(UPDATE, decided=decided), self.now)

    def touch(self) -> None:
        self.wait(REST + UNTOUCHED, contact=False)
        self.wait(SETTLE + HOLD + 2 * HOP, contact=True)


def test_a_touch_is_heard_held_and_labelled() -> None:
    guide = TouchGuide(SIGNAL, 0.2, 2)
    person = Person(guide)
    phases = [guide.phase]
    person.wait(UNTOUCHED + HOP, contact=False)
    phases.append(guide.phase)
    person.wait(3 * HOP, contact=True)
    phases.append(guide.phase)
    begin = person.now
    person.wait(SETTLE + HOLD, contact=True)
    phases.append(guide.phase)
    assert phases == ["rest", "press", "hold", "label"]
    person.wait(3.0, contact=True)  # as long as it takes to read a scale
    assert guide.hold(0.062, in_newtons(51.0, "g"))
    assert guide.phase == "rest"
    untouched, touched = guide.rows
    assert untouched.contact == 0.0
    assert untouched.begin == 0.0
    assert begin - 2 * GUARD < untouched.end < begin - GUARD / 2
    assert math.isnan(untouched.position)
    assert (touched.position, round(touched.force, 3), touched.contact) == (0.062, 0.5, 1.0)
    assert touched.begin > begin + SETTLE / 2
    assert touched.end - touched.begin == pytest.approx(HOLD, abs=2 * HOP)
    person.wait(1.0, contact=True)
    assert guide.phase == "rest"  # not let go yet
    person.touch()
    assert guide.hold(0.1, 1.0)
    assert guide.complete
    assert [row.contact for row in guide.rows] == [0.0, 1.0, 0.0, 1.0]
    bounds = [bound for row in guide.rows for bound in row[:2]]
    assert bounds == sorted(bounds)


def test_a_touch_that_ends_early_is_made_again() -> None:
    guide = TouchGuide(SIGNAL, 0.2, 2)
    person = Person(guide)
    person.wait(UNTOUCHED + HOP, contact=False)
    person.wait(0.5, contact=True)
    person.wait(2 * HOP, contact=False)
    assert guide.phase == "rest"
    assert "too short" in guide.state()["says"]
    assert not guide.touches


def test_a_key_replaces_what_is_not_heard() -> None:
    guide = TouchGuide(SIGNAL, 0.2, 2)
    person = Person(guide)
    person.wait(UNTOUCHED + HOP, contact=True)  # heard where there is none
    assert guide.phase == "rest"
    assert guide.announce()
    person.wait(3 * UNTOUCHED, contact=True)
    assert guide.phase == "press"
    guide = TouchGuide(SIGNAL, 0.2, 2)
    person = Person(guide)
    person.wait(UNTOUCHED + HOP, contact=False)
    assert guide.announce()  # never heard
    person.wait(HOLD / 2, contact=False)
    assert guide.announce()  # the end, too
    assert guide.hold(0.1, math.nan)
    (touch,) = guide.touches
    assert touch.end - touch.begin == pytest.approx(HOLD / 2, abs=2 * HOP)
    person.wait(REST + HOP, contact=False)
    assert guide.phase == "rest"  # a person who is not heard gets longer to let go
    person.wait(2 * REST, contact=False)
    assert guide.phase == "press"


def test_the_last_touch_is_undone_and_proposed_again() -> None:
    guide = TouchGuide(SIGNAL, 0.2, 3)
    person = Person(guide)
    assert not guide.undo()
    first = guide.proposed
    person.touch()
    assert guide.undo()  # before it is labelled
    assert guide.proposed == first
    person.touch()
    assert guide.hold(*first)
    second = guide.proposed
    person.touch()
    assert guide.hold(0.1, 1.0)
    assert guide.undo()
    assert guide.proposed == second
    assert [touch[2:4] for touch in guide.touches] == [first]
    assert guide.skip()
    assert guide.proposed != second


@pytest.mark.parametrize("name", ["prototype", "long"])
def test_touches_are_proposed_within_the_sensing_range_and_the_forces(name: str) -> None:
    sensor = load_sensor(name)
    signal, (low, high) = with_sensor(Signal(sample_rate=44100, channels=2), sensor), sensor.range
    guide = TouchGuide(signal, sensor.string.length, 30, forces=(0.2, 1.0))
    person = Person(guide)
    proposed = [guide.proposed]
    person.wait(UNTOUCHED + HOP, contact=False)
    for _ in range(29):
        assert guide.skip()
        proposed.append(guide.proposed)
    places, forces = np.array(proposed).T
    assert low < places.min() < places.max() < high
    assert places.max() - places.min() > 0.8 * (high - low)
    nodes = sensor.string.length * np.array([k / n for n in range(2, 6) for k in range(1, n)])
    assert np.abs(places[:, None] - nodes).min() >= 0.0149 * sensor.string.length
    assert 0.2 <= forces.min() < 0.3
    assert 0.9 < forces.max() <= 1.0
    assert abs(np.corrcoef(places, forces)[0, 1]) < 0.5


@pytest.mark.parametrize(
    ("position", "force"),
    [(0.1, 51.0), (0.1, -1.0), (0.3, 1.0), (62.0, 0.5), (0.03, 1.0), (math.nan, math.nan), (0.1, 0.0)],
)
def test_a_label_that_cannot_be_is_refused_and_the_touch_waits_for_another(
    position: float, force: float
) -> None:
    guide = TouchGuide(SIGNAL, 0.2, 3)
    person = Person(guide)
    person.touch()
    assert not guide.hold(position, force)
    assert guide.refusal
    assert guide.refusal in guide.state()["says"]
    assert guide.hold(0.1, 1.0)
    assert not guide.refusal


def test_labels_that_contradict_the_model_are_doubted() -> None:
    guide = TouchGuide(SIGNAL, 0.2, 4)
    person = Person(guide)
    for place in (0.06, 0.1, 0.14):
        read = {
            "position": Estimate(value=place, std=1e-3, unit="m"),
            "force": Estimate(value=1.0, std=0.1, unit="N"),
        }
        heard = window_update(0, read, decided={"contact": True})
        person.wait(UNTOUCHED + REST, contact=False)
        for _ in range(round((SETTLE + HOLD + 0.1) / HOP)):
            person.now += HOP
            guide.take(heard, person.now)
        assert not guide.doubt
        assert guide.hold(place, 0.102)  # kilograms
    assert "kilograms" in guide.doubt
    assert guide.undo()
    assert not guide.doubt
