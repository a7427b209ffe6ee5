"""The twin as a stream: what it begins with, blocks, seeds, changes on the way, and many at once."""

from dataclasses import replace

import numpy as np
import pytest
from tests.physics.twin.built import COILS, FOAM, NONE, PLASTIC, SENSOR, inside, key, modes, planned, touch

from monochord.core.errors import InputError
from monochord.physics.theory import decay_rates, hertz_stiffness, static_compliance
from monochord.physics.twin import (
    Outside,
    Pluck,
    Scene,
    Take,
    Twin,
    advance,
    advance_many,
    begin,
    hold,
    retouch,
    switch,
)
from monochord.physics.twin import records as layout
from monochord.physics.twin.rate import mode_frequencies
from monochord.physics.twin.records import CONTACT_HOLD
from monochord.physics.twin.virtual_sensor import VirtualSensor

SLIDES = Scene(
    touches=(touch(key(0.0, 0.08, 0.8, 0.0, 0.05), key(0.05, 0.09, 1.5, 0.0, 0.05), rolls=False),),
    outside=Outside(samples=np.random.default_rng(2).uniform(-0.1, 0.1, 777).astype(np.float32)),
)


@pytest.mark.parametrize("finer", [1, 2])
def test_blocks_of_any_size_give_the_same_bits(finer: int, monkeypatch: pytest.MonkeyPatch) -> None:
    planned(monkeypatch, finer)
    twin = begin(SENSOR, SLIDES, seed=3)
    whole, end = advance(twin, 2000)
    parts: list[np.ndarray] = []
    forces: list[np.ndarray] = []
    for size in (1, 31, 32, 33, 0, 500, 7, 1396):
        take, twin = advance(twin, size)
        parts.append(take.microphones)
        forces.append(take.labels.force)
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), whole.microphones)
    np.testing.assert_array_equal(np.concatenate(forces, axis=1), whole.labels.force)
    assert [a.tobytes() for a in end.state] == [a.tobytes() for a in twin.state]


def test_a_twin_is_a_value() -> None:
    twin = begin(SENSOR, SLIDES)
    before = [array.tobytes() for array in twin.state]
    first, again = advance(twin, 300)[0], advance(twin, 300)[0]
    np.testing.assert_array_equal(first.microphones, again.microphones)
    assert [array.tobytes() for array in twin.state] == before


def test_seeds_differ_in_noise_and_surfaces_only() -> None:
    plucked = Scene(pluck=Pluck(position=0.07, height=1e-4))
    one, other = (advance(begin(SENSOR, plucked, seed=seed), 2000) for seed in (1, 2))
    np.testing.assert_array_equal(inside(one[1], "bank"), inside(other[1], "bank"))
    apart = one[0].microphones - other[0].microphones
    assert apart.std() == pytest.approx(2.0**0.5 * SENSOR.pickups.hiss, rel=0.1)
    rubbed = [advance(begin(SENSOR, SLIDES, seed=seed), 2000)[1] for seed in (1, 2)]
    assert not np.array_equal(inside(rubbed[0], "bank"), inside(rubbed[1], "bank"))


def test_retouch_keeps_the_string_and_lets_objects_come_and_go() -> None:
    twin = advance(begin(SENSOR, Scene(touches=(hold(0.08, 1.0, PLASTIC),))), 5000)[1]
    same = retouch(twin, twin.scene.touches)
    np.testing.assert_array_equal(advance(same, 500)[0].microphones, advance(twin, 500)[0].microphones)
    two = advance(retouch(twin, (*twin.scene.touches, hold(0.12, 0.5, FOAM))), 4000)[0]
    assert two.labels.contact[:, -1].tolist() == [1, 1]
    assert two.labels.settled[:500].max() == 0
    none = advance(retouch(twin, ()), 100)[0]
    assert none.labels.contact.shape == (0, 100)
    assert np.abs(none.microphones).max() > 0.0


def test_switch_lets_the_string_ring_out() -> None:
    twin = advance(begin(SENSOR, Scene(pluck=Pluck(position=0.07, height=1e-4))), 20000)[1]

    def loud(twin: Twin) -> float:
        return float(np.abs(advance(twin, 40000)[0].microphones[:, -2000:]).max())

    assert loud(switch(twin, (False, False))) < 0.2 * loud(twin)


