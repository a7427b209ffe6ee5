"""Objects that give way, and surfaces that are not Hertz's: against theory, and by their energy."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from tests.physics.twin.built import (
    AT,
    FOAM,
    NONE,
    PLASTIC,
    RATE,
    SENSOR,
    STRING,
    cents,
    flexible,
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

from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.physics.theory import line_stiffness, loaded_frequencies
from monochord.physics.twin import (
    ContactLaw,
    Mount,
    MountMode,
    Pluck,
    Scene,
    Twin,
    advance,
    advance_many,
    begin,
    contact,
    hold,
    retouch,
)
from monochord.physics.twin import records as layout
from monochord.physics.twin.energy import energy
from monochord.physics.twin.rate import mode_frequencies, touch_weights

LOSSLESS = (
    MountMode(mass=0.005, frequency=1500.0, quality=1e13),
    MountMode(mass=0.02, frequency=4000.0, quality=1e13),
)
LOSSY = Mount(modes=tuple(replace(mode, quality=10.0) for mode in LOSSLESS), compliance=1e-6)
LAYER = ContactLaw(exponent=1.2, layer=2e-6)


def mounted_frequencies(stiffness: float, mount: Mount, count: int) -> Floats:
    """The lowest frequencies of a flexible string on a spring that stands on a mount, in Hz.

    At a frequency of the whole, the compliances of string, spring and mount at the touch add to zero:
    sin(k x) sin(k (L - x)) / (T k sin(k L)) + 1/K + R + sum 1 / (m (w_j^2 - w^2)) = 0.
    """
    string = flexible().string
    speed = np.sqrt(string.tension / string.linear_density)

    def whole(frequency: float) -> float:
        k, square = 2.0 * np.pi * frequency / speed, (2.0 * np.pi * frequency) ** 2
        total = np.sin(k * AT) * np.sin(k * (string.length - AT))
        total /= string.tension * k * np.sin(k * string.length)
        for mode in mount.modes:
            total += 1.0 / (mode.mass * ((2.0 * np.pi * mode.frequency) ** 2 - square))
        return float(total + 1.0 / stiffness + mount.compliance)

    grid = np.arange(100.0, 8000.0, 0.7)
    values = np.array([whole(f) for f in grid])
    # Each compliance rises with frequency, so that a fall is a pole and not a root.
    rising = np.flatnonzero((values[:-1] < 0.0) & (values[1:] > 0.0))[:count]
    return np.array([brentq(whole, grid[i], grid[i + 1]) for i in rising])


def test_a_string_on_a_mount_sounds_as_their_compliances_say() -> None:
    mount = Mount(modes=LOSSLESS, compliance=1e-6)
    true = mounted_frequencies(1e7, mount, 4)
    off = partials_off(sprung(1e7, mount=mount), true)
    rigid = mounted_frequencies(1e7, Mount(), 2)
    assert np.abs(off).max() < 0.1
    assert min(abs(cents(f, true[i])) for i, f in enumerate(rigid)) > 3.0


def test_a_rough_layer_is_as_stiff_as_its_load() -> None:
    force = 0.3
    law = ContactLaw(layer=1e-6, layer_load=0.01)
    series = 1.0 / (1.0 / 1e7 + 1e-6 / (force + 0.01))
    off = partials_off(
        sprung(1e7, force=force, law=law), loaded_frequencies(flexible().string, AT, series, 4)
    )
    assert np.abs(off).max() < 0.15


def test_the_law_has_its_exponent_at_one_newton_and_hertzs_compression() -> None:
    smooth = inside(begin(SENSOR, Scene(touches=(hold(0.08, 1.0, PLASTIC),))), "touches")[0]
    for exponent in (1.0, 1.1, 1.3, 1.5):
        bent = replace(hold(0.08, 1.0, PLASTIC), law=ContactLaw(exponent=exponent))
        own = inside(begin(SENSOR, Scene(touches=(bent,))), "touches")[0]
        s = contact.static_root(1.0, own.k1, own.k2)
        assert contact.stiffness(s, own.k1, own.k2) * s**2 == pytest.approx(exponent)
        assert s == pytest.approx(contact.static_root(1.0, smooth.k1, smooth.k2))
    flat = replace(hold(0.08, 1.0, PLASTIC), law=ContactLaw(flat=2e-3))
    own = inside(begin(SENSOR, Scene(touches=(flat,))), "touches")[0]
    elastic = PLASTIC.young_modulus, PLASTIC.poisson_ratio
    assert (own.k1, own.k2) == (pytest.approx(line_stiffness(STRING, 2e-3, *elastic)), 0.0)


def test_a_flat_object_feels_less_of_high_modes() -> None:
    narrow, wide = (
        inside(
            begin(SENSOR, Scene(touches=(replace(hold(0.08, 1.0, PLASTIC), law=ContactLaw(flat=w)),))),
            "weights",
        )[0]
        for w in (1e-3, 5e-3)
    )
    count = np.count_nonzero(narrow)
    k = np.pi * np.arange(1, count + 1) / STRING.length
    true = np.exp(-(k**2) * (5e-3**2 - 1e-3**2) / 24.0)
    np.testing.assert_allclose(wide[:count] / narrow[:count], true, rtol=1e-9)


@pytest.mark.parametrize(
    ("mount", "law"), [(Mount(), LAYER), (LOSSY, replace(LAYER, flat=2e-3))], ids=["layer", "all"]
)
def test_a_press_at_rest_is_what_was_prescribed(mount: Mount, law: ContactLaw) -> None:
    pressed = (replace(hold(0.08, 1.0, PLASTIC), mount=mount, law=law),)
    twin = begin(SENSOR, Scene(touches=pressed, drivers=(False, False)))
    ideal = begin(SENSOR, Scene(touches=(hold(0.08, 1.0, PLASTIC),), drivers=(False, False)))
    forces = [advance(with_touch(one, roughness=0.0), RATE)[0].labels.force[0, -1] for one in (twin, ideal)]
    assert forces[0] == pytest.approx(forces[1], rel=2e-4)
    assert forces[0] == pytest.approx(1.0, rel=0.02)


PLUCK = Pluck(position=0.07, height=1e-3)
RESTS = {"bounce": key(0.0, 0.08, 0.0, 2e-4), "press": key(0.0, 0.08, 1.0)}


def shaken(name: str, mount: Mount, law: ContactLaw, *, lossy: bool) -> Twin:
    """A plucked string without losses that meets an object, held by a mount."""
    object_ = replace(touch(RESTS[name]), mount=mount, law=law)
    scene = Scene(pluck=PLUCK, drivers=(False, False), touches=(object_,))
    twin = with_touch(begin(replace(SENSOR, losses=NONE), scene, tolerance=1e-9), roughness=0.0)
    return advance(twin if lossy else with_touch(twin, beta=0.0), 64)[1]


@pytest.mark.parametrize("name", RESTS)
@pytest.mark.parametrize("law", [LAYER, ContactLaw(flat=1e-3, layer=5e-7)], ids=["rough", "flat"])
def test_energy_goes_to_and_fro_and_stays(name: str, law: ContactLaw) -> None:
    twin = shaken(name, Mount(modes=LOSSLESS, compliance=1e-6), law, lossy=False)
    first, held = energy(twin), 0.0
    for _ in range(10):
        twin = advance(twin, RATE // 8)[1]
        held = max(held, *(0.5 * mode.mass * mode.v**2 for mode in inside(twin, "mount_modes")[0]))
        assert energy(twin) == pytest.approx(first, rel=1e-8)  # measured: 6e-10
    assert held > 1e-5 * first  # it does go to the mount


@pytest.mark.parametrize("name", RESTS)
def test_a_lossy_mount_loses_and_never_gains(name: str) -> None:
    twin = shaken(name, LOSSY, LAYER, lossy=True)
    levels = [energy(twin)]
    for _ in range(200):
        twin = advance(twin, 20)[1]
        levels.append(energy(twin))
    assert np.all(np.diff(levels) < 1e-8 * levels[0])
    assert levels[-1] < 0.99 * levels[0]


def test_what_is_almost_ideal_sounds_almost_so() -> None:
    almost = (replace(hold(0.08, 1.0, PLASTIC, across=0.02), law=ContactLaw(layer=1e-13)),)
    exact = (hold(0.08, 1.0, PLASTIC, across=0.02),)
    found, true = (
        advance(begin(SENSOR, Scene(touches=touches), seed=2), 2000)[0] for touches in (almost, exact)
    )
    np.testing.assert_allclose(found.microphones, true.microphones, atol=1e-4)
    np.testing.assert_allclose(found.labels.force, true.labels.force, atol=1e-5)


def test_however_it_is_cut_and_beside_others_it_is_the_same() -> None:
    held = replace(hold(0.08, 1.0, PLASTIC), mount=LOSSY, law=LAYER)
    twins = [
        begin(SENSOR, Scene(touches=(one,)), seed=seed)
        for seed, one in enumerate([held, hold(0.1, 0.5, FOAM), replace(held, mount=Mount())])
    ]
    whole = [advance(twin, 500) for twin in twins]
    for (take, after), (alone, _) in zip(advance_many(twins, 500), whole, strict=True):
        np.testing.assert_array_equal(take.microphones, alone.microphones)
        assert (after.plausible is None) == (after.seed == 1)
    first, half_way = advance(twins[0], 211)
    second, _ = advance(half_way, 289)
    joined = np.concatenate([first.microphones, second.microphones], axis=1)
    np.testing.assert_array_equal(joined, whole[0][0].microphones)


def test_an_object_stays_in_its_mount_when_others_come_and_go() -> None:
    held = replace(hold(0.08, 1.0, PLASTIC), mount=LOSSY)
    twin = advance(begin(SENSOR, Scene(touches=(held,))), 3000)[1]
    other = touch(key(0.05, 0.12, 0.0, 5e-3), key(0.06, 0.12, 0.0, 6e-3))
    went_on = advance(retouch(twin, (held, other)), 64)[0]
    np.testing.assert_allclose(went_on.microphones, advance(twin, 64)[0].microphones, atol=1e-6)
    assert advance(retouch(twin, ()), 64)[1].plausible is None
    again = retouch(retouch(twin, (hold(0.08, 1.0, PLASTIC),)), (held,))
    assert np.all(inside(again, "mount_modes")["q"] == 0.0)


def test_a_mount_of_four_modes_is_refused() -> None:
    with pytest.raises(InputError, match="modes"):
        Mount(modes=(MountMode(),) * 4)


K1, K2, CLEARANCE, FRAMES = 3e3, 3e5, 2e-4, 100
SOFT = Mount(
    modes=(MountMode(mass=3e-4, frequency=1500.0), MountMode(mass=2e-4, frequency=4000.0)), compliance=1e-5
)
THICK = ContactLaw(layer=2e-5, layer_load=0.05)


def bouncing(finer: int, patch: pytest.MonkeyPatch) -> Twin:
    """A flexible string that was plucked against a mounted, rough object at rest."""
    planned(patch, finer)
    resting = replace(touch(key(0.0, 0.08, 0.0, CLEARANCE)), mount=SOFT, law=THICK)
    scene = Scene(touches=(resting,), pluck=Pluck(position=0.06, height=5e-4), drivers=(False, False))
    twin = begin(replace(flexible(), pickups=SENSOR.pickups), scene, tolerance=1e-10)
    return waiting(with_touch(twin, k1=K1, k2=K2, beta=0.0, roughness=0.0))


def integrated(twin: Twin) -> Floats:
    """The same string, mount and contact as an initial value problem: q of each mode at every frame."""
    count, string, bank = twin.plan.count, twin.sensor.string, modes(twin)
    omega = mode_frequencies(string, count)
    exactness = touch_weights(omega, inside(twin, "constants").step, twin.plan.beta)
    shape = inside(twin, "weights")[0, :count] / np.sqrt(exactness)
    shape = shape * np.sin(np.arange(1, count + 1) * np.pi * 0.08 / string.length)
    mass = 0.5 * string.linear_density * string.length
    places = np.linspace(0.0, string.length, 513)
    whole = float(np.interp(0.08, places, inside(twin, "compliance")[0]))
    yielding = whole - float(np.sum(shape**2 / (mass * omega**2))) + SOFT.compliance
    held = np.array([(m.mass, 2.0 * np.pi * m.frequency, m.quality) for m in SOFT.modes]).T
    cuts = np.cumsum([count, count, held.shape[1]])

    def pressed(gap: float) -> float:
        if gap <= 0.0:
            return 0.0

        def force(s: float) -> float:
            return K1 * s**2 + K2 * s**3

        def error(s: float) -> float:
            return s**2 + yielding * force(s) + THICK.layer * np.log1p(force(s) / THICK.layer_load) - gap

        root: Any = brentq(error, 0.0, np.sqrt(gap), xtol=1e-16)
        return force(float(root))

    def rates(_: float, y: Floats) -> Floats:
        q, v, u, w = np.split(y, cuts)
        push = pressed(-CLEARANCE - float(u.sum()) - float(shape @ q))
        string_rate = shape * push / mass - omega**2 * q
        mount_rate = push / held[0] - held[1] / held[2] * w - held[1] ** 2 * u
        return np.concatenate([v, string_rate, w, mount_rate])

    start = np.zeros(2 * count + 2 * held.shape[1])
    start[:count] = bank[layout.Q, :count]
    time = np.arange(FRAMES + 1) / RATE
    solution = solve_ivp(rates, (0.0, time[-1]), start, "DOP853", time, rtol=1e-9, atol=1e-13, max_step=2e-6)
    return solution.y[[*range(count), *range(cuts[1], cuts[2])], 1:]


def test_a_bounce_on_a_mount_converges_on_the_exact_motion_at_second_order() -> None:
    errors: list[float] = []
    true: Floats | None = None
    for finer in (1, 4, 16):
        with pytest.MonkeyPatch.context() as patch:
            twin = bouncing(finer, patch)
            true = integrated(twin) if true is None else true
            found = np.zeros((18, FRAMES))
            for frame in range(FRAMES):
                twin = advance(twin, 1)[1]
                found[:16, frame] = modes(twin)[layout.Q, :16]
                found[16:, frame] = inside(twin, "mount_modes")[0]["q"][:2]
        apart = np.abs(found - true)
        errors.append(
            max(float(apart[part].max() / np.abs(true[part]).max()) for part in (slice(16), slice(16, 18)))
        )
    assert true is not None
    assert np.abs(true[16:]).max() > 1e-6  # the object is moved
    assert errors[0] < 0.03  # measured: 0.025, and 0.0001 at sixteen steps a frame
    assert np.log2(errors[0] / errors[-1]) / 4.0 == pytest.approx(2.0, abs=0.1)
