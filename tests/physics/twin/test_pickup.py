"""From end forces to full scale: mixing, band, noise and clipping."""

import numpy as np
import pytest
from tests.physics.twin.built import RATE, SENSOR, fixed

from monochord.physics.twin import begin, pickup


def test_noise_has_the_moments_of_a_bell_and_no_memory() -> None:
    draws = np.array([pickup.bell(7, 2 * i) for i in range(40000)])
    assert draws.mean() == pytest.approx(0.0, abs=0.02)
    assert draws.var() == pytest.approx(1.0, abs=0.03)
    assert np.mean(draws**4) == pytest.approx(3.0 - 1.2 / 8.0, abs=0.12)  # of eight uniform numbers
    assert np.mean(draws[1:] * draws[:-1]) == pytest.approx(0.0, abs=0.02)
    near = np.array([pickup.bell(8, 2 * i) for i in range(40000)])
    assert np.mean(draws * near) == pytest.approx(0.0, abs=0.02)
    assert pickup.bell(7, 6) == draws[3]


def test_preamplifier_passes_its_band() -> None:
    settings = fixed(begin(SENSOR))["pickup"]
    for frequency, low, high in (
        (5.0, 0.0, 0.2),
        (40.0, 0.69, 0.73),
        (2000.0, 0.98, 1.01),
        (20500.0, 0.0, 0.2),
    ):
        memory = np.zeros(3)
        sound = [
            pickup.amplified(settings, memory, np.sin(2 * np.pi * frequency * n / RATE)) for n in range(30000)
        ]
        assert low <= np.abs(sound[-12000:]).max() <= high


def test_frame_mixes_as_equation_5_has_it() -> None:
    settings = fixed(begin(SENSOR))["pickup"].copy()
    settings[:4] = 0.8, 0.7, 2.0, 3.0
    first, second = pickup.mixed(settings, 1.0, 10.0, 0.0)
    assert first == pytest.approx(2.0 * (0.8 * 1.0 + 0.2 * 10.0))
    assert second == pytest.approx(3.0 * (0.3 * 1.0 + 0.7 * 10.0))


def test_converter_clips() -> None:
    assert [pickup.converted(v) for v in (-2.0, 0.3, 5.0)] == [-1.0, 0.3, 1.0]
