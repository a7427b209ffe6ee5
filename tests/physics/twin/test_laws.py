"""The twin against the laws of strings: partials, springs, touches, energy, and its order in the step."""

from dataclasses import replace

import numpy as np
import pytest
from tests.physics.twin import ode_string as ode
from tests.physics.twin.built import (
    AT,
    COILS,
    FOAM,
    NONE,
    PLASTIC,
    QUIET,
    RATE,
    SENSOR,
    cents,
    changed,
    flexible,
    frequency,
    inside,
    key,
    modes,
    partials_off,
    planned,
    sprung,
    touch,
    waiting,
    with_touch,
)

from monochord.core.types import Floats
from monochord.physics.strings import load_string
from monochord.physics.theory import loaded_frequencies, stretch_stiffness
from monochord.physics.theory.stiffness import inharmonicity
from monochord.physics.twin import Outside, Pluck, Scene, Twin, advance, begin, hold
from monochord.physics.twin import records as layout
from monochord.physics.twin.energy import energy
from monochord.physics.twin.rate import mode_frequencies, touch_weights


@pytest.mark.parametrize("highest", [16, pytest.param(20, marks=pytest.mark.slow)])
def test_free_stiff_string_sounds_its_partials(highest: int, monkeypatch: pytest.MonkeyPatch) -> None:
    string = load_string("plain_010").string
    sensor = replace(SENSOR, string=string, losses=NONE, pickups=QUIET)
    pluck = Pluck(position=0.0413 * string.length, height=1e-4)
    scene, rate = Scene(pluck=pluck, drivers=(False, False), tension_law="linear"), 28000
    if highest == 16:
        planned(monkeypatch, 1)
    twin = begin(sensor, scene, sample_rate=rate)
    sound = advance(twin, rate)[0].microphones[0].astype(np.float64)
    n = np.arange(1, highest + 1)
    stiff = np.sqrt(1.0 + inharmonicity(string) * n**2)
    true = n * stiff * np.sqrt(string.tension / string.linear_density) / (2.0 * string.length)
    off = [cents(frequency(sound, f, rate), f) for f in true]
    assert np.abs(off).max() < 0.05


@pytest.mark.parametrize("hertz", [False, True], ids=["linear", "hertz"])
def test_string_on_a_hard_spring_sounds_as_the_cotangents_say(*, hertz: bool) -> None:
    twin = sprung(1e6, hertz=hertz)
    off = partials_off(twin, loaded_frequencies(twin.sensor.string, AT, 1e6, 4))
    assert np.abs(off).max() < 0.06  # measured: 0.014 linear, 0.051 as Hertz has it


@pytest.mark.parametrize(("stiffness", "most"), [(1e4, 4.5), (1e5, 0.6)])
def test_string_on_a_soft_spring_is_flat_by_some_cents(stiffness: float, most: float) -> None:
    # The weights of modes are fitted to a clamp.
    true = loaded_frequencies(flexible().string, AT, stiffness, 4)
    assert np.abs(partials_off(sprung(stiffness), true)).max() < most


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [1e4, 1e5])
def test_string_on_a_soft_spring_is_not_in_the_limit_of_short_steps(stiffness: float) -> None:
    # Flat by a fourth with steps of half the length, and twice the modes: without that share nothing is left.
    true = loaded_frequencies(flexible().string, AT, stiffness, 4)
    once, twice = (partials_off(sprung(stiffness, finer=finer), true) for finer in (1, 2))
    assert np.abs((4.0 * twice - once) / 3.0).max() < 0.05


def test_partials_converge_at_second_order_with_the_same_modes() -> None:
    true = loaded_frequencies(flexible().string, AT, 1e4, 4)
    off: list[Floats] = []
    for finer in (2, 4, 8):
        with pytest.MonkeyPatch.context() as patch:
            planned(patch, finer)
            off.append(partials_off(sprung(1e4), true))
    orders = np.log2((off[0] - off[1]) / (off[1] - off[2]))
    assert orders == pytest.approx(2.0, abs=0.2)


