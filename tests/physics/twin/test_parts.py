"""The parts of the kernel, each by itself: contact, friction, surface, motion, driver, microphones."""

from math import pi, tan
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from tests.physics.twin.built import RATE, SENSOR, STRING, inside

from monochord.physics.theory import geometric_tension, stretch_stiffness
from monochord.physics.twin import begin, contact, electronics, friction, kernel, roughness
from monochord.physics.twin.records import (
    DriverParameters,
    DriverState,
    KeyRecord,
    LayerParameters,
    Motion,
    PreampState,
    dtype_of,
)

K2, RESIDUAL, COMPLIANCE = 1.3e8, 4e-6, 5e-5


def record(kind: type, *values: float) -> Any:
    return np.array([values or (0.0,) * len(dtype_of(kind).names or ())], dtype_of(kind))[0]


@pytest.mark.parametrize("gap", [1e-9, 1e-7, 2e-6, 5e-5])
@pytest.mark.parametrize("start", [1e-6, 3e-4, 5e-3])
def test_first_contact_solves_its_equation(gap: float, start: float) -> None:
    def error(s: float) -> float:
        eta = contact.approach(s, 0.0, K2, RESIDUAL)
        return eta + COMPLIANCE * contact.stored_energy(s, 0.0, K2, RESIDUAL) / (eta + 1e-5) - gap

    true = brentq(error, 1e-12, np.sqrt(gap), xtol=1e-18)
    s, eta, force = contact.solve(gap, COMPLIANCE, start, 0.0, -1e-5, 0.0, K2, RESIDUAL, 0.0)
    assert s == pytest.approx(true, rel=1e-7)  # where the iteration ends; it starts far off here
    assert eta + COMPLIANCE * force == pytest.approx(gap, rel=1e-7)


@pytest.mark.parametrize("beta", [0.0, 3e4])
def test_a_contact_returns_the_energy_that_it_stored_or_less(beta: float) -> None:
    s, eta = 0.0, -1e-6
    for gap in np.random.default_rng(3).uniform(-2e-5, 6e-5, 300):
        before, stored = eta, contact.stored_energy(s, 0.0, K2, RESIDUAL)
        s, eta, force = contact.solve(gap, COMPLIANCE, max(s, 1e-4), s, eta, 0.0, K2, RESIDUAL, beta)
        rise = contact.stored_energy(s, 0.0, K2, RESIDUAL) - stored
        assert force >= 0.0
        if beta == 0.0:
            assert force * (eta - before) == pytest.approx(rise, rel=1e-5, abs=1e-14)
        assert force * (eta - before) >= rise - 1e-5 * abs(rise) - 1e-14


def test_static_press_and_no_contact() -> None:
    s = contact.static_root(2.0, 1e4, K2)
    assert contact.elastic_force(s, 1e4, K2) == pytest.approx(2.0, rel=1e-12)
    assert contact.static_root(0.0, 1e4, K2) == 0.0
    free = contact.solve(-1e-6, COMPLIANCE, 0.0, 0.0, -1.0, 0.0, K2, RESIDUAL, 0.0)
    assert free == (0.0, -1e-6, 0.0)


def test_friction_falls_from_static_to_kinetic() -> None:
    assert friction.friction_coefficient(0.0, 0.4, 0.3, 0.01) == pytest.approx(0.4)
    assert friction.friction_coefficient(1.0, 0.4, 0.3, 0.01) == pytest.approx(0.3)
    assert [friction.sliding_share(z, 1.0) for z in (0.69, -1.0)] == [0.0, 1.0]
    assert 0.0 < friction.sliding_share(0.85, 1.0) < 1.0


def test_a_mark_follows_beyond_its_play_only() -> None:
    assert friction.play(1e-3, 5e-4, 5e-4, 0.0, 0.0) == (0.0, 0.0)
    assert friction.play(1e-3, 3e-3, 0.0, 0.0, 0.0) == pytest.approx((2e-3, 0.0))


