"""Contacts that are wide or resist turning: against a stiff string by finite elements, and by energy."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from tests.physics.twin.beam import beam_frequencies
from tests.physics.twin.built import (
    AT,
    NONE,
    PLASTIC,
    QUIET,
    RATE,
    SENSOR,
    STRING,
    changed,
    inside,
    key,
    modes,
    partials_off,
    touch,
    with_touch,
)

from monochord.core.errors import InputError
from monochord.physics.materials import load_material
from monochord.physics.theory import (
    bending_stiffness,
    edge_distance,
    line_stiffness,
    mutual_compliance,
    static_compliance,
    tension_from_segments,
    turning_compliance,
    turning_stiffness,
)
from monochord.physics.twin import (
    ContactLaw,
    Mount,
    MountMode,
    Pluck,
    Scene,
    Twin,
    advance,
    begin,
    hold,
    retouch,
)
from monochord.physics.twin import records as layout
from monochord.physics.twin.energy import energy

FIRM = replace(STRING, tension_per_force=0.0)
"""The prototype's stiff string, whose tension no press raises."""
STEEL = load_material("allen_key")
STIFF = 1e10
"""Of a contact, in N/m: firm beside any string."""


def held(law: ContactLaw) -> Twin:
    """A stiff string without losses, firmly pressed at `AT` with 1 N, at rest but for a slight stir."""
    sensor = replace(SENSOR, string=FIRM, losses=NONE, pickups=replace(QUIET, low=300.0))
    pressed = replace(hold(AT, 1.0, STEEL), law=law)
    twin = begin(sensor, Scene(touches=(pressed,), drivers=(False, False), tension_law="linear"))
    damped = modes(twin).copy()
    damped[layout.DECAY] = 300.0
    twin = with_touch(changed(twin, bank=damped), beta=0.0, roughness=0.0, k1=STIFF, k2=0.0)
    twin = advance(twin, 345 * layout.CONTROL_PERIOD)[1]  # to a control update, which tunes it again
    stirred, n = modes(twin).copy(), np.arange(twin.plan.count)
    stirred[layout.DECAY] = 0.0
    stirred[layout.V, : n.size] += 1e-4 / (n + 1) * np.cos(n)
    return changed(twin, bank=stirred)


@pytest.mark.parametrize(
    ("width", "most"),
    [(3e-4, 0.8), pytest.param(1e-3, 0.8, marks=pytest.mark.slow), (2e-3, 1.0), (4e-3, 1.2)],
)
def test_both_segments_end_at_the_edges_of_a_wide_clamp(width: float, most: float) -> None:
    # In cents, of six partials; 4 mm shorten the segments by 30 and more.
    twin = held(ContactLaw(flat=width, width=width))
    half = float(inside(twin, "turnings")[0].half)
    assert half == pytest.approx(0.5 * width, rel=0.02 if width > 1e-3 else 0.45)
    off = partials_off(twin, beam_frequencies(FIRM, 6, pins=(AT - half, AT + half)))
    assert np.abs(off).max() < most


@pytest.mark.parametrize("arm", [5e-3, pytest.param(0.1, marks=pytest.mark.slow), 1.0])
def test_a_contact_resists_turning_as_a_spring_does(arm: float) -> None:
    # The press is 1 N: as many N m/rad as the arm has metres, and a little more as the string is bent.
    twin = held(ContactLaw(arm=arm))
    turning = float(inside(twin, "turnings")[0].arm)
    assert turning == pytest.approx(min(10.0 * arm, turning_stiffness(FIRM, arm, 1.0)))
    true = beam_frequencies(FIRM, 6, pins=(AT,), turning={AT: turning})
    assert np.abs(partials_off(twin, true)).max() < 0.6
    assert np.all(true > beam_frequencies(FIRM, 6, pins=(AT,)))


def test_a_stiff_string_ends_where_theory_says() -> None:
    # Far from the ends a support shortens each segment by sqrt(E I / T) times a share of its turning, for low
    # partials: k / (k + 2 sqrt(E I T)) of what a clamp does, averaged over both ways in which it may turn.
    reach = np.sqrt(bending_stiffness(FIRM) / FIRM.tension)
    middle, speed = 0.5 * FIRM.length, np.sqrt(FIRM.tension / FIRM.linear_density)
    for stiffness, share in ((0.0, 0.0), (0.05, 0.05 / (0.05 + 2.0 * FIRM.tension * reach)), (1e6, 1.0)):
        first, second = beam_frequencies(FIRM, 2, pins=(middle,), turning={middle: stiffness})
        shorter = middle - speed / (2.0 * np.array([first, second]))
        # The even mode does not turn the contact, the odd one does with all of its slope.
        assert np.diff(shorter)[0] == pytest.approx((1.0 - share) * reach, rel=0.03)