def bounced(finer: int, patch: pytest.MonkeyPatch) -> Twin:
    planned(patch, finer)
    coils = tuple(replace(coil, angle=0.0, limit=0.05) for coil in COILS)
    sensor = replace(SENSOR, drivers=(coils[0], coils[1]))
    resting = touch(key(0.0, 0.08, 0.0, 2e-4))
    scene = Scene(touches=(resting,), pluck=Pluck(position=0.06, height=5e-4))
    twin = with_touch(begin(sensor, scene, tolerance=1e-10), k1=3e3, k2=3e5, beta=0.3, roughness=0.0)
    return waiting(twin)


FRAMES = 100


def exact(twin: Twin) -> ode.ModalMotion:
    """The same modes, coils and touch as an initial value problem."""
    count = twin.plan.count
    bank, string = modes(twin), twin.sensor.string
    constants, weights = inside(twin, "constants"), inside(twin, "weights")
    table = inside(twin, "compliance")
    kept = ode.Modes(
        length=string.length,
        density=string.linear_density,
        tension=string.tension,
        omega=mode_frequencies(string, count),
        sigma=bank[layout.DECAY, :count],
        stretch=float(constants.axial_stiffness),
    )
    blur = weights[0, :count] / np.sqrt(touch_weights(kept.omega, constants.step, twin.plan.beta))
    shape = blur * ode.shapes(kept, 0.08)
    place = 0.08 / string.length * 512
    i = int(place)
    whole = table[0, i] + (place - i) * (table[0, i + 1] - table[0, i])
    pressed = ode.ModalTouch(
        shape=shape,
        k1=3e3,
        k2=3e5,
        beta=0.3,
        residual=float(whole - np.sum(shape**2 / (kept.mass * kept.omega**2))),
        surface=-2e-4,
    )
    bows = [
        ode.ModalEBow(
            sense=bank[layout.SENSE_1 + d, :count],
            drive=bank[layout.DRIVE_1 + d, :count],
            gain=coil.gain,
            max_force=coil.limit,
            centre=coil.centre,
            quality=coil.quality,
        )
        for d, coil in enumerate(twin.sensor.drivers)
    ]
    return ode.simulate(
        kept, touch=pressed, ebows=bows, q=bank[layout.Q, :count], seconds=(FRAMES + 1) / RATE, rtol=1e-10
    )


def test_touched_and_driven_string_converges_on_the_exact_motion_at_second_order() -> None:
    errors: list[float] = []
    true: ode.ModalMotion | None = None
    for finer in (1, 2, 4, 8, 16):
        with pytest.MonkeyPatch.context() as patch:
            twin = bounced(finer, patch)
            true = exact(twin) if true is None else true
            found = np.zeros((16, FRAMES))
            for frame in range(FRAMES):
                twin = advance(twin, 1)[1]
                found[:, frame] = modes(twin)[layout.Q, :16]
        apart = found - true.q[:, 1 : FRAMES + 1]
        errors.append(float(np.abs(apart).max() / np.abs(true.q).max()))
    assert true is not None
    # Where in a step a contact begins is chance, so that single orders scatter: the mean of four counts.
    assert 0.1 < np.mean(true.touch_force > 0.0) < 0.9
    assert errors[0] < 0.02  # measured: 0.009 of the largest mode over 100 frames, 0.05 over 400
    assert np.log2(errors[0] / errors[-1]) / 4.0 == pytest.approx(2.0, abs=0.2)


FREE = Scene(pluck=Pluck(position=0.07, height=1e-4), drivers=(False, False), tension_law="linear")


def ringing(bank: Floats, time: float, tension: float) -> Floats:
    """q of every mode that was let go from rest."""
    square, sigma = bank[layout.OMEGA2_TENSION] * tension + bank[layout.OMEGA2_BENDING], bank[layout.DECAY]
    ring = np.sqrt(np.maximum(square - sigma**2, 1.0))
    swing = np.cos(ring * time) + sigma / ring * np.sin(ring * time)
    return bank[layout.Q] * np.exp(-sigma * time) * swing


