"""The driver: its band, its limit and its saturation."""

from math import pi, tan

import numpy as np
import pytest

from monochord.physics.twin import ebow

RATE, CENTRE, QUALITY = 44100.0, 1500.0, 2.0


def parameters(gain: float, limit: float) -> np.ndarray:
    g, k = tan(pi * CENTRE / RATE), 1.0 / QUALITY
    return np.array([g, k, gain / limit, limit, 1.0 / (1.0 + g * (g + k))])


@pytest.mark.parametrize("frequency", [400.0, 1500.0, 4000.0])
def test_a_small_velocity_is_filtered_and_pushed_half_a_step_ahead(frequency: float) -> None:
    settings, memory = parameters(0.03, 10.0), np.array([0.0, 0.0, 0.0, 1.0])
    turn = 2.0 * pi * frequency / RATE
    found = np.array([ebow.drive(settings, memory, 1e-3 * np.cos(turn * n)) for n in range(8000)])
    s = 1j * np.tan(turn / 2.0) / np.tan(pi * CENTRE / RATE)
    band = s / QUALITY / (s * s + s / QUALITY + 1.0)
    true = 3e-5 * band * (1.5 - 0.5 * np.exp(-1j * turn)) * np.exp(1j * turn * np.arange(8000))
    np.testing.assert_allclose(found[-2000:], true.real[-2000:], atol=1e-9)


def test_force_stays_within_the_limit_and_the_switch() -> None:
    settings = parameters(5.0, 0.02)
    for gate in (0.0, 0.5, 1.0):
        memory = np.array([0.0, 0.0, 0.0, gate])
        forces = [ebow.drive(settings, memory, 3.0 * np.cos(0.21 * n)) for n in range(500)]
        assert np.abs(forces).max() <= gate * 0.02 * (1.0 + 2e-4)
        assert np.abs(forces).max() >= gate * 0.0199


def test_saturation_is_the_hyperbolic_tangent() -> None:
    x = np.linspace(-8.0, 8.0, 401)
    np.testing.assert_allclose([ebow.saturated(v) for v in x], np.tanh(x), atol=2e-6)
    assert abs(ebow.saturated(1e9) - 1.0) < 1e-3
