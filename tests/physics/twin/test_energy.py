"""Nothing but drivers, losses and moving objects changes the twin's energy."""

from dataclasses import replace

import numpy as np
import pytest
from tests.physics.twin.built import NONE, RATE, SENSOR, key, modes, touch, with_touch

from monochord.physics.theory import stretch_stiffness
from monochord.physics.twin import Pluck, Scene, Twin, advance, begin
from monochord.physics.twin import bank as layout
from monochord.physics.twin.energy import energy

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


def lossless(name: str, agreement: float = 1e-8) -> Twin:
    twin = with_touch(begin(LOSSLESS, SCENES[name], agreement=agreement), LOSS=0.0, ROUGH=0.0)
    return advance(twin, 64)[1]  # the objects have come to where they stay


@pytest.mark.parametrize("name", SCENES)
def test_energy_stays_over_ten_seconds(name: str) -> None:
    twin = lossless(name)
    first = energy(twin)
    for _ in range(20):
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
    twin = advance(begin(LOSSLESS, SCENES["bounce"], agreement=1e-10), 64)[1]
    levels: list[float] = []
    for _ in range(200):
        twin = advance(twin, 20)[1]
        levels.append(energy(twin))
    assert np.all(np.diff(levels) < 1e-8 * levels[0])
    assert levels[-1] < 0.99 * levels[0]
    assert np.abs(modes(twin)[layout.Q]).max() > 0.0
