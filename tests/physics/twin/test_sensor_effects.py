"""What the world `plausible` adds to ends, drivers and the chain after the microphones, against theory."""

from dataclasses import replace
from math import cosh, pi, tan, tanh
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from tests.physics.twin.built import (
    AT,
    COILS,
    NONE,
    PLASTIC,
    QUIET,
    RATE,
    SENSOR,
    cents,
    flexible,
    frequency,
    inside,
    modes,
    partials_off,
    planned,
    sprung,
    with_touch,
)

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.physics.setup import DISTORTION_LEVEL, HUM_SHARES
from monochord.physics.twin import (
    End,
    Outside,
    Pluck,
    Scene,
    Sensor,
    Twin,
    advance,
    begin,
    electronics,
    hold,
    kernel,
)
from monochord.physics.twin import records as layout
from monochord.physics.twin.energy import energy

STILL = (False, False)
PLUCK = Pluck(position=0.0413, height=1e-4)


def admittance(end: End, omega: complex) -> complex:
    w0 = 2.0 * pi * end.frequency
    return 1j * omega * end.compliance + end.admittance / (1.0 + 1j * end.quality * (omega / w0 - w0 / omega))


def transcendental(sensor: Sensor, count: int) -> np.ndarray:
    """The complex angular frequencies of a flexible string between yielding ends, motion being exp(i w t).

    k L + phi_1 + phi_2 = n pi with tan phi = -i Z Y(w), by fixed-point iteration.
    """
    string, found = sensor.string, []
    speed = np.sqrt(string.tension / string.linear_density)
    impedance = np.sqrt(string.tension * string.linear_density)
    for n in range(1, count + 1):
        omega = complex(n * pi * speed / string.length)
        for _ in range(60):
            phases = sum(np.arctan(-1j * impedance * admittance(end, omega)) for end in sensor.ends)
            omega = speed * (n * pi - phases) / string.length
        found.append(omega)
    return np.array(found)


ENDS = {
    "resonances": (
        End(admittance=1e-2, frequency=1500.0, quality=2.0),
        End(admittance=1e-3, frequency=400.0, quality=8.0),
    ),
    "both": (
        End(compliance=1.5e-6, admittance=1e-2, frequency=2500.0, quality=3.0),
        End(compliance=5e-7, admittance=3e-3, frequency=6000.0),
    ),
}


@pytest.mark.parametrize("name", ["resonances", "both"])
def test_yielding_ends_shift_partials_and_decay_as_their_equation_says(name: str) -> None:
    sensor = replace(flexible(), ends=ENDS[name])
    rigid = transcendental(flexible(), 12)
    true = transcendental(sensor, 12)
    shift = true - rigid
    twin = begin(sensor, Scene(pluck=PLUCK, drivers=STILL, tension_law="linear"))
    bank = modes(twin)[:, :12]
    square = bank[layout.OMEGA2_TENSION] * sensor.string.tension + bank[layout.OMEGA2_BENDING]
    found = np.sqrt(square - bank[layout.DECAY] ** 2) + 1j * bank[layout.DECAY]
    # What the first order leaves out is of the square of the shifts; the largest is 1.6e-3 of a period.
    assert np.abs(found - true).max() < 0.02 * np.abs(shift).max()
    sound = advance(twin, RATE)[0].microphones[0].astype(np.float64)
    for omega in true[:3]:
        if omega.imag * 0.5 < 2.0:  # still heard after half a second
            off = cents(frequency(sound, omega.real / (2.0 * pi)), omega.real / (2.0 * pi))
            assert off == pytest.approx(0.0, abs=0.01)