def test_labels_tell_what_is_asked_and_what_is() -> None:
    approach = touch(key(0.0, 0.07, 0.0, 2e-3), key(0.05, 0.07, 1.0), key(0.3, 0.09, 1.0))
    labels = advance(begin(SENSOR, Scene(touches=(approach,), drivers=(False, False))), 22050)[0].labels
    assert labels.contact[0, 100] == 0
    assert labels.contact[0, -1] == 1
    assert labels.position[0, -1] == pytest.approx(0.09)
    assert labels.force[0, -2000:].mean() == pytest.approx(1.0, rel=0.05)
    assert labels.settled[5000] == 0


def test_labels_of_two_objects_are_those_of_the_one_that_presses_hardest() -> None:
    twin = VirtualSensor("prototype", seed=1)
    twin.press(0.06, 0.3)
    twin.press(0.12, 1.5)
    labels = twin.advance(0.2)[1]
    assert labels["contacts"][-1] == 2.0
    assert labels["position"][-1] == pytest.approx(0.12)
    assert labels["force"][-2000:].mean() == pytest.approx(1.5, rel=0.05)


def test_rates_that_cannot_be_are_refused() -> None:
    for rate in (8000, 400000):
        with pytest.raises(InputError, match="sample rate"):
            begin(SENSOR, sample_rate=rate)


def test_force_is_the_reaction_averaged() -> None:
    twin = begin(SENSOR, Scene(touches=(hold(0.08, 1.0, PLASTIC),)))
    labels = advance(twin, 6000)[0].labels
    steps = twin.plan.oversampling
    assert steps == 1
    mean, told = 0.0, np.zeros(6000)
    for i, load in enumerate(labels.reaction[0].astype(float)):
        mean += (load - mean) / (CONTACT_HOLD * twin.sample_rate)
        told[i] = mean
    np.testing.assert_allclose(labels.force[0], told * labels.contact[0], rtol=1e-5, atol=1e-7)
    assert labels.reaction[0, 4000:].std() > 0.01  # the string's vibration is in it


def test_a_pluck_is_a_triangle() -> None:
    twin = begin(SENSOR, Scene(pluck=Pluck(position=0.07, height=1e-3, angle=0.3)))
    half = modes(twin).shape[1] // 2
    q = modes(twin)[layout.Q]
    n = np.arange(1, half + 1)
    for x in (0.03, 0.15):
        true = 1e-3 * min(x / 0.07, (0.2 - x) / 0.13)
        shape = np.sin(n * np.pi * x / 0.2)
        assert shape @ q[:half] == pytest.approx(true * np.cos(0.3), rel=0.03)
        assert shape @ q[half:] == pytest.approx(true * np.sin(0.3), rel=0.03)


def test_touch_has_its_theory() -> None:
    twin = begin(SENSOR, Scene(touches=(hold(0.08, 1.0, PLASTIC),)))
    touch, table = inside(twin, "touches")[0], inside(twin, "compliance")[0]
    string = SENSOR.string
    elastic = (PLASTIC.radius, PLASTIC.young_modulus, PLASTIC.poisson_ratio)
    assert touch.k2 == pytest.approx(hertz_stiffness(string, *elastic))
    assert 0.97 < table[256] / static_compliance(string, 0.1) < 1.0  # a width gives way less than a point
    sigma = decay_rates(string, SENSOR.losses, mode_frequencies(string, twin.plan.count) / (2.0 * np.pi))
    np.testing.assert_allclose(modes(twin)[layout.DECAY, : twin.plan.count], sigma)


def test_a_coil_is_as_wide_as_its_aperture() -> None:
    wide = replace(SENSOR, drivers=(replace(COILS[0], aperture=0.01, angle=0.0), COILS[1]))
    n = np.arange(1, 6)
    true = np.sin(n * np.pi * 0.02 / 0.2) * np.exp(-0.5 * (n * np.pi / 0.2 * 0.01) ** 2)
    np.testing.assert_allclose(modes(begin(wide))[layout.SENSE_1, :5], true)


def test_what_the_scheme_cannot_is_refused() -> None:
    with pytest.raises(InputError, match="modes"):
        begin(replace(SENSOR, losses=replace(NONE, support=5.0)))
    with pytest.raises(InputError, match="pluck"):
        begin(SENSOR, Scene(pluck=Pluck(position=0.3, height=1e-3)))
    for samples in (np.zeros(0, np.float32), np.array([np.nan], np.float32), np.zeros((2, 3), np.float32)):
        with pytest.raises(InputError, match="outside"):
            begin(SENSOR, Scene(outside=Outside(samples=samples)))


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
    return [array.tobytes() for array in (take.microphones, *labels, *twin.state)]