def test_heights_have_unit_rms_no_steps_and_seeds_of_their_own() -> None:
    places = np.random.default_rng(2).uniform(-1e4, 1e4, (6000, 2))
    heights = np.array([roughness.height(3, x, y) for x, y in places])
    assert np.sqrt(np.mean(heights**2)) == pytest.approx(1.0, abs=0.06)
    near = np.array([roughness.height(3, x + 1e-5, y) for x, y in places[:500]])
    assert np.abs(near - heights[:500]).max() < 1e-3
    assert roughness.height(3, *places[0]) == heights[0] != roughness.height(19, *places[0])
    for zoom in (1.0, 0.5, 2.0):  # octaves of neighbouring seeds are no copies of each other
        other = [roughness.height(4, zoom * x, zoom * y) for x, y in places]
        assert abs(np.corrcoef(heights, other)[0, 1]) < 0.06
    apart = [roughness.height(3, x + 3.0, y) for x, y in places]  # and a surface forgets within some lengths
    assert abs(np.corrcoef(heights, apart)[0, 1]) < 0.1
    seeds = {int(roughness.surface_seed(seed, touch)) for seed in range(40) for touch in range(8)}
    assert len(seeds) == 320


@pytest.mark.parametrize(("time", "share"), [(0.0, 0.0), (0.1, 0.0), (0.2, 0.5), (9.0, 1.0)])
def test_motion_is_linear_between_keys_and_constant_outside(time: float, share: float) -> None:
    rows = [(0.1, 0.05, 0.0, 1e-3, 0.0), (0.3, 0.07, 2.0, 0.0, 0.1), (0.0,) * 5]
    motion = record(Motion, 7.0, 7.0, 7.0, 7.0, 7.0)
    kernel.read_motion(np.array(rows, dtype_of(KeyRecord)), 2, time, motion)
    true = (1.0 - share) * np.array(rows[0][1:]) + share * np.array(rows[1][1:])
    np.testing.assert_allclose(list(motion)[:4], true, rtol=1e-12, atol=1e-15)
    assert motion.depth == 7.0


def test_statics_are_those_of_theory() -> None:
    deep = kernel.surface_depth(2.0, 1e4, 0.0, 3e-4, 1e-5, 0.0)
    assert deep == pytest.approx(2.0 / 1e4 + 2.0 * 3e-4 + 1e-5)
    assert kernel.cross_compliance(0.05, 0.08, 0.2, 65.0) == pytest.approx(0.05 * 0.12 / (65.0 * 0.2))
    assert kernel.interpolated(np.array([0.0, 1.0, 4.0]), 0.75) == pytest.approx(2.5)
    for force in (0.1, 1.0, 10.0):
        rise = kernel.geometric_rise(force, 0.08, STRING.length, STRING.tension, stretch_stiffness(STRING))
        assert rise == pytest.approx(geometric_tension(STRING, 0.08, force) - STRING.tension, rel=1e-6)
    assert kernel.drifted(1.0, 0.5, 4.0, 65.0) == pytest.approx(3.0)
    assert kernel.drifted(-0.13, -0.567, 20.0, 5.15) == pytest.approx(-0.25 * 5.15)


def driver(gain: float, limit: float) -> Any:
    g, k = tan(pi * 1500.0 / RATE), 0.5
    return record(DriverParameters, g, k, gain / limit, limit, 1.0 / (1.0 + g * (g + k)), 1.0)


@pytest.mark.parametrize("frequency", [400.0, 1500.0, 4000.0])
def test_a_small_velocity_is_filtered_and_pushes_half_a_step_ahead(frequency: float) -> None:
    memory = record(DriverState, 0.0, 0.0, 0.0, 1.0)
    turn = 2.0 * pi * frequency / RATE
    forces = np.array(
        [electronics.drive(driver(0.03, 10.0), memory, 1e-3 * np.cos(turn * n)) for n in range(8000)]
    )
    s = 1j * np.tan(turn / 2.0) / np.tan(pi * 1500.0 / RATE)
    band = 0.5 * s / (s * s + 0.5 * s + 1.0)
    true = 3e-5 * band * (1.5 - 0.5 * np.exp(-1j * turn)) * np.exp(1j * turn * np.arange(8000))
    np.testing.assert_allclose(forces[-2000:], true.real[-2000:], atol=1e-9)


def test_a_driver_is_limited_by_a_hyperbolic_tangent_and_its_switch() -> None:
    for gate in (0.0, 0.5, 1.0):
        memory = record(DriverState, 0.0, 0.0, 0.0, gate)
        forces = [electronics.drive(driver(5.0, 0.02), memory, 3.0 * np.cos(0.21 * n)) for n in range(500)]
        assert gate * 0.0199 <= np.abs(forces).max() <= gate * 0.02 * (1.0 + 2e-4)
    x = np.linspace(-8.0, 8.0, 401)
    np.testing.assert_allclose([electronics.saturated(v) for v in x], np.tanh(x), atol=2e-6)
    assert abs(electronics.saturated(1e9) - 1.0) < 1e-3


