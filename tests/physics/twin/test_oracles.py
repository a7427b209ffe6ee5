"""The oracle of the twin's tests, `ode_string`, against closed forms."""

from math import sin
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipk
from tests.physics.twin import ode_string as ode
from tests.physics.twin.built import cents, frequency

from monochord.core.types import Floats, StringParams
from monochord.physics.theory import loaded_frequencies

LENGTH, DENSITY, TENSION = 0.65, 6.5e-4, 65.0
AT = 0.35 * LENGTH
SPEED = np.sqrt(TENSION / DENSITY)
BENDING = 1e-4 * TENSION * (LENGTH / np.pi) ** 2  # inharmonicity B = 1e-4


def string(**more: float) -> ode.Modes:
    return ode.hinged(count=20, length=LENGTH, density=DENSITY, tension=TENSION, **more)


def padded(amplitudes: Floats) -> Floats:
    return np.concatenate([amplitudes, np.zeros(20 - amplitudes.size)])


def test_a_free_stiff_string_sounds_its_partials() -> None:
    motion = ode.simulate(
        string(bending=BENDING), v=padded(0.1 / np.arange(1.0, 9.0)), seconds=0.12, rtol=1e-9
    )
    for n in range(1, 9):
        true = n * SPEED / (2.0 * LENGTH) * np.sqrt(1.0 + 1e-4 * n * n)
        for sound in motion.pickups:
            assert cents(frequency(sound, true), true) == pytest.approx(0.0, abs=2e-2)


def test_a_lossy_mode_decays_as_its_closed_solution() -> None:
    motion = ode.simulate(string(sigma0=6.0, sigma1=0.05), q=padded(1e-3 * np.eye(3)[2]), seconds=0.03)
    sigma = 6.0 + 0.05 * (3.0 * np.pi / LENGTH) ** 2
    omega = np.sqrt((3.0 * np.pi * SPEED / LENGTH) ** 2 - sigma**2)
    turned = omega * motion.time
    true = 1e-3 * np.exp(-sigma * motion.time) * (np.cos(turned) + sigma / omega * np.sin(turned))
    np.testing.assert_allclose(motion.q[2], true, atol=1e-11)


def test_a_stretched_mode_has_duffings_period() -> None:
    # q'' + w^2 q + EA pi^4 / (4 mu L^4) q^3 = 0, released at A, has the period 4 K(m) / sqrt(w^2 + e), where
    # e = EA pi^4 A^2 / (4 mu L^4) and m = e / (2 (w^2 + e)).
    stretch, amplitude = 2e4, 5e-3
    modes = string(stretch=stretch)
    extra = stretch * np.pi**4 * amplitude**2 / (4.0 * DENSITY * LENGTH**4)
    square = float(modes.omega[0]) ** 2 + extra
    true = float(np.sqrt(square) / (4.0 * ellipk(extra / (2.0 * square))))
    motion = ode.simulate(modes, q=padded(amplitude * np.eye(1)[0]), seconds=0.12, rtol=1e-10)
    assert cents(true, float(modes.omega[0]) / (2.0 * np.pi)) > 20.0
    assert cents(frequency(motion.pickups[0], true), true) == pytest.approx(0.0, abs=1e-2)


def test_energy_is_constant_through_a_rattle() -> None:
    modes = string(bending=BENDING, stretch=1e4)
    touch = ode.ModalTouch(
        shape=ode.shapes(modes, AT), k1=1e3, k2=1e5, residual=4e-5, surface=lambda _: -2e-4
    )
    start = padded(np.array([2e-3, 1e-3, 5e-4]))
    motion = ode.simulate(modes, touch=touch, q=start, seconds=0.03, max_step=4e-6)
    assert 0.05 < np.mean(motion.touch_force > 0.0) < 0.95
    stored = ode.energy(modes, touch, motion)
    np.testing.assert_allclose(stored, stored[0], rtol=1e-9)
    assert np.ptp(ode.energy(modes, None, motion)) > 0.01 * stored[0]


