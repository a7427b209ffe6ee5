"""Segments, their modes, and their grid."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from monochord.core.errors import InputError
from monochord.core.types import Contact, Floats
from monochord.physics.split_string import Drive, PluckShape, SplitString, grid, kernels, simulate
from monochord.physics.split_string.grid import lay_out, leapfrog, time_step
from monochord.physics.split_string.kernels import ring
from monochord.physics.split_string.modes import find_modes, free_motion, plucked, response
from monochord.physics.split_string.segments import (
    drive_density,
    gaussian_modes,
    pluck_amplitudes,
    split,
    support,
)
from monochord.physics.strings import load_string
from monochord.physics.theory import geometric_tension, segment_frequencies

STRING = load_string("appendix").string


def test_a_touch_makes_two_segments_with_the_closed_form_fundamentals() -> None:
    contact = Contact(position=0.2275, force=1.5)
    first, second = split(SplitString(string=STRING, contact=contact))
    fundamentals = [segment.speed / (2.0 * segment.length) for segment in (first, second)]
    assert fundamentals == pytest.approx(segment_frequencies(STRING, contact), rel=1e-12)
    assert (first.channels, second.channels) == (slice(0, 1), slice(1, 2))
    assert (second.origin, second.direction) == (STRING.length, -1)


def test_an_untouched_string_is_one_segment_that_carries_both_ends_mirrored() -> None:
    (whole,) = split(SplitString(string=STRING))
    assert whole.length == STRING.length
    assert whole.pickups == pytest.approx((0.25 * 0.65, 0.75 * 0.65))
    assert whole.channels == slice(0, 2)


def test_the_geometric_law_sets_the_speed() -> None:
    string, contact = load_string("plain_010").string, Contact(position=0.2, force=2.0)
    first, _ = split(SplitString(string=string, contact=contact, tension_law="geometric"))
    tension = geometric_tension(string, 0.2, 2.0)
    assert first.speed**2 * string.linear_density == pytest.approx(tension, rel=1e-12)


@pytest.mark.parametrize("place", [0.25, 0.01])
def test_a_normalised_driver_pushes_with_its_amplitude_wherever_it_stands(place: float) -> None:
    drive = Drive(amplitude=0.003, place=place)
    segment, _ = split(SplitString(string=STRING, contact=Contact(position=0.2, force=0.0), drive=drive))
    nodes, weights = support(drive, segment, segment.drivers[0])
    assert weights @ drive_density(drive, segment, segment.drivers[0], nodes) == pytest.approx(
        0.003, rel=1e-9
    )


def test_a_printed_driver_pushes_its_middle_node_with_its_amplitude() -> None:
    drive = Drive(amplitude=0.003, profile="printed")
    segment, _ = split(SplitString(string=STRING, contact=Contact(position=0.2, force=0.0), drive=drive))
    middle = np.array([segment.drivers[0]])
    force = drive_density(drive, segment, segment.drivers[0], middle) * segment.spacing
    assert force == pytest.approx(0.003)


def test_a_pluck_sums_to_its_rounded_triangle() -> None:
    pluck = PluckShape(height=1e-3, place=0.3, width=1e-3)
    (whole,) = split(SplitString(string=STRING))
    count = gaussian_modes(pluck.width, whole.length)
    places = np.array([0.0, 0.1, 0.3, 0.8]) * whole.length
    waves = np.sin(np.outer(places, np.arange(1, count + 1)) * np.pi / whole.length)
    shape = waves @ pluck_amplitudes(pluck, whole, count)
    assert shape[[0, 1, 3]] == pytest.approx([0.0, 1e-3 / 3.0, 1e-3 * 2.0 / 7.0], rel=1e-6, abs=1e-12)
    assert 0.99e-3 < shape[2] < 1e-3  # the tip alone is rounded


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
    assert string.audible.frequency.max() < 2.0 * np.pi * 0.456 * 44100 < string.ultrasonic.frequency.max()


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


GRIDDED = SplitString(
    string=APPENDIX.string, contact=APPENDIX.contact, nodes=101, pluck=PluckShape(width=1e-3)
)


def test_a_plucked_segment_starts_as_a_triangle_at_rest() -> None:
    grid = lay_out(GRIDDED, split(GRIDDED)[0])
    assert grid.now.max() == pytest.approx(GRIDDED.pluck.height, rel=0.02)
    assert np.argmax(grid.now) == 40
    assert grid.now[20] == pytest.approx(GRIDDED.pluck.height / 2.0, rel=1e-6)
    silent, outputs = np.zeros((2, 2)), np.zeros((2, 2))
    grid.step(leapfrog, silent, outputs)
    assert abs(outputs[0, 0]) < 1e-12 * GRIDDED.pluck.height  # y(dt) = y(-dt)
    assert outputs[1].tolist() == [0.0, 0.0]  # the other segment's ear is left alone


def test_the_newest_displacement_is_at_hand_after_odd_and_even_numbers_of_steps() -> None:
    whole, parted = (lay_out(GRIDDED, split(GRIDDED)[0]) for _ in range(2))
    outputs = np.zeros((2, 6))
    whole.step(leapfrog, np.zeros((2, 6)), outputs)
    again = [np.zeros((2, n)) for n in (1, 3, 2)]
    for part in again:
        parted.step(leapfrog, np.zeros_like(part), part)
    assert parted.now.tolist() == whole.now.tolist()
    assert np.concatenate(again, axis=1).tolist() == outputs.tolist()


def test_an_unstable_step_is_refused_with_its_limit_and_the_remedy_works() -> None:
    limit = 0.95 * (0.2275 / 100) / 316.2278
    wild = replace(GRIDDED, time_step=limit * 1.0001)
    with pytest.raises(InputError, match=rf"below {limit:.4g} s = 0.95 dxi/v.*at most 100 nodes") as refusal:
        time_step(wild)
    assert "\n" not in str(refusal.value)
    for part in ("--set time_step=1e-06", "--route modal"):
        assert part in str(refusal.value)
    assert time_step(replace(wild, nodes=100)) == wild.time_step
    assert time_step(replace(GRIDDED, time_step=limit * 0.9999)) == limit * 0.9999


@pytest.mark.parametrize(
    ("nodes", "step"), [(8, 1e-6), (256, 1e-6), (1001, 1e-6 / 2), (5001, 1e-6 / 8), (60001, 1e-6 / 88)]
)
def test_a_step_left_open_is_the_appendixs_or_a_whole_fraction_of_it(nodes: int, step: float) -> None:
    assert time_step(replace(GRIDDED, nodes=nodes)) == pytest.approx(step, rel=1e-12)


def test_a_grid_too_fine_for_any_step_is_refused() -> None:
    close = replace(GRIDDED, contact=Contact(position=1e-4, force=0.0))
    with pytest.raises(InputError, match=r"steps of 1e-08 s or more; set fewer nodes, or take --route modal"):
        time_step(close)


def test_modes_ring_as_their_exact_motion_says() -> None:
    random = np.random.default_rng(0)
    frequency, decay = random.uniform(1e3, 1e5, 23), np.full(23, 40.0)
    shape, q, v = random.standard_normal((2, 23)), random.standard_normal(23), random.standard_normal(23)
    outputs = np.ones((2, 50))
    q_after, v_after = q.copy(), v.copy()
    ring(free_motion(frequency, decay, 1e-5), shape, q_after, v_after, outputs)
    for sample in (0, 1, 49):
        moved = free_motion(frequency, decay, sample * 1e-5)
        assert outputs[:, sample] == pytest.approx(1.0 + shape @ (moved[2] * q + moved[3] * v), rel=1e-9)
    moved = free_motion(frequency, decay, 50e-5)
    assert q_after == pytest.approx(moved[0] * q + moved[1] * v, rel=1e-8, abs=1e-10)


def test_a_driven_node_moves_by_its_load_times_the_signal() -> None:
    now, before = np.zeros(5), np.zeros(5)
    load = np.array([[0.0, 0.0, 3.0, 0.0, 9.0]])
    outputs = np.zeros((1, 1))
    leapfrog(now, before, (1.0, 0.5, -1.0), load, np.array([[0.5]]), np.array([1]), np.array([0.5]), outputs)
    assert before.tolist() == [0.0, 0.0, 1.5, 0.0, 0.0]  # the ends are fixed, whatever pushes them
    assert outputs.item() == 0.75  # half of node 1 and half of node 2


def test_a_standing_wave_of_the_grid_turns_by_the_scheme_s_own_frequency() -> None:
    courant, nodes, steps = 0.8, 17, 40
    shape = np.sin(np.pi * np.arange(nodes) / (nodes - 1))
    shape[-1] = 0.0
    turn = 2.0 * np.arcsin(courant * np.sin(np.pi / (nodes - 1) / 2.0))
    now, before = shape.copy(), shape * np.cos(turn)
    coefficients = (2.0 - 2.0 * courant**2, courant**2, -1.0)
    silent, outputs = np.zeros((1, steps)), np.zeros((1, steps))
    leapfrog(now, before, coefficients, np.zeros((1, nodes)), silent, np.array([8]), np.zeros(1), outputs)
    assert now == pytest.approx(shape * np.cos(turn * steps), abs=1e-13)


def state(drivers: int, nodes: int = 64, steps: int = 301) -> list[Floats]:
    random = np.random.default_rng(drivers)
    now, before = random.standard_normal((2, nodes)) * 1e-4
    now[[0, -1]] = before[[0, -1]] = 0.0
    loads = random.standard_normal((drivers, nodes)) * 1e-7
    return [now, before, loads, random.uniform(-1.0, 1.0, (drivers, steps)), np.empty((drivers, steps))]


@pytest.mark.parametrize("drivers", [1, 2])
def test_both_kernels_agree_to_rounding(drivers: int) -> None:
    results: list[Floats] = []
    for kernel in (grid.leapfrog, kernels.leapfrog):
        now, before, loads, signals, outputs = state(drivers)
        nodes, weights = np.array([13, 40][:drivers]), np.array([0.25, 0.9][:drivers])
        kernel(now, before, (1.3, 0.349, -0.999), loads, signals, nodes, weights, outputs)
        results.append(np.concatenate((now, before, outputs.ravel())))
    assert np.abs(results[0]).max() > 1e-5
    assert results[1] == pytest.approx(results[0], rel=1e-12, abs=1e-17)


@pytest.mark.parametrize("contact", [Contact(position=0.2275, force=1.0), None])
def test_the_whole_simulation_agrees_to_rounding(contact: Contact | None) -> None:
    setup = SplitString(
        string=STRING,
        contact=contact,
        nodes=96,
        time_step=5e-6,
        drive=Drive(start_frequencies=(700.0, 370.0), window=0.02, hop=0.01),
    )
    slow, fast = (simulate(setup, 0.06, route=route) for route in ("reference", "fdtd"))
    scale = np.abs(slow.microphones).max()
    assert scale > 0.1
    assert np.abs(fast.microphones - slow.microphones).max() < 1e-11 * scale
    assert fast.drive_frequencies == pytest.approx(slow.drive_frequencies, rel=1e-11)