def test_noise_is_close_to_normal_and_white() -> None:
    draws = np.array([electronics.normal_noise(7, 2 * i) for i in range(40000)])
    assert draws.mean() == pytest.approx(0.0, abs=0.02)
    assert draws.var() == pytest.approx(1.0, abs=0.03)
    assert np.mean(draws**4) == pytest.approx(3.0 - 1.2 / 8.0, abs=0.12)  # of eight uniform numbers
    near = np.array([electronics.normal_noise(8, 2 * i) for i in range(40000)])
    for other in (draws[1:], near[:-1]):
        assert np.mean(draws[:-1] * other) == pytest.approx(0.0, abs=0.02)


def test_microphones_mix_after_equation_5_and_preamplifiers_pass_their_band() -> None:
    settings = inside(begin(SENSOR), "pickup").copy()
    for frequency, low, high in ((5.0, 0.0, 0.2), (40.0, 0.69, 0.73), (2e3, 0.98, 1.01), (20500.0, 0.0, 0.2)):
        memory, turn = record(PreampState), 2.0 * pi * frequency / RATE
        sound = [electronics.amplified(settings, memory, np.sin(turn * n)) for n in range(30000)]
        assert low <= np.abs(sound[-12000:]).max() <= high
    settings["own_1"], settings["own_2"], settings["gain_1"], settings["gain_2"] = 0.8, 0.7, 2.0, 3.0
    first, second = electronics.mixed(settings, 1.0, 10.0, 0.0)
    assert first == pytest.approx(2.0 * (0.8 * 1.0 + 0.2 * 10.0))
    assert second == pytest.approx(3.0 * (0.3 * 1.0 + 0.7 * 10.0))
    assert [electronics.converted(v) for v in (-2.0, 0.3, 5.0)] == [-1.0, 0.3, 1.0]


def layer(thickness: float = 2e-6, load: float = 0.01) -> Any:
    return record(LayerParameters, thickness, load)


@pytest.mark.parametrize("gap", [1e-9, 1e-7, 2e-6, 5e-5])
def test_first_contact_with_a_rough_layer_solves_its_equation(gap: float) -> None:
    def error(s: float) -> float:
        eta = contact.approach(s, 1e4, K2, RESIDUAL, layer())
        return eta + COMPLIANCE * contact.stored_energy(s, 1e4, K2, RESIDUAL, layer()) / (eta + 1e-5) - gap

    true = brentq(error, 1e-12, np.sqrt(gap), xtol=1e-18)
    s, eta, force = contact.solve(gap, COMPLIANCE, 3e-4, 0.0, -1e-5, 1e4, K2, RESIDUAL, 0.0, layer())
    assert s == pytest.approx(true, rel=1e-7)
    assert eta + COMPLIANCE * force == pytest.approx(gap, rel=1e-7)


@pytest.mark.parametrize("beta", [0.0, 3e4])
@pytest.mark.parametrize("load", [1e-4, 0.01, 1.0])
def test_a_rough_layer_returns_the_energy_that_it_stored(beta: float, load: float) -> None:
    s, eta, own = 0.0, -1e-6, layer(load=load)
    for gap in np.random.default_rng(3).uniform(-2e-5, 6e-5, 300):
        before, stored = eta, contact.stored_energy(s, 0.0, K2, RESIDUAL, own)
        s, eta, force = contact.solve(gap, COMPLIANCE, max(s, 1e-4), s, eta, 0.0, K2, RESIDUAL, beta, own)
        rise = contact.stored_energy(s, 0.0, K2, RESIDUAL, own) - stored
        assert force >= 0.0
        if beta == 0.0:
            assert force * (eta - before) == pytest.approx(rise, rel=1e-5, abs=1e-14)
        assert force * (eta - before) >= rise - 1e-5 * abs(rise) - 1e-14


def test_a_rough_layer_stores_the_work_that_closes_it() -> None:
    forces = np.linspace(0.0, 2.0, 20001)
    closure = np.array([contact.layer_closure(force, layer()) for force in forces])
    work = np.sum(0.5 * (forces[1:] + forces[:-1]) * np.diff(closure))
    assert contact.layer_energy(2.0, layer()) == pytest.approx(work, rel=1e-6)
    slope = np.diff(closure[-2:])[0] / np.diff(forces[-2:])[0]
    assert contact.layer_compliance(2.0, layer()) == pytest.approx(slope, rel=1e-3)