@pytest.mark.parametrize("residual", [True, False])
def test_a_string_on_a_spring_sounds_as_the_cotangents_say(*, residual: bool) -> None:
    # Bent by 2 N over a spring, and struck too softly to leave it. The static compliance of the modes beyond
    # the first 20 is short by (f / f_21)^2 at most; without it the string is too stiff.
    modes, force, k1 = string(), 2.0, 2e3
    phi = ode.shapes(modes, AT)
    q, rest = force * phi / (modes.mass * modes.omega**2), 0.0
    if residual:
        rest = ode.residual(length=LENGTH, tension=TENSION, x=AT)
    depth = float(phi @ q) + rest * force + force / k1
    touch = ode.ModalTouch(shape=phi, k1=k1, residual=rest, surface=lambda _: depth)
    strike = padded(5e-3 / np.arange(1.0, 7.0))
    motion = ode.simulate(modes, touch=touch, q=q, v=strike, seconds=0.12, rtol=1e-8)
    assert motion.touch_force.min() > 0.0
    sound = motion.pickups[0] - motion.pickups[0].mean()
    true = loaded_frequencies(StringParams(length=LENGTH, linear_density=DENSITY, tension=TENSION), AT, k1, 5)
    off = [cents(frequency(sound, f), f) for f in true]
    assert np.abs(off).max() < 0.25 if residual else off[0] > 2.0


def test_a_driven_mode_settles_where_its_drivers_balance_its_losses() -> None:
    # Harmonic balance: 2 m sigma V = sum of phi_drive F, F being tanh's first harmonic at V phi_sense. Left
    # out are the higher modes, which the force's harmonics drive.
    modes = string(bending=BENDING, sigma0=40.0, sigma1=0.02)
    turn = np.cos(np.linspace(0.0, np.pi, 2001)[:-1])
    coils = ((0.1, 0.13, 0.15), (0.52, 0.546, 0.003))

    def lacking(velocity: float) -> float:
        lost = 2.0 * modes.mass * float(modes.sigma[0]) * velocity
        for sense, drive, gain in coils:
            sensed = velocity * sin(np.pi * sense / LENGTH) * turn
            lost -= (
                sin(np.pi * drive / LENGTH)
                * 2.0
                * float(np.mean(0.02 * np.tanh(gain * sensed / 0.02) * turn))
            )
        return lost

    true: Any = brentq(lacking, 0.1, 10.0)
    ebows = [
        ode.ModalEBow(
            sense=ode.shapes(modes, sense),
            drive=ode.shapes(modes, drive),
            gain=gain,
            max_force=0.02,
            centre=float(modes.omega[0]) / (2.0 * np.pi),
            quality=5.0,
        )
        for sense, drive, gain in coils
    ]
    motion = ode.simulate(
        modes, ebows=ebows, q=padded(np.array([1e-4])), seconds=0.3, rtol=1e-6, max_step=1e-4
    )
    level = np.sqrt(np.mean(motion.v[0].reshape(-1, 2205) ** 2, axis=1))
    assert level[0] < 0.5 * level[-1]
    assert level[-1] == pytest.approx(level[-2], rel=0.01)
    assert level[-1] * 2.0**0.5 == pytest.approx(true, rel=0.02)


def test_residual_is_what_lies_beyond_the_first_modes() -> None:
    modes = string(bending=BENDING)
    whole = ode.residual(length=LENGTH, tension=TENSION, x=AT, count=0)
    assert whole == pytest.approx(AT * (LENGTH - AT) / (TENSION * LENGTH), rel=1e-4)
    first = float(np.sum(ode.shapes(modes, AT) ** 2 / (modes.mass * modes.omega**2)))
    stiff = [
        ode.residual(length=LENGTH, tension=TENSION, x=AT, bending=BENDING, count=count) for count in (0, 20)
    ]
    assert stiff[0] - stiff[1] == pytest.approx(first, rel=1e-9)
