"""An outside sound at a ratio to the sensor's own."""

from dataclasses import replace

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.physics.sensors import load_sensor
from monochord.physics.twin import Scene, Sensor, advance, begin
from monochord.physics.twin.outside import outside_at, untouched_power

SENSOR = load_sensor("prototype")
NOISE = np.random.default_rng(0).standard_normal(44100).astype(np.float32)


@pytest.mark.parametrize("snr", [-10.0, 25.0])
def test_the_ratio_is_what_a_silent_string_lets_through(snr: float) -> None:
    """Drivers off and nothing plucked, only the air path is heard, within the preamplifier's band."""
    tone = np.sin(2.0 * np.pi * 1000.0 * np.arange(44100) / 44100).astype(np.float32)
    still = replace(SENSOR, shake=0.0, pickups=replace(SENSOR.pickups, hiss=0.0))
    power = untouched_power(still)
    outside = outside_at(0.01 * tone, snr, still)
    scene = Scene(drivers=(False, False), outside=replace(outside, level=0.01 * outside.level))
    heard = advance(begin(still, scene), 44100)[0].microphones[:, 4410:].astype(np.float64)
    # The sound was played 40 dB down, so that it cannot clip; 1 kHz passes the band within 1 %.
    assert power / (1e4 * np.mean(heard**2)) == pytest.approx(10.0 ** (snr / 10.0), rel=0.03)


def test_louder_samples_are_turned_down() -> None:
    assert outside_at(3.0 * NOISE, 10.0, SENSOR).level == pytest.approx(
        outside_at(NOISE, 10.0, SENSOR).level / 3.0, rel=1e-5
    )


DEAF = replace(SENSOR, pickups=replace(SENSOR.pickups, air=(0.0, 0.0)))
DEAD = replace(SENSOR, drivers=tuple(replace(driver, gain=0.0) for driver in SENSOR.drivers))


@pytest.mark.parametrize(
    ("samples", "snr", "sensor"),
    [
        (np.zeros(100, np.float32), 10.0, SENSOR),
        (np.ones((2, 100), np.float32), 10.0, SENSOR),
        (np.full(10, np.nan, np.float32), 10.0, SENSOR),
        (NOISE, np.inf, SENSOR),
        (NOISE, 0.0, DEAF),
        (NOISE, 0.0, DEAD),
    ],
    ids=[
        "silent",
        "stereo",
        "no numbers",
        "no noise",
        "microphones deaf to it",
        "a string that falls silent",
    ],
)
def test_what_has_no_ratio_is_refused(samples: Audio, snr: float, sensor: Sensor) -> None:
    with pytest.raises(InputError):
        outside_at(samples, snr, sensor)