def test_an_end_like_a_spring_lengthens_the_segment_beside_it() -> None:
    # A clamped segment of length x whose other end is a spring of the compliance C: tan(k x) = -k T C.
    near, far = 3e-6, 1e-6
    string = flexible().string
    speed = np.sqrt(string.tension / string.linear_density)

    def lowest(length: float, compliance: float) -> float:
        def error(k: float) -> float:
            return tan(k * length) + k * string.tension * compliance

        root: Any = brentq(error, 0.9 * pi / length, pi / length, xtol=1e-12)
        return float(root) * speed / (2.0 * pi)

    true = np.array([lowest(string.length - AT, far), lowest(AT, near)])
    twin = sprung(1e9, ends=(End(compliance=near), End(compliance=far)))
    rigid = np.array([speed / (2.0 * (string.length - AT)), speed / (2.0 * AT)])
    assert all(cents(f, r) < -0.8 for f, r in zip(true, rigid, strict=True))
    assert np.abs(partials_off(twin, true)).max() < 0.05
    labels = advance(twin, 10)[0].labels
    assert labels.position[0, -1] == pytest.approx(AT, abs=1e-8)  # labels count from the real end


def test_an_end_that_gives_way_wholly_is_refused() -> None:
    with pytest.raises(InputError, match="end"):
        replace(SENSOR, string=replace(SENSOR.string, tension=400.0), ends=(End(compliance=2e-5), End()))


MAGNETS = (replace(COILS[0], pull=80.0, aperture=0.0), COILS[1])


def pulled(twin_of: Sensor, stiffness: float, count: int) -> Floats:
    """The lowest frequencies of a flexible string that a negative spring pulls at the first coil, in Hz."""
    string, at = twin_of.string, twin_of.drivers[0].drive
    speed = np.sqrt(string.tension / string.linear_density)

    def error(f: float) -> float:
        k = 2.0 * pi * f / speed
        moved = np.sin(k * at) * np.sin(k * (string.length - at))
        return float(string.tension * k * np.sin(k * string.length) - stiffness * moved)

    tops = np.arange(1, count + 1) * speed / (2.0 * string.length)
    return np.array([brentq(error, 0.97 * f, f * (1.0 + 1e-9)) for f in tops])


def sounding(sensor: Sensor, scene: Scene, finer: int) -> Floats:
    """A second at the first microphone, in steps of a given share of a frame."""
    with pytest.MonkeyPatch.context() as patch:
        planned(patch, finer)
        return advance(begin(sensor, scene), RATE)[0].microphones[0].astype(np.float64)


def test_a_magnet_lowers_the_polarisation_that_it_pulls() -> None:
    sensor = replace(flexible(), drivers=tuple(replace(coil, angle=0.0) for coil in MAGNETS))
    true = pulled(sensor, 80.0, 4)
    rigid = np.real(transcendental(flexible(), 4)) / (2.0 * pi)
    for angle, expected in ((0.0, true), (0.5 * pi, rigid)):
        scene = Scene(pluck=replace(PLUCK, angle=angle), drivers=STILL, tension_law="linear")
        felt = replace(sensor, pickups=replace(QUIET, angle=angle))
        off, off_twice = (
            np.array([cents(frequency(sound, f), f) for f in expected])
            for sound in (sounding(felt, scene, finer) for finer in (1, 2))
        )
        assert np.abs(off).max() < 0.3  # its force is held over a step: an error of second order
        assert np.abs((4.0 * off_twice - off) / 3.0).max() < 0.03
    assert max(cents(f, r) for f, r in zip(true, rigid, strict=True)) < -2.0


def test_a_magnet_never_gives_energy_over_a_cycle() -> None:
    sensor = replace(SENSOR, losses=NONE, drivers=tuple(replace(coil, pull=80.0) for coil in COILS))
    twin = begin(sensor, Scene(pluck=replace(PLUCK, height=1e-3, angle=0.5), drivers=STILL), tolerance=1e-10)
    levels = [energy(twin)]
    for _ in range(300):
        twin = advance(twin, 7)[1]
        levels.append(energy(twin))
    assert np.all(np.diff(levels) < 1e-9 * levels[0])
    assert levels[-1] > 0.9 * levels[0]  # measured: 0.944: the held force takes a little


def test_a_magnet_to_which_the_string_would_stick_is_refused() -> None:
    with pytest.raises(InputError, match="pull"):
        replace(
            SENSOR, drivers=(replace(COILS[0], drive=0.1, pull=500.0), COILS[1]), string=flexible(0.4).string
        )