def test_free_modes_follow_their_closed_solution() -> None:
    twin = begin(SENSOR, FREE)
    after = advance(twin, 3000)[1]
    true = ringing(modes(twin), 3000 / 44100, SENSOR.string.tension)
    np.testing.assert_allclose(modes(after)[layout.Q], true, atol=1e-12 * np.abs(true).max())


def test_a_static_push_gives_the_static_compliance() -> None:
    # A uniform acceleration of the frame, held for long: each mode comes to rest at F / (m omega^2).
    def settled(twin: Twin) -> Twin:
        bank = modes(twin).copy()
        bank[layout.DECAY] = 500.0
        return advance(changed(twin, bank=bank), 6000)[1]

    steady = Outside(samples=np.ones(1, np.float32))
    twin = settled(begin(SENSOR, Scene(outside=steady, drivers=(False, False), tension_law="linear")))
    bank, string = modes(twin), SENSOR.string
    square = bank[layout.OMEGA2_TENSION] * string.tension + bank[layout.OMEGA2_BENDING]
    ringing = square > 0.0
    push = bank[layout.FRAME, ringing] * SENSOR.shake / (0.5 * string.linear_density * string.length)
    np.testing.assert_allclose(bank[layout.Q, ringing], push / square[ringing], rtol=1e-6, atol=1e-15)


def test_a_large_swing_sounds_higher() -> None:
    # One mode of Kirchhoff's string is Duffing's: its tension rises by E A (pi q / (2 L))^2 at q, of
    # which the frequency feels three quarters at the amplitude.
    amplitude, string = 2e-3, SENSOR.string
    twin = begin(replace(SENSOR, losses=NONE, pickups=QUIET), Scene(drivers=(False, False)))
    bank = modes(twin).copy()
    bank[layout.Q, 0] = amplitude
    memory = inside(twin, "memory").copy()
    memory["stretch"] = bank[layout.STRETCH, 0] * amplitude**2
    twin = changed(twin, bank=bank, memory=memory)
    sound = advance(twin, RATE)[0].microphones[0].astype(np.float64)
    square = bank[layout.OMEGA2_TENSION, 0] * string.tension + bank[layout.OMEGA2_BENDING, 0]
    extra = stretch_stiffness(string) * (np.pi * amplitude / (2.0 * string.length)) ** 2
    true = np.sqrt(square + 0.75 * bank[layout.OMEGA2_TENSION, 0] * extra) / (2.0 * np.pi)
    assert cents(true, np.sqrt(square) / (2.0 * np.pi)) > 20.0
    assert cents(frequency(sound, true), true) == pytest.approx(0.0, abs=0.3)


LOSSLESS = replace(SENSOR, losses=NONE)
SCENES = {
    "free": Scene(pluck=Pluck(position=0.07, height=2e-3, angle=0.5), drivers=(False, False)),
    "bounce": Scene(
        pluck=Pluck(position=0.07, height=1e-3),
        drivers=(False, False),
        touches=(touch(key(0.0, 0.08, 0.0, 2e-4)),),
    ),
    "press": Scene(
        pluck=Pluck(position=0.07, height=1e-3), drivers=(False, False), touches=(touch(key(0.0, 0.08, 1.0)),)
    ),
}


def lossless(name: str, tolerance: float = 1e-8) -> Twin:
    twin = with_touch(begin(LOSSLESS, SCENES[name], tolerance=tolerance), beta=0.0, roughness=0.0)
    return advance(twin, 64)[1]  # the objects have come to where they stay


