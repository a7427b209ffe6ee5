"""Laws that the split string must obey, and the traps of the paper's text as documented."""

from dataclasses import replace

import numpy as np
import pytest

from monochord.core.types import Contact, Floats
from monochord.physics.split_string import (
    Drive,
    PluckShape,
    Route,
    SimulatedSound,
    SplitString,
    peaks,
    simulate,
)
from monochord.physics.split_string.grid import SegmentGrid, lay_out, time_step
from monochord.physics.split_string.kernels import leapfrog
from monochord.physics.split_string.rendering import step_grid
from monochord.physics.split_string.segments import split
from monochord.physics.strings import load_string
from monochord.physics.theory import segment_frequencies

APPENDIX = load_string("appendix")
SETUP = SplitString(string=APPENDIX.string, contact=APPENDIX.contact)
UNDRIVEN = replace(SETUP, drive=Drive(amplitude=0.0))


def loudness(recording: SimulatedSound, start: float, stop: float) -> Floats:
    cut = slice(round(start * recording.sample_rate), round(stop * recording.sample_rate))
    return np.sqrt((recording.segments[:, cut] ** 2).mean(axis=1))


@pytest.mark.parametrize("route", ["fdtd", "modal"])
def test_undriven_vibration_falls_by_e_in_two_mu_over_d(route: Route) -> None:
    recording = simulate(UNDRIVEN, 0.2, route=route)
    fall = loudness(recording, 0.01, 0.09) / loudness(recording, 0.10, 0.18)
    assert 0.09 / np.log(fall) == pytest.approx([0.065, 0.065], rel=0.02)


def test_the_scheme_is_of_second_order() -> None:
    """Halve spacing and step together: the error against the exact modes falls fourfold."""
    smooth = replace(
        SETUP,
        pluck=PluckShape(width=0.03),
        drive=Drive(width=0.03, start_frequencies=(660.0, 400.0), feedback="off"),
    )
    exact = simulate(smooth, 0.02, route="modal", sample_rate=100000).segments
    errors: list[Floats] = []
    for finer in (1, 2, 4):
        grid = replace(smooth, nodes=1 + 64 * finer, time_step=10e-6 / finer)
        velocity = np.concatenate(list(step_grid(grid, 0.02, leapfrog, [])), axis=1)[:, ::finer]
        errors.append(np.sqrt(((velocity - exact) ** 2).mean(axis=1)))
    order = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert (errors[-1] > 1e-7).all()
    assert order == pytest.approx(np.full((2, 2), 2.0), abs=0.1)


def test_refining_the_grid_leads_to_the_modal_route() -> None:
    """With the feedback running; the two routes share no line of the propagation."""
    case = replace(SETUP, pluck=PluckShape(width=0.02))
    exact = simulate(case, 0.3, route="modal").segments
    coarse, fine = (
        simulate(replace(case, nodes=nodes, time_step=step), 0.3).segments
        for nodes, step in ((257, 1e-6), (513, 0.5e-6))
    )
    scale = np.sqrt((exact**2).mean(axis=1))
    errors = [np.sqrt(((each - exact) ** 2).mean(axis=1)) / scale for each in (coarse, fine)]
    assert (errors[1] < 0.006).all()
    assert errors[0] / errors[1] == pytest.approx([4.0, 4.0], rel=0.15)


@pytest.mark.parametrize("route", ["fdtd", "modal"])
def test_turning_the_string_round_swaps_the_channels(route: Route) -> None:
    length = APPENDIX.string.length
    here, there = (
        simulate(replace(SETUP, contact=Contact(position=x, force=0.7)), 0.15, route=route)
        for x in (0.24, length - 0.24)
    )
    scale = np.abs(here.microphones).max()
    assert np.abs(here.microphones - there.microphones[::-1]).max() < 1e-9 * scale


@pytest.mark.parametrize("route", ["fdtd", "modal"])
def test_an_untouched_string_sounds_at_its_fundamental_and_hears_no_difference(route: Route) -> None:
    middle = replace(SETUP, contact=None, pluck=PluckShape(place=0.5))
    recording = simulate(middle, 0.4, route=route)
    assert peaks(recording) == pytest.approx((243.25, 243.25), rel=1e-3)
    difference = np.abs(recording.segments[0] - recording.segments[1]).max()
    assert difference < 1e-6 * np.abs(recording.segments).max()


def energy(grid: SegmentGrid, courant: float) -> float:
    """The scheme's own energy, of both steps at hand, up to a constant factor."""
    motion = ((grid.now - grid.before) ** 2).sum()
    return motion + courant**2 * (np.diff(grid.now) * np.diff(grid.before)).sum()


