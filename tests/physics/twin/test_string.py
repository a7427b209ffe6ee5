"""Modes are carried exactly; an extra tension is taken at the mean position."""

import numpy as np
import pytest
from tests.physics.twin.built import SENSOR, changed, modes

from monochord.core.types import Floats
from monochord.physics.twin import Pluck, Scene, Twin, advance, begin
from monochord.physics.twin import bank as layout

FREE = Scene(pluck=Pluck(position=0.07, height=1e-4), drivers=(False, False), tension_law="linear")


def exact(bank: Floats, time: float, tension: float) -> Floats:
    """q of every mode that was let go from rest."""
    square, sigma = bank[layout.PULL] * tension + bank[layout.BEND], bank[layout.SIGMA]
    ring = np.sqrt(np.maximum(square - sigma**2, 1.0))
    swing = np.cos(ring * time) + sigma / ring * np.sin(ring * time)
    return bank[layout.Q] * np.exp(-sigma * time) * swing


def test_free_modes_follow_their_closed_solution() -> None:
    twin = begin(SENSOR, FREE)
    after = advance(twin, 3000)[1]
    true = exact(modes(twin), 3000 / 44100, SENSOR.string.tension)
    np.testing.assert_allclose(modes(after)[layout.Q], true, atol=1e-12 * np.abs(true).max())


def test_padding_stays_at_rest() -> None:
    twin = advance(begin(SENSOR, FREE, finer=2), 500)[1]
    resting = modes(twin)[layout.PULL] == 0.0
    assert np.all(modes(twin)[layout.Q, resting] == 0.0)


def test_a_static_push_gives_the_static_compliance() -> None:
    # A uniform acceleration of the frame, held for long: each mode comes to rest at F / (m omega^2).
    def settled(twin: Twin) -> Twin:
        bank = modes(twin).copy()
        bank[layout.SIGMA] = 500.0
        return advance(changed(twin, bank=bank), 6000)[1]

    from monochord.physics.twin import Outside

    steady = Outside(samples=np.ones(1, np.float32))
    twin = settled(begin(SENSOR, Scene(outside=steady, drivers=(False, False), tension_law="linear")))
    bank, string = modes(twin), SENSOR.string
    square = bank[layout.PULL] * string.tension + bank[layout.BEND]
    ringing = square > 0.0
    push = bank[layout.FRAME, ringing] * SENSOR.shake / (0.5 * string.linear_density * string.length)
    np.testing.assert_allclose(bank[layout.Q, ringing], push / square[ringing], rtol=1e-6, atol=1e-15)


def test_a_large_swing_sounds_higher() -> None:
    # One mode of Kirchhoff's string is Duffing's: its tension rises by E A (pi q / (2 L))^2 at q, of
    # which the frequency feels three quarters at the amplitude.
    from dataclasses import replace

    from tests.physics.twin.built import NONE, QUIET, RATE, cents, frequency

    from monochord.physics.theory import stretch_stiffness

    amplitude, string = 2e-3, SENSOR.string
    twin = begin(replace(SENSOR, losses=NONE, pickups=QUIET), Scene(drivers=(False, False)))
    bank = modes(twin).copy()
    bank[layout.Q, 0] = amplitude
    from tests.physics.twin.built import moving

    memory = moving(twin)["memory"].copy()
    memory[1] = bank[layout.STRETCH, 0] * amplitude**2
    twin = changed(twin, bank=bank, memory=memory)
    sound = advance(twin, RATE)[0].microphones[0].astype(np.float64)
    square = bank[layout.PULL, 0] * string.tension + bank[layout.BEND, 0]
    extra = stretch_stiffness(string) * (np.pi * amplitude / (2.0 * string.length)) ** 2
    true = np.sqrt(square + 0.75 * bank[layout.PULL, 0] * extra) / (2.0 * np.pi)
    assert cents(true, np.sqrt(square) / (2.0 * np.pi)) > 20.0
    assert cents(frequency(sound, true), true) == pytest.approx(0.0, abs=0.3)
