"""Modes: exact free motion, steady response, and the choice of what matters."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from monochord.physics.split_string import Drive, SplitString
from monochord.physics.split_string.modes import find_modes, free_motion, plucked, response
from monochord.physics.strings import load_string

APPENDIX = load_string("appendix")
SETUP = SplitString(string=APPENDIX.string, contact=APPENDIX.contact)


@pytest.mark.parametrize("decay", [0.0, 30.0, 1999.9999999, 2000.0, 2000.1, 5e4])
def test_free_motion_solves_the_oscillator_however_damped(decay: float) -> None:
    w, time = 1000.0, 3e-3

    def slope(_: float, y: np.ndarray) -> list[float]:
        return [y[1], -decay * y[1] - w**2 * y[0]]

    moved = free_motion(np.array([w]), np.array([decay]), time)[:, 0]
    for start, columns in (([1.0, 0.0], [0, 2]), ([0.0, 1.0], [1, 3])):
        exact = solve_ivp(slope, (0.0, time), start, rtol=1e-11, atol=1e-14, method="DOP853").y[:, -1]
        assert moved[columns] == pytest.approx(exact, rel=1e-6, abs=1e-9)


def test_free_motion_composes() -> None:
    once = free_motion(np.array([4000.0]), np.array([31.0]), 1e-3)[:, 0].reshape(2, 2)
    twice = free_motion(np.array([4000.0]), np.array([31.0]), 2e-3)[:, 0].reshape(2, 2)
    assert once @ once == pytest.approx(twice, rel=1e-12)


def test_at_resonance_the_drive_balances_the_loss() -> None:
    modes = find_modes(SETUP, 44100).audible
    amplitude = response(modes, np.array([modes.frequency[0] / (2.0 * np.pi), 0.0]))
    # push sin(wt) = g q': the velocity is push / g, in phase with the drive.
    velocity = 1j * modes.frequency[0] * amplitude[0, 0]
    assert velocity == pytest.approx(modes.push[0, 0] / modes.decay[0], rel=1e-9)
    assert not amplitude[1].any()


def test_the_audible_modes_are_those_below_the_resampler_s_cut() -> None:
    string = find_modes(SETUP, 44100)
    first, second = string.counts
    assert (first, second) == (int(0.456 * 44100 / 695.006), int(0.456 * 44100 / 374.234))
    assert string.audible.frequency.max() < 2.0 * np.pi * 0.456 * 44100 < string.quick.frequency.max()


def test_a_driver_pushes_only_its_own_segment_by_the_gaussian_s_transform() -> None:
    modes = find_modes(SETUP, 44100)
    length, n = 0.2275, np.arange(1, 11)
    k = n * np.pi / length
    exact = 2e-3 / (6.5e-4 * length) * np.sin(k * length / 4.0) * np.exp(-0.5 * (k * 5e-3) ** 2)
    assert modes.audible.push[0, :10] == pytest.approx(exact, rel=1e-6, abs=1e-9)
    assert not modes.audible.push[1, : modes.counts[0]].any()


def test_no_drive_and_no_pluck_mean_silence() -> None:
    rest = find_modes(replace(SETUP, drive=Drive(amplitude=0.0)), 44100)
    assert not plucked(None, rest).any()
    assert not rest.audible.push.any()
