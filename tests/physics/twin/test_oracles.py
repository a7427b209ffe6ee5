"""The two oracles against closed forms, and against each other."""

from math import cos, sin
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar
from scipy.special import ellipk
from tests.physics.twin import fdtd_string as grid
from tests.physics.twin import ode_string as ode

from monochord.core.types import Floats

RATE = 44100.0
LENGTH, DENSITY, TENSION = 0.65, 6.5e-4, 65.0
AT = 0.35 * LENGTH  # a node of 100 and of 200 segments
SPEED = np.sqrt(TENSION / DENSITY)
BENDING = 1e-4 * TENSION * (LENGTH / np.pi) ** 2  # inharmonicity B = 1e-4
Both = tuple[grid.GridMotion, ode.ModalMotion]


def both(
    *, bending: float = 0.0, stretch: float = 0.0, sigma0: float = 0.0, sigma1: float = 0.0, count: int = 20
) -> tuple[grid.GridString, ode.Modes]:
    """The same string for either oracle."""
    more = {"bending": bending, "stretch": stretch, "sigma0": sigma0, "sigma1": sigma1}
    string = grid.GridString(length=LENGTH, density=DENSITY, tension=TENSION, **more)
    return string, ode.hinged(count=count, length=LENGTH, density=DENSITY, tension=TENSION, **more)


def sines(amplitudes: Floats) -> grid.Curve:
    """The sum of the first modes with these amplitudes, over x."""
    wave = np.pi * np.arange(1.0, amplitudes.size + 1.0) / LENGTH
    return lambda x: amplitudes @ np.sin(np.outer(wave, x))


def kept(amplitudes: Floats, count: int = 20) -> Floats:
    """The same for the modes."""
    return np.concatenate([amplitudes, np.zeros(count - amplitudes.size)])


def cents(found: float, true: float) -> float:
    return 1200.0 * float(np.log2(found / true))


def partial(sound: Floats, near: float, within: float = 20.0) -> float:
    """The frequency in Hz near one that is given where a windowed sound's spectrum is largest."""
    turn = -2j * np.pi * np.arange(sound.size) / RATE
    windowed = np.blackman(sound.size) * (sound - sound.mean())

    def less(frequency: float) -> float:
        return -abs(np.exp(turn * frequency) @ windowed)

    coarse = np.arange(near - within, near + within, 1.0)
    top = coarse[np.argmin([less(f) for f in coarse])]
    found: Any = minimize_scalar(
        less, bounds=(top - 1.0, top + 1.0), method="bounded", options={"xatol": 1e-5}
    )
    return float(found.x)


def spring_partials(stiffness: float, count: int) -> list[float]:
    """Where (T w / c) (cot(w x / c) + cot(w (L - x) / c)) = -k: a flexible string on a spring at x."""

    def mismatch(f: float) -> float:
        w = 2.0 * np.pi * f
        near, far = w * AT / SPEED, w * (LENGTH - AT) / SPEED
        return float(w * TENSION / SPEED * np.sin(near + far) + stiffness * np.sin(near) * np.sin(far))

    edges = np.arange(50.0, 3000.0)
    sign = np.sign([mismatch(f) for f in edges])
    roots: list[Any] = [brentq(mismatch, f, f + 1.0) for f in edges[:-1][sign[1:] != sign[:-1]]]
    return roots[:count]