def coil(bias: float) -> Any:
    record = np.zeros(1, layout.dtype_of(layout.CoilEffects))
    record["bias"], record["rest"], record["scale"] = bias, tanh(bias), cosh(bias) ** 2
    return record[0]


def driven(amplitude: float, bias: float) -> Floats:
    """The force of a driver of unit limit over cycles of 100 steps, at the centre of its band."""
    twin = begin(SENSOR)
    settings, memory = inside(twin, "drivers").copy()[:1], np.zeros(1, layout.dtype_of(layout.DriverState))
    g = tan(pi / 100.0)
    settings["g"], settings["scale"] = g, 1.0 / (1.0 + g * (g + settings["k"][0]))
    settings["gain"], settings["limit"], memory["gate"] = 1.0, 1.0, 1.0
    speeds = amplitude * np.cos(2.0 * pi * np.arange(5000) / 100.0)
    forces = [electronics.drive(settings[0], memory[0], v, coil(bias)) for v in speeds]
    return np.array(forces)[-1000:]


def test_an_asymmetric_driver_sounds_even_harmonics_and_none_at_rest() -> None:
    small = [np.abs(np.fft.rfft(driven(1e-3, bias)))[10] for bias in (0.0, 0.5)]
    assert small[1] == pytest.approx(small[0], rel=1e-3)
    for bias in (0.0, 0.3, -0.6):
        force = driven(1.2, bias)
        lines = np.abs(np.fft.rfft(force))[10::10]
        turn = 2.0 * pi * np.arange(1000) / 1000.0
        ahead = 1.2 * np.abs(1.5 - 0.5 * np.exp(-2j * pi / 100.0)) * np.cos(turn)
        true = np.abs(np.fft.rfft((np.tanh(ahead + bias) - tanh(bias)) * cosh(bias) ** 2))[1:]
        np.testing.assert_allclose(lines[:6], true[:6], atol=2e-3 * true[0])
        assert (lines[1] > 0.02 * lines[0]) == (bias != 0.0)
    assert np.abs(driven(0.0, 0.5)).max() < 1e-6


def test_distortion_is_as_stated_and_clips() -> None:
    pickups = replace(SENSOR.pickups, distortion=(0.004, -0.002))
    chain = inside(begin(replace(SENSOR, pickups=pickups)), "chain")
    turn = 2.0 * pi * np.arange(1000) / 1000.0
    sound = [electronics.distorted(chain, DISTORTION_LEVEL * x) for x in np.cos(turn)]
    lines = np.fft.rfft(sound).real / 500.0
    assert lines[2] / DISTORTION_LEVEL == pytest.approx(0.004, rel=1e-6)
    assert lines[3] / DISTORTION_LEVEL == pytest.approx(-0.002, rel=1e-6)
    strongest = replace(SENSOR.pickups, distortion=(-0.01, -0.01))
    chain = inside(begin(replace(SENSOR, pickups=strongest)), "chain")
    steps = [electronics.distorted(chain, x) for x in np.linspace(-3.0, 3.0, 601)]
    assert np.all(np.diff(steps) >= 0.0)


def test_microphones_mix_after_equation_5() -> None:
    plain = replace(SENSOR.pickups, hiss=0.0, gain=(0.1, 0.1), own=(1.0, 1.0))
    mixed = replace(plain, gain=(0.2, 0.3), own=(0.8, 0.7))
    (first, second), heard = (
        advance(begin(replace(SENSOR, pickups=pickups), Scene(pluck=PLUCK)), 2000)[0].microphones
        for pickups in (plain, mixed)
    )
    assert np.abs(heard).max() > 1e-3
    true = [2.0 * (0.8 * first + 0.2 * second), 3.0 * (0.3 * first + 0.7 * second)]
    np.testing.assert_allclose(heard, true, rtol=0.0, atol=1e-6 * np.abs(heard).max())


