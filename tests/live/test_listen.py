"""What `mc.listen` yields, from each kind of source."""

import asyncio
import copy
import math
import pickle
import re
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
import soundfile
from tests.twins import sound_of

import monochord as mc
from monochord.core.errors import InputError
from monochord.live.update import Update

RATE = 44100


@pytest.fixture(scope="module")
def sound() -> np.ndarray:
    """Half a second of silence of the hand, then a press of 1 N at 80 mm for a second."""
    twin = mc.VirtualSensor("prototype", seed=1)
    return sound_of(twin, 0.5, (0.08, 1.0), 1.0, material="plastic")[0]


@pytest.fixture(scope="module")
def updates(sound: np.ndarray) -> list[Update]:
    return list(mc.listen(sound, sample_rate=RATE, sensor="prototype"))


def test_an_array_gives_what_its_file_gives(sound: np.ndarray, updates: list[Update], tmp_path: Path) -> None:
    soundfile.write(tmp_path / "take.wav", sound.T, RATE, subtype="FLOAT")
    of_file = list(mc.listen(tmp_path / "take.wav", sensor="prototype"))
    assert len(updates) == len(of_file) == 141
    assert repr([each.estimates for each in updates]) == repr([each.estimates for each in of_file])
    assert updates[-1].truth == {}
    assert updates[-1].health.frames == sound.shape[1]