def leaning(k1: float, force: float, oversampling: int = 8, *, compliant: bool = True) -> Both:
    """A flexible string that rests on a spring, bent by `force`, and is struck too softly to leave it."""
    string, modes = both()
    strike = 5e-3 / np.arange(1.0, 7.0)
    bent = force * AT * (LENGTH - AT) / (TENSION * LENGTH)
    phi = ode.shapes(modes, AT)
    q = force * phi / (modes.mass * modes.omega**2)
    residual = ode.residual(length=LENGTH, tension=TENSION, x=AT) if compliant else 0.0
    depth = bent + force / k1
    on_grid = grid.simulate(
        string,
        touch=grid.GridTouch(position=AT, k1=k1, surface=lambda t: np.full_like(t, depth)),
        shape=lambda x: bent * np.minimum(x / AT, (LENGTH - x) / (LENGTH - AT)),
        velocity=sines(strike),
        seconds=0.12,
        oversampling=oversampling,
    )
    depth_of_modes = float(phi @ q) + residual * force + force / k1
    touch = ode.ModalTouch(shape=phi, k1=k1, residual=residual, surface=lambda _: depth_of_modes)
    of_modes = ode.simulate(modes, touch=touch, q=q, v=kept(strike), seconds=0.12, rtol=1e-8)
    assert min(on_grid.touch_force.min(), of_modes.touch_force.min()) > 0.0
    return on_grid, of_modes


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    grid.simulate(both()[0], seconds=1e-3)


def test_free_stiff_string_sounds_its_partials() -> None:
    # Leapfrog is flat by (n pi / segments)^2 (1 - courant^2) / 24, here 0.016 n^2 cents; bending adds to it.
    string, modes = both(bending=BENDING)
    struck = 0.1 / np.arange(1.0, 9.0)
    on_grid = grid.simulate(string, velocity=sines(struck), seconds=0.12)
    of_modes = ode.simulate(modes, v=kept(struck), seconds=0.12, rtol=1e-9)
    for n in range(1, 9):
        true = n * SPEED / (2.0 * LENGTH) * np.sqrt(1.0 + 1e-4 * n * n)
        for microphone in (0, 1):
            assert cents(partial(on_grid.pickups[microphone], true), true) == pytest.approx(
                0.0, abs=0.02 * n * n
            )
            assert cents(partial(of_modes.pickups[microphone], true), true) == pytest.approx(0.0, abs=2e-3)


def test_lossy_mode_dies_as_it_should() -> None:
    string, modes = both(sigma0=6.0, sigma1=0.05)
    pluck = 1e-3 * np.eye(3)[2]
    on_grid = grid.simulate(string, shape=sines(pluck), seconds=0.03, segments=400, probes=[AT])
    of_modes = ode.simulate(modes, q=kept(pluck), seconds=0.03)
    sigma = 6.0 + 0.05 * (3.0 * np.pi / LENGTH) ** 2
    ringing = np.sqrt((3.0 * np.pi * SPEED / LENGTH) ** 2 - sigma**2)
    time = of_modes.time
    turned = ringing * time
    true = 1e-3 * np.exp(-sigma * time) * (np.cos(turned) + sigma / ringing * np.sin(turned))
    np.testing.assert_allclose(of_modes.q[2], true, atol=1e-11)
    at = np.sin(3.0 * np.pi * 0.35)
    # The grid is late by 2e-3 rad at most; its first step, were it twice as long, would put it 6e-3 ahead.
    for found, other in (
        (on_grid.displacement[0], at * true),
        (on_grid.velocity[0], at * of_modes.v[2]),
        (on_grid.pickups, of_modes.pickups),
    ):
        np.testing.assert_allclose(found, other, atol=2e-3 * np.abs(other).max())


def test_stretched_mode_has_duffing_s_period() -> None:
    # q'' + w^2 q + EA pi^4 / (4 mu L^4) q^3 = 0, let go at A, has the period 4 K(m) / sqrt(w^2 + e), where
    # e = EA pi^4 A^2 / (4 mu L^4) and m = e / (2 (w^2 + e)).
    stretch, amplitude = 2e4, 5e-3
    string, modes = both(stretch=stretch)
    extra = stretch * np.pi**4 * amplitude**2 / (4.0 * DENSITY * LENGTH**4)
    square = float(modes.omega[0]) ** 2 + extra
    true = float(np.sqrt(square) / (4.0 * ellipk(extra / (2.0 * square))))
    pluck = amplitude * np.eye(1)[0]
    on_grid = grid.simulate(string, shape=sines(pluck), seconds=0.12)
    of_modes = ode.simulate(modes, q=kept(pluck), seconds=0.12, rtol=1e-10)
    assert cents(true, float(modes.omega[0]) / (2.0 * np.pi)) > 20.0
    assert cents(partial(on_grid.pickups[0], true), true) == pytest.approx(0.0, abs=0.02)
    assert cents(partial(of_modes.pickups[0], true), true) == pytest.approx(0.0, abs=1e-3)


