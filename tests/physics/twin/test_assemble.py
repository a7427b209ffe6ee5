"""What the field's terms become for the kernel."""

from dataclasses import replace

import numpy as np
import pytest
from tests.physics.twin.built import COILS, NONE, PLASTIC, SENSOR, fixed, modes

from monochord.core.errors import InputError
from monochord.physics.theory import Losses, decay_rates, hertz_stiffness, static_compliance
from monochord.physics.twin import Outside, Pluck, Scene, begin, hold
from monochord.physics.twin import bank as layout
from monochord.physics.twin.rate import mode_frequencies


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
    touch, table = fixed(twin)["touches"][0], fixed(twin)["tables"][0]
    string = SENSOR.string
    elastic = (PLASTIC.radius, PLASTIC.young_modulus, PLASTIC.poisson_ratio)
    assert touch[1] == pytest.approx(hertz_stiffness(string, *elastic))
    assert 0.97 < table[256] / static_compliance(string, 0.1) < 1.0  # a width gives way less than a point
    sigma = decay_rates(string, SENSOR.losses, mode_frequencies(string, twin.plan.count) / (2.0 * np.pi))
    np.testing.assert_allclose(modes(twin)[layout.SIGMA, : twin.plan.count], sigma)


def test_a_coil_is_as_wide_as_its_aperture() -> None:
    wide = replace(SENSOR, drivers=(replace(COILS[0], aperture=0.01, angle=0.0), COILS[1]))
    n = np.arange(1, 6)
    true = np.sin(n * np.pi * 0.02 / 0.2) * np.exp(-0.5 * (n * np.pi / 0.2 * 0.01) ** 2)
    np.testing.assert_allclose(modes(begin(wide))[layout.SENSE_1, :5], true)


def test_what_the_scheme_cannot_is_refused() -> None:
    with pytest.raises(InputError, match="modes that ring"):
        begin(replace(SENSOR, losses=replace(NONE, support=5.0)))
    with pytest.raises(InputError, match="a pluck at"):
        begin(SENSOR, Scene(pluck=Pluck(position=0.3, height=1e-3)))
    for samples in (np.zeros(0, np.float32), np.array([np.nan], np.float32), np.zeros((2, 3), np.float32)):
        with pytest.raises(InputError, match="outside sound"):
            begin(SENSOR, Scene(outside=Outside(samples=samples)))
    assert begin(replace(SENSOR, losses=Losses(support=0.01))).plan.finer >= 1