def assert_as_alone(twins: list[Twin], frames: int = FRAMES, cores: int | None = None) -> None:
    together = advance_many(twins, frames, cores=cores)
    assert len(together) == len(twins)
    for before, (take, after) in zip(twins, together, strict=True):
        alone, twin = advance(before, frames)
        assert bits(take, after) == bits(alone, twin)
        assert take.microphones.shape == (2, frames)
        assert take.labels.force.shape == (len(before.scene.touches), frames)
        assert (after.start, after.sensor, after.scene) == (twin.start, twin.sensor, twin.scene)


@pytest.mark.parametrize("cores", [1, 5, None])
def test_each_is_what_it_would_be_alone(cores: int | None) -> None:
    twins = [begin(SENSOR, SCENES["pressed"], seed=seed) for seed in range(9)]
    assert_as_alone(twins, cores=cores)
    assert len({take.microphones.tobytes() for take, _ in advance_many(twins, FRAMES)}) == 9


def test_different_shapes_go_in_one_call_and_come_back_in_order() -> None:
    twins = [begin(SENSOR, scene, seed=i) for i, scene in enumerate((*SCENES.values(), *SCENES.values()))]
    assert_as_alone(twins)


@pytest.mark.parametrize("tension", [60.0, pytest.param(40.0, marks=pytest.mark.slow)])
def test_other_strings_and_rates_go_along(tension: float) -> None:
    """The slow one has more modes: their kernel takes long to compile."""
    thick = replace(SENSOR, string=replace(SENSOR.string, tension=tension))
    plans = ((SENSOR, 44100), (thick, 44100), (SENSOR, 48000))
    assert_as_alone([begin(sensor, SCENES["pressed"], sample_rate=rate) for sensor, rate in plans])


def test_twins_at_different_instants_go_on_from_their_own() -> None:
    late = advance(begin(SENSOR, SCENES["more keys"]), 333)[1]
    first, second = (after for _, after in advance_many([begin(SENSOR, SCENES["more keys"]), late], 100))
    assert (first.start, second.start) == (100, 433)
    assert_as_alone([late, begin(SENSOR, SCENES["more keys"])])


def test_the_twins_that_go_in_stay_as_they_are() -> None:
    twins = [begin(SENSOR, scene) for scene in SCENES.values()]
    before = [[array.tobytes() for array in (*twin.parameters, *twin.state)] for twin in twins]
    advance_many(twins, FRAMES)
    assert [[array.tobytes() for array in (*twin.parameters, *twin.state)] for twin in twins] == before


def test_no_frames_and_no_twins_give_none() -> None:
    assert_as_alone([begin(SENSOR, scene) for scene in SCENES.values()], frames=0)
    assert advance_many([], FRAMES) == []


def test_a_steady_sound_is_settled_until_a_touch_changes() -> None:
    twin = begin(SENSOR, Scene(pluck=Pluck(position=0.07, height=1e-4)))
    take, twin = advance(twin, 3 * 44100)
    assert take.labels.settled[0] == 0
    assert take.labels.settled[-1] == 1
    after = advance(retouch(twin, (hold(0.08, 1.0, PLASTIC),)), 400)[0]
    assert after.labels.settled[-1] == 0


def test_a_moving_touch_is_not_settled() -> None:
    rolls = touch(key(0.0, 0.08, 1.0), key(2.0, 0.1, 1.0))
    labels = advance(begin(SENSOR, Scene(touches=(rolls,))), 44100)[0].labels
    assert labels.settled.max() == 0


def test_a_string_at_rest_gives_hiss_alone_normal_white_and_by_its_seed() -> None:
    hiss = SENSOR.pickups.hiss
    one, other = (
        advance(begin(SENSOR, Scene(drivers=(False, False)), seed=seed), 40000)[0].microphones / hiss
        for seed in (7, 8)
    )
    assert one.mean() == pytest.approx(0.0, abs=0.02)
    assert one.std(axis=1) == pytest.approx([1.0, 1.0], rel=0.03)
    assert np.mean(one**4) == pytest.approx(3.0 - 1.2 / 8.0, abs=0.12)  # of eight uniform numbers
    for partner in (one[1, :-1], one[0, 1:], other[0, :-1], other[0, 1:]):
        assert np.mean(one[0, :-1] * partner) == pytest.approx(0.0, abs=0.02)