def test_energy_of_the_modes_is_kept_through_a_rattle() -> None:
    modes = both(bending=BENDING, stretch=1e4)[1]
    touch = ode.ModalTouch(
        shape=ode.shapes(modes, AT), k1=1e3, k2=1e5, residual=4e-5, surface=lambda _: -2e-4
    )
    motion = ode.simulate(
        modes, touch=touch, q=kept(np.array([2e-3, 1e-3, 5e-4])), seconds=0.03, max_step=4e-6
    )
    assert 0.05 < np.mean(motion.touch_force > 0.0) < 0.95
    stored = ode.energy(modes, touch, motion)
    np.testing.assert_allclose(stored, stored[0], rtol=1e-9)
    free = ode.energy(modes, None, motion)
    assert np.ptp(free) > 0.01 * stored[0]


def test_compression_is_shared_by_the_touch_and_the_modes_left_out() -> None:
    touch = ode.ModalTouch(shape=np.ones(1), k1=2e3, k2=3e5, residual=5e-5)
    for gap in (1e-12, 1e-6, 1e-3, 0.1):
        delta = ode.compression(touch, gap)
        assert delta + 5e-5 * (2e3 * delta + 3e5 * delta**1.5) == pytest.approx(gap, rel=1e-12)
    assert ode.compression(touch, -1e-6) == ode.compression(touch, 0.0) == 0.0


def test_string_on_a_spring_sounds_where_the_cotangents_say() -> None:
    # The grid: 0.02 cents n^2 as above. The modes: R is static, and falls short by (f / f_21)^2 at most.
    on_grid, of_modes = leaning(2e3, 2.0)
    for n, true in enumerate(spring_partials(2e3, 5), start=1):
        assert cents(partial(on_grid.pickups[0], true), true) == pytest.approx(0.0, abs=0.02 * n * n + 0.01)
        assert cents(partial(of_modes.pickups[0], true), true) == pytest.approx(0.0, abs=0.2)


def test_modes_alone_are_too_stiff() -> None:
    true = spring_partials(2e3, 1)[0]
    assert cents(partial(leaning(2e3, 2.0, compliant=False)[1].pickups[0], true), true) > 2.0


def test_hard_touch_parts_the_string() -> None:
    # A spring of 1e6 N/m flattens a segment x by T / (k x) at most, 0.5 cents here.
    for motion in leaning(1e6, 2.0, oversampling=16):
        near, far = SPEED / (2.0 * AT), SPEED / (2.0 * (LENGTH - AT))
        assert cents(partial(motion.pickups[0], near), near) == pytest.approx(0.0, abs=0.8)
        assert cents(partial(motion.pickups[1], far), far) == pytest.approx(0.0, abs=0.5)


