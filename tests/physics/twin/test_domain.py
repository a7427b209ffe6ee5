"""Over all that the twin allows it stays finite and bounded, and its labels keep their meaning."""

from dataclasses import replace

import numpy as np
import pytest
from tests.physics.twin import drawn
from tests.physics.twin.built import PLASTIC, SENSOR, modes

from monochord.core.errors import InputError
from monochord.physics.twin import Scene, Twin, advance, begin, hold
from monochord.physics.twin import records as layout
from monochord.physics.twin.rate import HALF_SIZES


def refuse_the_impossible(twin: Twin, seconds: float) -> None:
    length = twin.sensor.string.length
    for _ in range(4):
        take, twin = advance(twin, round(0.25 * seconds * twin.sample_rate))
        labels = take.labels
        assert np.isfinite(take.microphones).all()
        assert np.abs(take.microphones).max() <= 1.0
        for array in twin.state:  # of numbers, or of records that hold nothing else
            assert np.isfinite(array.view(np.float64)).all()
        assert np.abs(modes(twin)[layout.Q]).sum() < 10.0 * length
        for flags, most in ((labels.contact, 1), (labels.slip, 1), (labels.settled, 1), (labels.friction, 3)):
            assert flags.max(initial=0) <= most
        if twin.scene.touches:
            assert labels.position.min() > 0.0
            assert labels.position.max() < length
            assert labels.force.min() >= 0.0
            assert not (labels.slip > labels.contact).any()
        for speeds in (labels.force, labels.across, labels.along):
            assert np.isfinite(speeds).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_drawn_twin_stays_sound(seed: int) -> None:
    refuse_the_impossible(drawn.twin(seed, 0.3, halves=(16,)), 0.3)


@pytest.mark.parametrize("seed", range(4))
def test_a_drawn_plausible_twin_stays_sound(seed: int) -> None:
    refuse_the_impossible(drawn.plausible_twin(seed, 0.3, halves=(16,)), 0.3)


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("seed", range(1000, 1020))
def test_a_drawn_twin_stays_sound_for_long(seed: int) -> None:
    """Four of each size of bank, whatever their touches and rates; none is left out for its cost."""
    refuse_the_impossible(drawn.twin(seed, 20.0, halves=(HALF_SIZES[seed % len(HALF_SIZES)],)), 20.0)


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("seed", range(2000, 2020))
def test_a_drawn_plausible_twin_stays_sound_for_long(seed: int) -> None:
    refuse_the_impossible(
        drawn.plausible_twin(seed, 20.0, halves=(HALF_SIZES[seed % len(HALF_SIZES)],)), 20.0
    )


def test_a_string_too_fast_for_its_rate_is_refused() -> None:
    fast = replace(SENSOR.string, core_diameter=3e-3, linear_density=1e-3)
    with pytest.raises(InputError, match="too fast"):
        begin(replace(SENSOR, string=fast), sample_rate=16000, oversampling=1)


@pytest.mark.parametrize("place", [0.001, 0.199, -0.1])
def test_a_touch_off_the_string_is_refused(place: float) -> None:
    with pytest.raises(InputError, match="touch"):
        begin(SENSOR, Scene(touches=(hold(place, 1.0, PLASTIC),)))