def test_preamplifiers_pass_their_band() -> None:
    # The corner at 40 Hz is 3 dB down; an outside sound reaches the first microphone as it is.
    bands = {5: (0.0, 0.2), 40: (0.69, 0.73), 2000: (0.98, 1.01), 20500: (0.0, 0.2)}
    turns = 2.0 * pi * np.outer([*bands], np.arange(RATE)) / RATE
    outside = Outside(samples=(0.2 * np.sin(turns).sum(axis=0)).astype(np.float32))
    still = replace(SENSOR, shake=0.0, pickups=replace(SENSOR.pickups, hiss=0.0))
    sound = advance(begin(still, Scene(drivers=STILL, outside=outside)), 2 * RATE)[0].microphones[0, RATE:]
    lines = np.abs(np.fft.rfft(sound.astype(np.float64))) / (0.1 * RATE)
    for frequency_, (low, high) in bands.items():
        assert low <= lines[frequency_] <= high


def silent(**pickups: Any) -> Sensor:
    """A sensor whose pickups are deaf to the string."""
    return replace(SENSOR, pickups=replace(SENSOR.pickups, gain=(0.0, 0.0), hiss=0.0, low=1.0, **pickups))


def test_hum_has_its_level_in_each_channel_and_its_harmonics() -> None:
    sound = advance(begin(silent(hum=(0.01, 0.03), mains=60.0), Scene(drivers=STILL)), 2 * RATE)[
        0
    ].microphones
    late = sound[:, RATE:].astype(np.float64)
    np.testing.assert_allclose(np.sqrt(np.mean(late**2, axis=1)), [0.01, 0.03], rtol=1e-3)
    lines = np.abs(np.fft.rfft(late, axis=1))[:, 60 * np.arange(1, 6)]
    np.testing.assert_allclose(lines / lines[:, :1], np.tile(HUM_SHARES, (2, 1)), atol=2e-3)


def test_coils_feed_their_drive_into_both_pickups() -> None:
    sensor = silent(feed=(3.0, -1.0), high=20000.0)
    twin = begin(sensor, Scene(pluck=PLUCK))
    sound, drives = np.zeros((2, 2000)), np.zeros((2, 2000))
    for frame in range(2000):
        take, twin = advance(twin, 1)
        sound[:, frame], drives[:, frame] = take.microphones[:, 0], inside(twin, "coils")["drive"]
    assert np.abs(drives).max() > 1e-4
    settings, memory = inside(twin, "pickup"), np.zeros(2, layout.dtype_of(layout.PreampState))
    mixed = np.array([[3.0, -1.0], [-1.0, 3.0]]) @ drives
    true = [[electronics.amplified(settings, memory[c], x) for x in mixed[c]] for c in (0, 1)]
    np.testing.assert_allclose(sound, true, atol=1e-6)


def ends_at_rest(twin: Twin) -> tuple[float, float]:
    memory, plausible = inside(twin, "memory"), twin.plausible
    assert plausible is not None
    single = layout.Plausible(*(array[0] for array in plausible))
    sensor = layout.Parameters(*(array[0] for array in twin.parameters))
    state = layout.State(*(array[0] for array in twin.state))
    more = kernel._residual_ends(sensor, state, single, 0.0)  # pyright: ignore[reportPrivateUsage]
    taut = memory.tuned_tension / SENSOR.string.tension
    return taut * memory.end_force_1 + more[0], taut * memory.end_force_2 + more[1]


def test_a_press_at_rest_rests_on_both_ends() -> None:
    position = 0.05
    sensor = replace(SENSOR, pickups=replace(QUIET, residual=True))
    twin = begin(sensor, Scene(touches=(hold(position, 1.0, PLASTIC),), drivers=STILL))
    twin = advance(with_touch(twin, roughness=0.0), 2 * RATE)[1]
    force = inside(twin, "contact")[0].force
    share = position / SENSOR.string.length
    # The table is of the nominal tension, and stiffness keeps the rest from following the tension wholly.
    assert ends_at_rest(twin) == pytest.approx((force * (1.0 - share), force * share), rel=1e-3)
    without = (
        inside(twin, "memory").end_force_1 * inside(twin, "memory").tuned_tension / SENSOR.string.tension
    )
    assert abs(without - force * (1.0 - share)) > 4e-3 * force