def reads(**supports: Any) -> float:
    """The tension in N that T = mu (2 L f1 f2 / (f1 + f2))^2 gives for the string with these supports."""
    second, first = beam_frequencies(FIRM, 2, element=1e-3, **supports)
    return float(tension_from_segments(FIRM, first, second))


def line(width: float, stiffness: float) -> dict[float, float]:
    """An elastic line of contact, as springs in N/m side by side."""
    count = max(9, round(width / 1e-4)) | 1
    places = AT + width * ((np.arange(count) + 0.5) / count - 0.5)
    return dict.fromkeys(places.tolist(), stiffness / count)


@pytest.mark.parametrize("name", ["wood", "plastic", "allen_key"])
def test_an_elastic_line_holds_the_string_as_two_edges_do(name: str) -> None:
    material = load_material(name)
    for width in (3e-4, 1e-3, 3e-3):
        whole = line_stiffness(FIRM, width, material.young_modulus, material.poisson_ratio)
        half = 0.5 * edge_distance(FIRM, width, whole)
        edges = reads(springs={AT - half: 0.5 * whole, AT + half: 0.5 * whole})
        assert edges == pytest.approx(reads(springs=line(width, whole)), abs=0.2)


def test_width_and_turning_read_as_tension() -> None:
    """What a wide contact and one that resists turning read more than a point does, in N."""
    point = reads(pins=(AT,))
    by_width = {
        name: [
            reads(springs=line(w, whole)) - reads(springs={AT: whole})
            for w in (3e-4, 1e-3, 3e-3)
            for whole in [line_stiffness(FIRM, w, material.young_modulus, material.poisson_ratio)]
        ]
        for name in ("plastic", "allen_key")
        for material in [load_material(name)]
    }
    by_turning = [reads(pins=(AT,), turning={AT: k}) - point for k in (1e-3, 3e-3, 1e-2, 1e3)]
    assert by_width["plastic"] == pytest.approx([0.02, 0.47, 1.83], abs=0.03)
    assert by_width["allen_key"] == pytest.approx([0.37, 0.92, 2.28], abs=0.03)
    # A round object of radius R resists with F R; what turns not at all reads half a newton more.
    assert by_turning == pytest.approx([0.005, 0.015, 0.047, 0.52], abs=0.02)


LOSSLESS = Mount(modes=(MountMode(mass=0.005, frequency=1500.0, quality=1e13),), compliance=1e-6)
LAWS = {
    "flat": ContactLaw(flat=2e-3, width=2e-3, layer=5e-7),
    "round": ContactLaw(exponent=1.2, arm=0.02),
    "all": ContactLaw(flat=1e-3, width=1e-3, arm=0.5, layer=1e-6),
}
RESTS = {"press": key(0.0, 0.08, 1.0), "bounce": key(0.0, 0.08, 0.0, 2e-4)}


def shaken(law: ContactLaw, rest: str) -> Twin:
    """A plucked string without losses that meets an object."""
    object_ = replace(touch(RESTS[rest]), mount=LOSSLESS, law=law)
    scene = Scene(pluck=Pluck(position=0.07, height=1e-3), drivers=(False, False), touches=(object_,))
    twin = begin(replace(SENSOR, losses=NONE), scene, tolerance=1e-9)
    return advance(with_touch(twin, roughness=0.0, beta=0.0), 64)[1]


def stirred(law: ContactLaw, press_tension: float = 0.0) -> Twin:
    """A string without losses that lies on an object, and never leaves it as it swings."""
    object_ = replace(touch(RESTS["press"]), mount=LOSSLESS, law=law)
    sensor = replace(SENSOR, losses=NONE, press_tension=press_tension)
    twin = begin(sensor, Scene(drivers=(False, False), touches=(object_,)), tolerance=1e-9)
    damped = modes(twin).copy()
    damped[layout.DECAY] = 300.0
    twin = with_touch(changed(twin, bank=damped), beta=0.0, roughness=0.0)
    twin = advance(twin, 345 * layout.CONTROL_PERIOD)[1]
    free, n = modes(twin).copy(), np.arange(twin.plan.count)
    free[layout.DECAY] = 0.0
    free[layout.V, : n.size] += 0.1 / (n + 1) * np.cos(n)
    return advance(changed(twin, bank=free), 64)[1]


