"""Twins that sound at once are what each would be alone, bit for bit."""

from dataclasses import replace

import numpy as np
import pytest
from tests.physics.twin.built import FOAM, PLASTIC, SENSOR, key, touch

from monochord.physics.twin import Outside, Pluck, Scene, Take, Twin, advance, begin, hold
from monochord.physics.twin.many import advance_many

FRAMES = 700
PLUCK = Pluck(position=0.07, height=1e-4)
ROOM = Outside(samples=np.random.default_rng(0).normal(0.0, 0.01, 300).astype(np.float32))
SLIDE = touch(*(key(0.005 * i, 0.07 + 1e-3 * (i % 2), 1.0) for i in range(5)), rolls=False)
SCENES = {
    "free": Scene(pluck=PLUCK),
    "pressed": Scene(pluck=PLUCK, touches=(hold(0.08, 1.0, PLASTIC),)),
    "pressed elsewhere": Scene(pluck=PLUCK, touches=(hold(0.11, 0.3, FOAM, across=0.02),)),
    "more keys": Scene(pluck=PLUCK, touches=(SLIDE,)),
    "two touches": Scene(touches=(hold(0.06, 1.0, PLASTIC), hold(0.12, 0.5, FOAM))),
    "noisy": Scene(outside=ROOM),
    "drivers off, other law": Scene(pluck=PLUCK, drivers=(False, False), tension_law="linear"),
}


def bits(take: Take, twin: Twin) -> list[bytes]:
    labels = (getattr(take.labels, name) for name in type(take.labels).__slots__)
    return [array.tobytes() for array in (take.microphones, *labels, *twin.moving)]


def assert_as_alone(twins: list[Twin], frames: int = FRAMES, cores: int | None = None) -> None:
    together = advance_many(twins, frames, cores=cores)
    assert len(together) == len(twins)
    for before, (take, after) in zip(twins, together, strict=True):
        alone, twin = advance(before, frames)
        assert bits(take, after) == bits(alone, twin)
        assert take.microphones.shape == (2, frames)
        assert take.labels.force.shape == (len(before.scene.touches), frames)
        assert (after.start, after.sensor, after.scene) == (twin.start, twin.sensor, twin.scene)


@pytest.mark.parametrize("cores", [1, 2, 5, None])
def test_each_is_what_it_would_be_alone(cores: int | None) -> None:
    twins = [begin(SENSOR, SCENES["pressed"], seed=seed) for seed in range(9)]
    assert_as_alone(twins, cores=cores)
    assert len({take.microphones.tobytes() for take, _ in advance_many(twins, FRAMES)}) == 9


def test_different_shapes_go_in_one_call_and_come_back_in_order() -> None:
    twins = [begin(SENSOR, scene, seed=i) for i, scene in enumerate((*SCENES.values(), *SCENES.values()))]
    assert_as_alone(twins)


def test_other_strings_and_rates_go_along() -> None:
    thick = replace(SENSOR, string=replace(SENSOR.string, tension=40.0))
    plans = ((SENSOR, 44100), (thick, 44100), (SENSOR, 48000))
    assert_as_alone([begin(sensor, SCENES["pressed"], sample_rate=rate) for sensor, rate in plans])


def test_twins_at_different_instants_go_on_from_their_own() -> None:
    late = advance(begin(SENSOR, SCENES["more keys"]), 333)[1]
    first, second = (after for _, after in advance_many([begin(SENSOR, SCENES["more keys"]), late], 100))
    assert (first.start, second.start) == (100, 433)
    assert_as_alone([late, begin(SENSOR, SCENES["more keys"])])


def test_two_stretches_are_as_good_as_one() -> None:
    twins = [begin(SENSOR, scene) for scene in (SCENES["pressed"], SCENES["pressed elsewhere"])]
    whole = advance_many(twins, FRAMES)
    first = advance_many(twins, 123)
    second = advance_many([twin for _, twin in first], FRAMES - 123)
    for i, (take, _) in enumerate(whole):
        pieces = (first[i][0].microphones, second[i][0].microphones)
        assert np.array_equal(np.concatenate(pieces, axis=1), take.microphones)


def test_the_twins_that_go_in_stay_as_they_are() -> None:
    twins = [begin(SENSOR, scene) for scene in SCENES.values()]
    before = [[array.tobytes() for array in (*twin.fixed, *twin.moving)] for twin in twins]
    advance_many(twins, FRAMES)
    assert [[array.tobytes() for array in (*twin.fixed, *twin.moving)] for twin in twins] == before


def test_no_frames_change_nothing_and_no_twins_give_none() -> None:
    twins = [begin(SENSOR, scene) for scene in SCENES.values()]
    assert_as_alone(twins, frames=0)
    for before, (_, after) in zip(twins, advance_many(twins, 0), strict=True):
        assert after.start == 0
        assert [a.tobytes() for a in after.moving] == [a.tobytes() for a in before.moving]
    assert advance_many([], FRAMES) == []