def test_an_array_may_be_of_one_microphone_and_of_any_float(sound: np.ndarray) -> None:
    one = list(mc.listen(sound[0].astype(np.float64), "closed_form", sample_rate=RATE, string="prototype"))
    assert len(one) == 141
    assert one[0].window.samples.shape == (1, 4410)
    cut = list(mc.listen(sound[:, ::2], "closed_form", sample_rate=RATE // 2, string="prototype"))
    assert cut[1].start == 220  # the hop is 10 ms, to the nearest frame


@pytest.mark.parametrize(
    ("given", "options", "named"),
    [
        (np.zeros((2, 9000)), {}, "sample_rate"),
        (np.zeros((9000, 2)), {"sample_rate": RATE}, "transpose"),
        (np.zeros((2, 0)), {"sample_rate": RATE}, "(2, 0)"),
        (np.zeros((2, 9000), np.int16), {"sample_rate": RATE}, "int16"),
        (np.zeros((2, 9000)), {"sample_rate": 8000}, "8000"),
        (np.zeros((2, 9000)), {"sample_rate": math.nan}, "nan"),
        (np.zeros((2, 9000)), {"sample_rate": RATE, "speed": 1.0}, "speed"),
        (mc.VirtualSensor("prototype"), {"sample_rate": RATE}, "sample_rate"),
        (object(), {"sample_rate": RATE}, "object"),
    ],
)
def test_what_cannot_be_listened_to_is_refused_in_one_line(
    given: object, options: dict[str, float], named: str
) -> None:
    with pytest.raises(InputError) as refused:
        next(mc.listen(given, **options))  # pyright: ignore[reportArgumentType]
    assert named in str(refused.value)
    assert "\n" not in str(refused.value)


def test_an_update_holds_what_the_loop_follows(updates: list[Update]) -> None:
    last = updates[-1]
    assert last.contact.value > 0.9
    assert last.position.value == pytest.approx(0.08, abs=1e-3)
    assert abs(float(last.force) - 1.0) < 2.5 * last.force.std < 1.5
    assert last.position is last.estimates["position"] is last.prediction.estimates["position"]
    assert last.tracked.position.value == pytest.approx(0.08, abs=1e-3)
    assert last.tracked.position is last.tracked["position"]
    assert {"contact", "slip", "position", "force"} >= set(last.tracked)
    assert last.decided == {"contact": True, "slip": False}
    assert (last.time, last.start, last.string, last.skipped) == (pytest.approx(1.4), 140 * 441, "", 0)
    assert 0.0 < last.latency < 1.0
    assert last.window.samples.shape == (2, 4410)
    begun = [(event.name, event.on) for each in updates for event in each.events]
    assert ("contact", True) in begun


def test_the_force_in_the_ideal_world_is_right(updates: list[Update]) -> None:
    assert float(updates[-1].force) == pytest.approx(1.0, abs=0.35)


def test_what_is_not_estimated_abstains_and_other_names_are_refused(sound: np.ndarray) -> None:
    update = next(mc.listen(sound, "tuning", sample_rate=RATE, sensor="prototype"))
    assert not update.force.valid
    assert math.isnan(float(update.force))
    assert str(update.force) == "no answer: not estimated"
    assert str(update.tracked.slip) == "no answer: not estimated"
    assert update.frequency is update.estimates["frequency"]
    for names in (update, update.tracked):
        with pytest.raises(AttributeError, match="no attribute or estimate 'postion'; estimates: "):
            _ = names.postion


def test_an_update_by_key_warns_and_is_the_same(updates: list[Update]) -> None:
    with pytest.warns(DeprecationWarning, match=r"use update\.position"):
        place = updates[-1]["position"]
    assert place is updates[-1].position
    with pytest.warns(DeprecationWarning, match="postion"), pytest.raises(KeyError, match="postion"):
        _ = updates[-1]["postion"]


def test_a_virtual_sensor_is_touched_between_updates() -> None:
    twin = mc.VirtualSensor("prototype", seed=1)
    times, places, slips, contacts = list[float](), list[float](), list[float](), list[float]()
    for number, update in enumerate(mc.listen(twin, seconds=2.5)):
        assert twin.time == pytest.approx(update.time + 0.1)  # nothing is simulated ahead
        if number == 50:
            twin.press(0.08, 1.0, material="plastic")
        if number == 120:
            twin.slide(0.4, along=0.05)
        if number == 180:
            twin.release()
        times.append(update.time)
        contacts.append(update.truth.get("contact", math.nan))
        slips.append(update.truth.get("slip", math.nan))
        if update.truth.get("settled", 0.0) == 1.0 and update.position.valid:
            places.append(update.position.value - update.truth["position"])
    assert times == pytest.approx(np.arange(241) * 0.01)
    assert twin.time == 2.5
    assert (contacts[40], contacts[100], contacts[-1]) == (0.0, 1.0, 0.0)
    assert (slips[110], slips[140]) == (0.0, 1.0)
    assert len(places) > 40
    assert np.median(np.abs(places)) < 1e-3


def test_a_virtual_sensor_has_no_end_and_can_be_listened_to_again() -> None:
    twin = mc.VirtualSensor("prototype", seed=1)
    assert len(list(islice(mc.listen(twin, "closed_form"), 20))) == 20
    assert twin.time == pytest.approx(0.29)
    first = next(mc.listen(twin, "closed_form"))
    assert (first.start, first.window.has_gap) == (0, False)


def test_sound_that_the_program_takes_itself_is_a_gap() -> None:
    twin = mc.VirtualSensor("prototype", seed=1)
    updates = mc.listen(twin, "closed_form", seconds=0.5)
    assert not next(updates).window.has_gap
    twin.advance(0.05)
    update = next(updates)
    assert update.window.has_gap
    assert update.health.dropped == round(0.05 * RATE)
    assert twin.time == pytest.approx(0.16)


def test_a_sensor_that_is_restored_is_a_gap_of_a_frame() -> None:
    twin = mc.VirtualSensor("prototype", seed=1)
    begun = twin.snapshot()
    updates = mc.listen(twin, "closed_form", seconds=0.5)
    *_, before = (next(updates) for _ in range(4))
    twin.restore(begun)
    update = next(updates)
    assert update.window.has_gap
    assert update.health.dropped == 1
    later = [each.time - before.time for each in (update, *updates)]
    assert later == sorted(later)
    assert later[0] > 0.0


def test_a_virtual_sensor_is_touched_from_asyncio() -> None:
    async def places() -> list[float]:
        twin, values = mc.VirtualSensor("prototype", seed=1), list[float]()
        async for update in mc.listen_async(twin, seconds=0.6):
            if update.start == 0:
                twin.press(0.08, 1.0, material="plastic")
            values.append(update.truth.get("position", math.nan))
        return values

    values = asyncio.run(places())
    assert len(values) == 51
    assert values[-1] == pytest.approx(0.08)


def test_an_update_tells_its_names_and_reads_as_a_line(sound: np.ndarray, updates: list[Update]) -> None:
    frequency = next(mc.listen(sound, "tuning", sample_rate=RATE, sensor="prototype"))
    assert {"frequency", "position", "tracked"} <= set(dir(frequency))
    line = str(updates[-1])
    assert line.startswith("1.40 s: contact ")
    assert re.search(r"position (79|80)\.\d \+- 0\.\d mm", line)


def test_an_update_is_copied_and_crosses_to_another_process(updates: list[Update]) -> None:
    last = updates[-1]
    for other in (copy.deepcopy(last), pickle.loads(pickle.dumps(last))):  # noqa: S301
        assert (other.prediction, other.tracked, other.health) == (last.prediction, last.tracked, last.health)
        assert (other.decided, other.events, other.truth) == (last.decided, last.events, last.truth)
