import numpy as np
import pytest

from monochord.capture.recording.feeds import FeedTally
from monochord.core.types import Feed, InstrumentHealth, Readings

FEED = Feed(stream="gripper", columns=("width", "force"), units=("m", "N"), rate=100.0)
HEALTH = InstrumentHealth(missing=3)


def readings(count: int, *, value: float = 1.0, status: int = 0) -> Readings:
    return Readings(
        stream="gripper",
        time=np.zeros(count),
        values=np.full((count, 2), value),
        sequence=np.arange(count),
        device_time=np.arange(count),
        status=np.full(count, status, np.uint32),
    )


def test_it_counts_and_keeps_the_newest() -> None:
    tally = FeedTally("gripper", FEED, begin=0.0)
    tally.add(readings(40, value=1.0), 0.4)
    tally.add(readings(60, value=2.0), 1.0)
    now = tally.look(1.0, HEALTH)
    assert (now.name, now.readings, now.health) == ("gripper", 100, HEALTH)
    assert now.values == {"width": 2.0, "force": 2.0}
    assert now.rate == pytest.approx(100.0)
    assert now.silent == 0.0


def test_the_rate_is_that_of_the_last_second() -> None:
    tally = FeedTally("gripper", FEED, begin=0.0)
    tally.add(readings(100), 1.0)
    tally.look(1.0, HEALTH)
    tally.add(readings(10), 2.0)
    assert tally.look(2.0, HEALTH).rate == pytest.approx(10.0)


@pytest.mark.parametrize(("rate", "patience"), [(7000.0, 0.5), (100.0, 0.5), (2.0, 2.5), (0.0, 2.0)])
def test_an_instrument_that_is_late_is_silent(rate: float, patience: float) -> None:
    feed = Feed(stream="gripper", columns=("width", "force"), units=("m", "N"), rate=rate)
    tally = FeedTally("gripper", feed, begin=0.0)
    tally.add(readings(1), 10.0)
    assert tally.look(10.0 + 0.9 * patience, HEALTH).silent == 0.0
    assert tally.look(10.0 + 1.1 * patience, HEALTH).silent == pytest.approx(1.1 * patience)


def test_one_that_never_spoke_is_silent_too() -> None:
    tally = FeedTally("gripper", FEED, begin=5.0)
    now = tally.look(7.0, HEALTH)
    assert (now.silent, now.values, now.readings) == (2.0, {}, 0)


def test_faults_are_counted_and_the_newest_status_kept() -> None:
    tally = FeedTally("gripper", FEED, begin=0.0)
    tally.add(readings(3, status=2), 0.1)
    tally.add(readings(2, status=0x80010000), 0.2)
    tally.add(readings(5), 0.3)
    now = tally.look(0.3, HEALTH)
    assert (now.readings, now.faulty, now.status) == (10, 5, 0x80010000)
