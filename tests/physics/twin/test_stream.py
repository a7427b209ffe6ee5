"""The twin as a stream: blocks, seeds, and changes on the way."""

from dataclasses import replace

import numpy as np
import pytest
from tests.physics.twin.built import FOAM, PLASTIC, SENSOR, key, moving, touch

from monochord.core.errors import InputError
from monochord.physics.twin import Outside, Pluck, Scene, Twin, advance, begin, hold, retouch, switch
from monochord.physics.twin.memory import HOLD

SLIDES = Scene(
    touches=(touch(key(0.0, 0.08, 0.8, 0.0, 0.05), key(0.05, 0.09, 1.5, 0.0, 0.05), rolls=False),),
    outside=Outside(samples=np.random.default_rng(2).uniform(-0.1, 0.1, 777).astype(np.float32)),
)


@pytest.mark.parametrize("finer", [1, 2])
def test_blocks_of_any_size_give_the_same_bits(finer: int) -> None:
    twin = begin(SENSOR, SLIDES, seed=3, finer=finer)
    whole, end = advance(twin, 2000)
    parts: list[np.ndarray] = []
    forces: list[np.ndarray] = []
    for size in (1, 31, 32, 33, 0, 500, 7, 1396):
        take, twin = advance(twin, size)
        parts.append(take.microphones)
        forces.append(take.labels.force)
    np.testing.assert_array_equal(np.concatenate(parts, axis=1), whole.microphones)
    np.testing.assert_array_equal(np.concatenate(forces, axis=1), whole.labels.force)
    for name, array in moving(end).items():
        np.testing.assert_array_equal(array, moving(twin)[name], err_msg=name)


def test_a_twin_is_a_value() -> None:
    twin = begin(SENSOR, SLIDES)
    before = {name: array.copy() for name, array in moving(twin).items()}
    first, again = advance(twin, 300)[0], advance(twin, 300)[0]
    np.testing.assert_array_equal(first.microphones, again.microphones)
    for name, array in moving(twin).items():
        np.testing.assert_array_equal(array, before[name])


def test_seeds_differ_in_noise_and_surfaces_only() -> None:
    plucked = Scene(pluck=Pluck(position=0.07, height=1e-4))
    one, other = (advance(begin(SENSOR, plucked, seed=seed), 2000) for seed in (1, 2))
    np.testing.assert_array_equal(moving(one[1])["bank"], moving(other[1])["bank"])
    apart = one[0].microphones - other[0].microphones
    assert apart.std() == pytest.approx(2.0**0.5 * SENSOR.pickups.hiss, rel=0.1)
    rubbed = [advance(begin(SENSOR, SLIDES, seed=seed), 2000)[1] for seed in (1, 2)]
    assert not np.array_equal(moving(rubbed[0])["bank"], moving(rubbed[1])["bank"])


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


def test_rates_that_cannot_be_are_refused() -> None:
    for rate in (8000, 400000):
        with pytest.raises(InputError, match="sample rate"):
            begin(SENSOR, sample_rate=rate)
    assert begin(replace(SENSOR, drift=1.0), sample_rate=48000).sample_rate == 48000


def test_force_is_the_reaction_averaged() -> None:
    twin = begin(SENSOR, Scene(touches=(hold(0.08, 1.0, PLASTIC),)))
    labels = advance(twin, 6000)[0].labels
    steps = twin.plan.finer
    assert steps == 1
    mean, told = 0.0, np.zeros(6000)
    for i, load in enumerate(labels.reaction[0].astype(float)):
        mean += (load - mean) / (HOLD * twin.sample_rate)
        told[i] = mean
    np.testing.assert_allclose(labels.force[0], told * labels.contact[0], rtol=1e-5, atol=1e-7)
    assert labels.reaction[0, 4000:].std() > 0.01  # the string's vibration is in it