@pytest.mark.parametrize("name", SCENES)
def test_energy_stays_over_five_seconds(name: str) -> None:
    twin = lossless(name)
    first = energy(twin)
    for _ in range(10):
        twin = advance(twin, RATE // 2)[1]
        assert energy(twin) == pytest.approx(first, rel=1e-6)  # measured: 3e-9 free, 5e-8, 3e-7


def test_a_plucked_string_holds_what_the_pluck_gave() -> None:
    # A triangle of height h at x holds T h^2 L / (2 x (L - x)), and the square of its stretch EA / (2 L)
    # besides; the modes left out hold some 5 percent of it.
    string, height, x = SENSOR.string, 1e-3, 0.07
    twin = begin(LOSSLESS, Scene(pluck=Pluck(position=x, height=height), tension_law="linear"))
    stretch = height**2 * string.length / (2.0 * x * (string.length - x))
    assert energy(twin) == pytest.approx(string.tension * stretch, rel=0.06)
    taut = begin(LOSSLESS, Scene(pluck=Pluck(position=x, height=height)))
    more = stretch_stiffness(string) * stretch**2 / (2.0 * string.length)
    assert energy(taut) - energy(twin) == pytest.approx(more, rel=0.25)


def test_losses_take_energy_and_drivers_give_it() -> None:
    plucked = Scene(pluck=Pluck(position=0.07, height=1e-4), drivers=(False, False))
    still = begin(SENSOR, plucked)
    assert energy(advance(still, 4410)[1]) < 0.95 * energy(still)
    driven = begin(SENSOR, replace(plucked, drivers=(True, True)))
    assert energy(advance(driven, 4410)[1]) > energy(advance(still, 4410)[1])
    assert energy(begin(SENSOR)) == 0.0


def test_a_lossy_bounce_loses_and_never_gains() -> None:
    twin = advance(begin(LOSSLESS, SCENES["bounce"], tolerance=1e-10), 64)[1]
    levels: list[float] = []
    for _ in range(200):
        twin = advance(twin, 20)[1]
        levels.append(energy(twin))
    assert np.all(np.diff(levels) < 1e-8 * levels[0])
    assert levels[-1] < 0.99 * levels[0]
    assert np.abs(modes(twin)[layout.Q]).max() > 0.0


STILL = (False, False)


def test_several_touches_press_as_each_was_told() -> None:
    pressed = (hold(0.06, 0.5, PLASTIC), hold(0.09, 1.0, PLASTIC), hold(0.13, 2.0, FOAM))
    twin = with_touch(begin(SENSOR, Scene(touches=pressed, drivers=STILL)), roughness=0.0)
    labels = advance(twin, 44100)[0].labels
    assert labels.force[:, -1] == pytest.approx(
        [0.5, 1.0, 2.0], rel=0.1
    )  # their shapes superpose but roughly
    assert labels.contact[:, -1].tolist() == [1, 1, 1]


def test_a_sliding_object_feels_its_kinetic_friction() -> None:
    twin = with_touch(
        begin(SENSOR, Scene(touches=(hold(0.08, 1.0, PLASTIC, across=0.2),), drivers=STILL)), roughness=0.0
    )
    take, after = advance(twin, 44100)
    own = inside(after, "contact")[0]
    pull = own.bristle_stiffness * own.z
    assert abs(pull) == pytest.approx(PLASTIC.friction_kinetic * own.force, rel=0.15)
    assert take.labels.across[0, -4410:].mean() == pytest.approx(0.2, rel=0.05)
    assert take.labels.slip[0, -4410:].all()


def test_a_new_object_starts_at_its_surfaces_height() -> None:
    # A height that came in with the first sliding would push the string by the whole roughness at once.
    twin = begin(SENSOR, Scene(touches=(hold(0.08, 1.0, PLASTIC),), drivers=STILL), seed=5)
    first, later = advance(twin, 1)[1], advance(twin, 4410)[1]
    heights = [inside(one, "contact")["height"][0] for one in (first, later)]
    assert heights[0] != 0.0
    assert abs(heights[1] - heights[0]) < 0.2 * PLASTIC.roughness


def test_an_object_that_goes_away_is_off_after_a_while() -> None:
    leaves = touch(key(0.0, 0.08, 1.0), key(0.1, 0.08, 1.0), key(0.11, 0.08, 0.0, 2e-3))
    labels = advance(begin(SENSOR, Scene(touches=(leaves,), drivers=STILL)), 8820)[0].labels
    assert labels.contact[0, 4000] == 1
    assert labels.contact[0, -1] == 0
    assert labels.friction[0, -1] == 0
    assert np.all(labels.force[0, labels.contact[0] == 0] == 0.0)