@pytest.mark.parametrize(("count", "apart"), [(20, 0.07), (40, 0.03)])
def test_both_agree_on_a_string_that_a_soft_lossy_finger_meets(count: int, apart: float) -> None:
    # The modes above the last are static in one and ring in the other: twice as many, and half as far apart.
    string, modes = both(bending=BENDING, stretch=5e3, sigma0=2.0, sigma1=2e-3, count=count)
    pluck = np.array([1.5e-3, 5e-4])
    touch = grid.GridTouch(
        position=AT, k1=200.0, k2=2e4, beta=0.5, surface=lambda t: 1e-3 * np.sin(300.0 * t)
    )
    finger = ode.ModalTouch(
        shape=ode.shapes(modes, AT),
        k1=200.0,
        k2=2e4,
        beta=0.5,
        residual=ode.residual(length=LENGTH, tension=TENSION, x=AT, bending=BENDING, count=count),
        surface=lambda t: 1e-3 * sin(300.0 * t),
        surface_velocity=lambda t: 0.3 * cos(300.0 * t),
    )
    on_grid = grid.simulate(string, touch=touch, shape=sines(pluck), seconds=0.03)
    of_modes = ode.simulate(modes, touch=finger, q=kept(pluck, count), seconds=0.03, rtol=1e-8)
    assert 0.1 < np.mean(of_modes.touch_force > 0.0) < 0.9
    assert np.mean(on_grid.touch_force) == pytest.approx(np.mean(of_modes.touch_force), rel=0.01)
    for found, other in ((on_grid.touch_force, of_modes.touch_force), (on_grid.pickups, of_modes.pickups)):
        np.testing.assert_allclose(found, other, atol=apart * np.abs(other).max())


def driven(*, gain: float, centre: float, quality: float, sigma0: float, width: float = 0.0) -> Both:
    """A string with one driver as told and a weaker one beyond the middle, from the slightest motion.

    The grid's probe is its first mode.
    """
    string, modes = both(bending=BENDING, sigma0=sigma0, sigma1=0.02)
    places = 0.1 + width * np.linspace(-0.5, 0.5, 9)
    across = np.mean([ode.shapes(modes, x) for x in places], axis=0)
    strong = {"gain": gain, "max_force": 0.02, "centre": centre, "quality": quality}
    weak = {**strong, "gain": gain / 50.0}
    start = np.array([1e-4])
    near = grid.GridEBow(sense=(places, np.full(9, 1.0 / 9.0)), drive=0.13, **strong)
    far = grid.GridEBow(sense=0.52, drive=0.546, **weak)
    near_coils = ode.ModalEBow(sense=across, drive=ode.shapes(modes, 0.13), **strong)
    far_coils = ode.ModalEBow(sense=ode.shapes(modes, 0.52), drive=ode.shapes(modes, 0.546), **weak)
    x = LENGTH * np.arange(101.0) / 100.0
    first = (x, np.sin(np.pi * x / LENGTH) / 50.0)
    on_grid = grid.simulate(
        string,
        ebows=[near, far],
        shape=sines(start),
        seconds=0.3,
        segments=100,
        oversampling=4,
        probes=[first],
    )
    bows = [near_coils, far_coils]
    return on_grid, ode.simulate(modes, ebows=bows, q=kept(start), seconds=0.3, rtol=1e-6, max_step=1e-4)


def level(sound: Floats) -> Floats:
    """Root mean square over each twentieth of a second."""
    return np.sqrt(np.mean(sound.reshape(-1, 2205) ** 2, axis=1))


def test_driven_mode_settles_where_its_drivers_make_up_for_its_losses() -> None:
    # Harmonic balance: 2 m sigma V = sum of phi_drive F, F being tanh's first harmonic at V phi_sense. Left
    # out are the higher modes, which the force's harmonics drive and the filter lets back in a little.
    modes = both(bending=BENDING, sigma0=40.0, sigma1=0.02)[1]
    turn = np.cos(np.linspace(0.0, np.pi, 2001)[:-1])

    def lacking(velocity: float) -> float:
        lost = 2.0 * modes.mass * float(modes.sigma[0]) * velocity
        for sense, drive, gain in ((0.1, 0.13, 0.15), (0.52, 0.546, 0.003)):
            sensed = velocity * sin(np.pi * sense / LENGTH) * turn
            harmonic = 2.0 * float(np.mean(0.02 * np.tanh(gain * sensed / 0.02) * turn))
            lost -= sin(np.pi * drive / LENGTH) * harmonic
        return lost

    true: Any = brentq(lacking, 0.1, 10.0)
    centre = float(modes.omega[0]) / (2.0 * np.pi)
    on_grid, of_modes = driven(gain=0.15, centre=centre, quality=5.0, sigma0=40.0)
    for found in (level(on_grid.velocity[0]), level(of_modes.v[0])):
        assert found[0] < 0.5 * found[-1]
        assert found[-1] == pytest.approx(found[-2], rel=0.01)
        assert found[-1] * 2.0**0.5 == pytest.approx(true, rel=0.02)