@pytest.mark.parametrize("damping", [0.0, 0.02])
def test_energy_stays_without_loss_and_only_falls_with_it(damping: float) -> None:
    string = replace(APPENDIX.string, damping=damping)
    setup = replace(UNDRIVEN, string=string)
    segment = split(setup)[0]
    grid = lay_out(setup, segment)
    courant = segment.speed * time_step(setup) / segment.spacing
    history: list[float] = []
    for _ in range(200):
        grid.step(leapfrog, np.zeros((2, 501)), np.zeros((2, 501)))
        history.append(energy(grid, courant))
    if damping == 0.0:
        assert history == pytest.approx([history[0]] * 200, rel=1e-9)
    else:
        assert (np.diff(history) < 0.0).all()
        assert history[-1] / history[0] == pytest.approx(np.exp(-2.0 * 199 * 501e-6 / 0.065), rel=0.02)


def test_trap_damping_as_printed_is_overdamped() -> None:
    printed = replace(UNDRIVEN, damping="printed")
    assert 2.0 / split(printed)[0].decay_rate == pytest.approx(58e-6, rel=0.01)
    crossings = [
        np.count_nonzero(np.diff(np.sign(simulate(setup, 0.02, route="modal").segments[0])))
        for setup in (UNDRIVEN, printed)
    ]
    assert crossings[0] > 20
    assert crossings[1] <= 3
    finer = split(replace(printed, nodes=511))[0]
    assert finer.decay_rate == pytest.approx(2.0 * split(printed)[0].decay_rate)


def test_trap_a_printed_profile_is_driven_harder_on_a_finer_mesh() -> None:
    def steady(profile: str, nodes: int) -> Floats:
        drive = Drive(start_frequencies=(690.0, 370.0), feedback="off", profile=profile)  # pyright: ignore[reportArgumentType]
        setup = replace(SETUP, initial="rest", nodes=nodes, drive=drive)
        return loudness(simulate(setup, 0.05, route="fdtd"), 0.02, 0.05)

    assert steady("normalised", 255) == pytest.approx(steady("normalised", 128), rel=2e-3)
    assert steady("printed", 255) == pytest.approx(2.0 * steady("printed", 128), rel=2e-3)


def test_trap_both_drivers_led_by_one_microphone_leave_a_segment_to_die() -> None:
    literal = replace(SETUP, drive=Drive(feedback="literal"))
    own, led = (loudness(simulate(setup, 0.6, route="modal"), 0.5, 0.6) for setup in (SETUP, literal))
    assert (led / own).min() < 0.1
    assert (led / own).max() > 0.9


def test_trap_the_bare_maximum_is_content_off_resonance_and_closing_the_phase_is_not() -> None:
    started, resonant = np.array([692.0, 372.0]), np.array([695.006, 374.234])
    away: list[Floats] = []
    for pull in (0.0, 0.5):
        drive = Drive(start_frequencies=(692.0, 372.0), pull=pull)
        tones = simulate(replace(SETUP, initial="rest", drive=drive), 2.0, route="modal").drive_frequencies
        away.append(np.abs(tones[:, -1] - resonant) / (resonant - started))
        assert np.abs(tones[:, -1] - tones[:, -50]) == pytest.approx([0.0, 0.0], abs=0.05)
    assert (away[0] > 0.4).all()
    assert (away[1] < 0.05).all()


def test_trap_a_printed_phase_jumps_when_the_frequency_changes() -> None:
    """A jump of phase is a click: it lifts the spectrum far from every line."""
    start = Drive(start_frequencies=(690.0, 371.0))
    steps: list[float] = []
    for phase in ("accumulated", "printed"):
        drive = replace(start, phase=phase)
        recording = simulate(replace(SETUP, initial="rest", drive=drive), 1.0, route="modal")
        steps.append(float(loudness(recording, 0.6, 1.0)[0]))
    # Jumps at every hop push out of step, and the string never reaches the amplitude of a steady drive.
    assert steps[1] < 0.9 * steps[0]


@pytest.mark.parametrize("share", [1.0, 0.5])
def test_a_driven_segment_sounds_above_its_own_frequency_by_half_over_q_squared(share: float) -> None:
    bass = load_string("bass_100")
    string = replace(bass.string, damping=share * bass.string.damping)
    contact = bass.usual_contact
    frequencies = peaks(simulate(SplitString(string=string, contact=contact), 2.0, route="modal"), settle=1.0)
    for frequency, own in zip(frequencies, segment_frequencies(string, contact), strict=True):
        quality = 2.0 * np.pi * own * string.linear_density / string.damping
        assert frequency / own - 1.0 == pytest.approx(0.5 / quality**2, rel=0.1)