@pytest.mark.parametrize(("name", "press_tension"), [*((name, 0.0) for name in LAWS), ("round", 0.3)])
def test_energy_goes_to_the_turning_and_comes_back(name: str, press_tension: float) -> None:
    twin = stirred(LAWS[name], press_tension)
    first, most = energy(twin), 0.0
    for _ in range(20):
        twin = advance(twin, 500)[1]
        own = inside(twin, "turnings")[0]
        most = max(most, 0.5 * float(own.stiffness) * float(own.deflection) ** 2)
        assert energy(twin) == pytest.approx(first, rel=1e-8)
    assert most > 1e-7 * first


@pytest.mark.parametrize("name", LAWS)
def test_a_contact_that_comes_and_goes_never_gains(name: str) -> None:
    twin = shaken(LAWS[name], "bounce")
    levels = [energy(twin)]
    for _ in range(200):
        twin = advance(twin, 20)[1]
        levels.append(energy(twin))
    assert np.all(np.diff(levels) < 1e-8 * levels[0])


def test_a_share_of_the_press_is_tension() -> None:
    # 0.3 N of tension a newton of press, beside the geometric law's rise of some 0.3 N.
    twins = [
        begin(
            replace(SENSOR, press_tension=more),
            Scene(touches=(hold(0.1, 1.0, PLASTIC),), drivers=(False, False)),
        )
        for more in (0.0, 0.3)
    ]
    tensions = [float(inside(advance(twin, RATE // 4)[1], "memory").tuned_tension) for twin in twins]
    assert tensions[1] - tensions[0] == pytest.approx(0.3, abs=0.002)


def test_a_turn_goes_on_when_others_come() -> None:
    pressed = replace(hold(0.08, 1.0, PLASTIC), law=LAWS["flat"])
    twin = advance(begin(SENSOR, Scene(touches=(pressed,))), 3000)[1]
    other = touch(key(0.05, 0.12, 0.0, 5e-3), key(0.06, 0.12, 0.0, 6e-3))
    went_on = advance(retouch(twin, (pressed, other)), 64)[0]
    np.testing.assert_allclose(went_on.microphones, advance(twin, 64)[0].microphones, atol=1e-6)


def test_closed_forms_agree() -> None:
    n = np.arange(1, 40001) * np.pi / FIRM.length
    square = (FIRM.tension + bending_stiffness(FIRM) * n**2) * n**2 * FIRM.length / 2.0
    for x in (0.004, 0.05, 0.1):
        assert turning_compliance(FIRM, x) == pytest.approx(
            np.sum((n * np.cos(n * x)) ** 2 / square), rel=3e-3
        )
        assert turning_compliance(FIRM, x, 1e-4) == pytest.approx(turning_compliance(FIRM, x), rel=0.06)
        assert mutual_compliance(FIRM, x, x) == pytest.approx(static_compliance(FIRM, x))
        for y in (0.1, 0.19):
            true = np.sum(np.sin(n * x) * np.sin(n * y) / square)
            assert mutual_compliance(FIRM, x, y) == pytest.approx(true, rel=1e-6)
            assert mutual_compliance(FIRM, y, x) == mutual_compliance(FIRM, x, y)
    flexible = replace(FIRM, core_diameter=0.0)
    assert turning_compliance(flexible, 0.1) == np.inf
    assert turning_compliance(flexible, 0.1, 1e-3) == pytest.approx(1.0 / (FIRM.tension * 1e-3), rel=0.02)


def test_a_round_object_turns_with_its_radius() -> None:
    found = turning_stiffness(FIRM, 5e-3, np.array([0.0, 1e-3, 1.0, 100.0]))
    assert found[:2] == pytest.approx([0.0, 5e-6], rel=1e-3)
    assert found[2] == pytest.approx(5.26e-3, rel=1e-2)
    assert found[3] == np.inf
    with pytest.raises(InputError, match="radius"):
        turning_stiffness(FIRM, 0.0, 1.0)


def test_what_is_off_is_left_out_of_the_kernel() -> None:
    assert begin(SENSOR, Scene(touches=(hold(AT, 1.0, PLASTIC),))).plausible is None
    for law in (ContactLaw(arm=1e-3), ContactLaw(flat=1e-3, width=1e-3)):
        pressed = replace(hold(AT, 1.0, PLASTIC), law=law)
        assert begin(SENSOR, Scene(touches=(pressed,))).plausible is not None
    assert begin(replace(SENSOR, press_tension=0.1)).plausible is not None


def test_an_edge_beyond_the_end_is_refused() -> None:
    wide = replace(hold(0.006, 1.0, PLASTIC), law=ContactLaw(flat=8e-3, width=8e-3))
    with pytest.raises(InputError, match="touch at"):
        begin(SENSOR, Scene(touches=(wide,)))
