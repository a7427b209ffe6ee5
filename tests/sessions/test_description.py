import json
from pathlib import Path

import numpy as np
import pytest
from tests.sessions.made import FEEDS

from monochord.core.errors import InputError
from monochord.core.types import StringParams
from monochord.sessions import Description, SessionClock


def test_a_description_survives_as_text() -> None:
    description = Description(
        name="a",
        sample_rate=48000,
        string=StringParams(length=0.2, linear_density=4e-4, tension=70.0),
        sensor={"name": "prototype", "range": [0.05, 0.15]},
        radius=0.005,
        preamp_gains=(12.0, 12.5),
        feeds=FEEDS,
        more={"robot": "arm"},
    )
    assert Description.load(description.dump()) == description


def test_fields_of_a_newer_version_are_preserved() -> None:
    text = json.dumps({**json.loads(Description(name="a", sample_rate=1).dump()), "humidity": 0.4})
    assert Description.load(text).more == {"humidity": "0.4"}


@pytest.mark.parametrize("wrong", [{"name": ""}, {"sample_rate": 0}, {"channels": 0}])
def test_what_cannot_be_is_refused(wrong: dict[str, object]) -> None:
    fields: dict[str, object] = {"name": "a", "sample_rate": 44100, **wrong}
    with pytest.raises(InputError):
        Description(**fields)  # pyright: ignore[reportArgumentType]


def test_the_clock_keeps_nanoseconds() -> None:
    clock = SessionClock(epoch_ns=1_763_740_000_123_456_789, origin=98765.4321)
    times = 98765.4321 + np.array([0.0, 1e-9, 3600.0])
    stamps = clock.stamps(times)
    assert np.abs(stamps - clock.epoch_ns - np.array([0, 1, 3_600_000_000_000])).max() <= 15
    again = SessionClock(epoch_ns=clock.epoch_ns).stamps(clock.seconds(stamps))
    assert np.array_equal(again, stamps)
    assert SessionClock.load(clock.dump()) == clock


def test_now_is_now(tmp_path: Path) -> None:
    assert SessionClock.now().stamp(SessionClock.now().origin) > 1_700_000_000_000_000_000