def test_both_drive_a_string_alike() -> None:
    # Off its filter's centre the driver draws the second mode down by more than 20 cents, in both alike.
    on_grid, of_modes = driven(gain=0.5, centre=320.0, quality=2.0, sigma0=30.0, width=0.02)
    second = float(both(bending=BENDING)[1].omega[1]) / (2.0 * np.pi)
    late = slice(-8820, None)
    for found, other in zip(on_grid.pickups, of_modes.pickups, strict=True):
        np.testing.assert_allclose(level(found), level(other), rtol=0.02)
        assert level(found)[-1] == pytest.approx(level(found)[-2], rel=0.01)
        assert level(found)[-1] == pytest.approx(level(other)[-1], rel=0.01)
        sung = partial(other[late], second)
        assert cents(sung, second) < -20.0
        assert cents(partial(found[late], second), sung) == pytest.approx(0.0, abs=0.5)
    for found, other in zip(on_grid.drive_forces, of_modes.drive_forces, strict=True):
        assert level(found)[-1] == pytest.approx(level(other)[-1], rel=0.01)


def test_residual_is_what_the_string_gives_beyond_its_first_modes() -> None:
    modes = both(bending=BENDING)[1]
    whole = ode.residual(length=LENGTH, tension=TENSION, x=AT, count=0)
    assert whole == pytest.approx(AT * (LENGTH - AT) / (TENSION * LENGTH), rel=1e-4)
    first = float(np.sum(ode.shapes(modes, AT) ** 2 / (modes.mass * modes.omega**2)))
    stiff = [
        ode.residual(length=LENGTH, tension=TENSION, x=AT, bending=BENDING, count=count) for count in (0, 20)
    ]
    assert stiff[0] - stiff[1] == pytest.approx(first, rel=1e-9)


def test_filter_of_the_grid_is_a_band_pass() -> None:
    # H(i w) = i w w0 / Q / (w0^2 - w^2 + i w w0 / Q); the input stands between two of the filter's steps.
    w0, quality, dt = 2.0 * np.pi * 400.0, 3.0, 1e-6
    for w in (0.5 * w0, w0, 3.0 * w0):
        y = z = 0.0
        found = np.empty(40000)
        for n in range(found.size):
            y, z = grid._filter.py_func(w0, quality, cos(w * (n + 0.5) * dt), y, z, dt)
            found[n] = y
        wide = 1j * w * w0 / quality
        true = wide / (w0**2 - w**2 + wide) * np.exp(1j * w * dt * np.arange(1.0, found.size + 1.0))
        np.testing.assert_allclose(found[-5000:], true.real[-5000:], atol=1e-4)


def test_grid_is_of_second_order() -> None:
    def flat(segments: int, oversampling: int) -> float:
        string, modes = both(bending=BENDING)
        sound = grid.simulate(
            string, shape=sines(np.eye(6)[5]), seconds=0.12, segments=segments, oversampling=oversampling
        )
        true = float(modes.omega[5]) / (2.0 * np.pi)
        return cents(partial(sound.pickups[0], true), true)

    assert flat(50, 4) / flat(100, 8) == pytest.approx(4.0, rel=0.02)


def test_grid_too_fine_for_its_step_is_refused() -> None:
    string = both()[0]
    with pytest.raises(ValueError, match="unstable at 0 s"):
        grid.simulate(string, seconds=0.01, segments=200, oversampling=2)
    hard = grid.GridTouch(position=AT, k1=1e7, surface=lambda t: np.full_like(t, 1e-6))
    with pytest.raises(ValueError, match="more oversampling"):
        grid.simulate(string, touch=hard, seconds=0.01)
