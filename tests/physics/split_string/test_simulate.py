"""From a setup to a recording and its peaks, against closed forms and the readable route; what is refused."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from monochord.core.errors import InputError
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
from monochord.physics.split_string.grid import time_step
from monochord.physics.split_string.modes import free_motion
from monochord.physics.split_string.rendering import _resample
from monochord.physics.split_string.setup import Damping
from monochord.physics.strings import load_string
from monochord.physics.theory import mixing_matrix, segment_frequencies

APPENDIX = load_string("appendix")
STRING = APPENDIX.string
SETUP = SplitString(string=STRING, contact=APPENDIX.contact)


@pytest.mark.parametrize("route", ["fdtd", "modal"])
def test_the_appendix_case_peaks_where_theory_says(route: Route) -> None:
    recording = simulate(SETUP, 0.4, route=route)
    assert recording.microphones.shape == (2, 17640)
    assert peaks(recording) == pytest.approx((695.0, 374.2), rel=1e-3)
    steady = np.abs(recording.segments[:, 13230:15435])  # 300-350 ms
    assert (steady.max(axis=1) > 0.05).all()
    assert steady[:, :1100].max(axis=1) == pytest.approx(steady[:, 1100:].max(axis=1), rel=0.03)
    assert np.isnan(recording.drive_frequencies[:, :2]).all()  # a whole window must be heard first
    assert recording.drive_frequencies[:, -1] == pytest.approx((695.0, 374.2), rel=1e-3)
    assert recording.drive_frequencies.shape == (2, 20)


@pytest.mark.parametrize("sample_rate", [16000, 48000])
@pytest.mark.parametrize("law", ["linear", "geometric"])
def test_the_peaks_follow_the_touch_at_any_rate_by_either_law(sample_rate: int, law: str) -> None:
    string = STRING if law == "linear" else load_string("plain_010").string
    contact = Contact(position=0.3 * string.length, force=2.0)
    setup = SplitString(string=string, contact=contact, tension_law=law)  # pyright: ignore[reportArgumentType]
    measured = peaks(simulate(setup, 0.4, route="modal", sample_rate=sample_rate))
    expected = segment_frequencies(string, contact, law)  # pyright: ignore[reportArgumentType]
    assert measured == pytest.approx(expected, rel=1e-3)


def modes_of(length: float) -> tuple[Floats, Floats, float, float]:
    """Wavenumbers and angular frequencies of a segment's modes, their loss in 1/s, and mu L / 2."""
    k: Floats = np.arange(1.0, 400.0) * np.pi / length
    density = STRING.linear_density
    return k, k * np.sqrt(STRING.tension / density), STRING.damping / density, 0.5 * density * length


@pytest.mark.parametrize("damping", ["continuous", "printed"])
def test_a_plucked_segment_sounds_as_the_sum_of_its_modes(damping: Damping) -> None:
    pluck = PluckShape(height=2e-4, place=0.3, width=0.02)
    setup = replace(SETUP, pluck=pluck, drive=Drive(amplitude=0.0), damping=damping)
    sound, time = simulate(setup, 0.02, route="modal").segments, np.arange(882) / 44100.0
    for heard, length in zip(sound, (0.2275, 0.4225), strict=True):
        k, w, loss, _ = modes_of(length)
        loss /= 1.0 if damping == "continuous" else length / (setup.nodes - 1)
        turns = k * length
        shape = 2.0 * pluck.height * np.sin(0.3 * turns) / (turns**2 * 0.3 * 0.7)
        shape *= np.exp(-0.5 * (k * pluck.width) ** 2)
        ring = np.sqrt(w**2 - 0.25 * loss**2 + 0j)
        decaying = np.exp(np.outer((1j * ring - 0.5 * loss), time)) - np.exp(
            np.outer((-1j * ring - 0.5 * loss), time)
        )
        velocity = -(shape * w**2 / ring * np.sin(0.25 * turns)) @ (decaying / 2j)
        assert np.abs(heard - velocity).max() < 1e-6 * np.abs(velocity).max()


def test_a_driven_segment_settles_at_its_steady_response() -> None:
    drive = Drive(amplitude=2e-3, start_frequencies=(690.0, 380.0), feedback="off")
    sound = simulate(replace(SETUP, initial="rest", drive=drive), 0.7, route="modal").segments[:, 26460:]
    time = np.arange(26460, 26460 + sound.shape[1]) / 44100.0
    for heard, length, frequency in zip(sound, (0.2275, 0.4225), (690.0, 380.0), strict=True):
        k, w, loss, mass = modes_of(length)
        turn = 2.0 * np.pi * frequency
        push = drive.amplitude / mass * np.sin(0.25 * k * length) * np.exp(-0.5 * (k * drive.width) ** 2)
        gain = np.sum(push / (w**2 - turn**2 + 1j * loss * turn) * np.sin(0.25 * k * length))
        velocity = np.imag(1j * turn * gain * np.exp(1j * turn * time))
        assert np.abs(heard - velocity).max() < 1e-3 * np.abs(velocity).max()  # what is left of the start


@pytest.mark.parametrize("decay", [0.0, 1999.9999999, 2000.1, 5e4])
def test_free_motion_solves_the_oscillator_however_damped(decay: float) -> None:
    w, time = 1000.0, 3e-3

    def slope(_: float, y: np.ndarray) -> list[float]:
        return [y[1], -decay * y[1] - w**2 * y[0]]

    moved = free_motion(np.array([w]), np.array([decay]), time)[:, 0]
    for start, columns in (([1.0, 0.0], [0, 2]), ([0.0, 1.0], [1, 3])):
        exact = solve_ivp(slope, (0.0, time), start, rtol=1e-11, atol=1e-14, method="DOP853").y[:, -1]
        assert moved[columns] == pytest.approx(exact, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("contact", [Contact(position=0.2275, force=1.0), None])
def test_the_compiled_grid_equals_the_readable_one_to_rounding(contact: Contact | None) -> None:
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


def test_a_step_is_below_its_limit_or_a_whole_fraction_of_the_appendixs() -> None:
    coarse = replace(SETUP, nodes=101)
    limit = 0.95 * (0.2275 / 100) / 316.2278
    wild = replace(coarse, time_step=limit * 1.0001)
    with pytest.raises(InputError, match=f"{limit:.4g}.*100 nodes"):
        simulate(wild, 0.1)
    assert simulate(replace(wild, nodes=100), 0.001).segments.shape == (2, 44)
    for nodes, parts in ((8, 1), (1001, 2), (60001, 88)):
        assert time_step(replace(coarse, nodes=nodes)) == pytest.approx(1e-6 / parts, rel=1e-12)


def test_nothing_folds_back_from_the_grid_s_rate_and_what_passes_keeps_its_time() -> None:
    times = np.arange(200_000) * 1e-6
    fade = np.sin(np.pi * times / 0.2) ** 2
    tones = np.stack((np.sin(2.0 * np.pi * 19_000.0 * times), np.sin(2.0 * np.pi * 30_000.0 * times))) * fade
    passed, stopped = _resample(iter([tones[:, :70_001], tones[:, 70_001:]]), 1e6, 44100)
    kept = np.arange(passed.size) / 44100
    expected = np.sin(2.0 * np.pi * 19_000.0 * kept) * np.sin(np.pi * kept / 0.2) ** 2
    assert np.abs(passed - expected).max() < 1e-3  # 0.01 dB
    assert np.abs(stopped).max() < 1e-6


def recording(own: float, loud: float = 1.0, seconds: float = 0.4) -> SimulatedSound:
    times = np.arange(round(seconds * 44100)) / 44100
    tones = (np.sin(2.0 * np.pi * 695.0 * times), loud * np.sin(2.0 * np.pi * 374.2 * times))
    mixing = mixing_matrix(own, own)
    return SimulatedSound(
        segments=np.stack(tones),
        microphones=mixing @ np.stack(tones),
        sample_rate=44100,
        mixing=mixing,
        drive_frequencies=np.zeros((2, 1)),
        drive_interval=0.02,
    )


@pytest.mark.parametrize("loud", [0.05, 20.0])
def test_each_segment_gives_its_own_peak_however_loud_the_other_or_the_start(loud: float) -> None:
    take = recording(0.55, loud)
    take.microphones[:, :6000] = np.sin(2.0 * np.pi * 3000.0 * np.arange(6000) / 44100)
    assert peaks(take) == pytest.approx((695.0, 374.2), rel=1e-5)


def test_a_silent_segment_has_no_peak() -> None:
    first, second = peaks(recording(1.0, 0.0))
    assert first == pytest.approx(695.0, rel=1e-5)
    assert math.isnan(second)


NEAR = Contact(position=1e-4, force=0.0)


@pytest.mark.parametrize(
    ("field", "wrong"),
    [
        ("route", lambda: simulate(SETUP, 0.1, route="modl")),  # pyright: ignore[reportArgumentType]
        ("seconds", lambda: simulate(SETUP, 0.0)),
        ("seconds", lambda: simulate(SETUP, math.nan)),
        ("sample rate", lambda: simulate(SETUP, 0.1, sample_rate=100)),
        ("steps", lambda: simulate(replace(SETUP, contact=NEAR), 0.1)),
        ("mixing", lambda: peaks(recording(0.5))),
        ("recording", lambda: peaks(recording(0.9, seconds=0.005))),
        ("position", lambda: replace(SETUP, contact=Contact(position=0.65, force=1.0))),
        ("position", lambda: replace(SETUP, contact=Contact(position=math.nan, force=1.0))),
        ("force", lambda: replace(SETUP, contact=Contact(position=0.3, force=-1.0))),
        ("mixing", lambda: replace(SETUP, mixing=(0.9, 1.1))),
        ("pickup", lambda: replace(SETUP, pickup_place=1.0)),
        ("nodes", lambda: replace(SETUP, nodes=3)),
        ("time_step", lambda: replace(SETUP, time_step=0.0)),
        ("alpha", lambda: replace(SETUP, alpha=1.5)),
        ("start_frequencies", lambda: replace(SETUP, initial="rest")),
        ("amplitude", lambda: Drive(amplitude=math.inf)),
        ("place", lambda: Drive(place=0.0)),
        ("width", lambda: Drive(width=0.0)),
        ("window", lambda: Drive(window=0.01, hop=0.02)),
        ("pull", lambda: Drive(pull=1.1)),
        ("frequencies", lambda: Drive(start_frequencies=(0.0, 1.0))),
        ("Pluck", lambda: PluckShape(place=1.0)),
        ("Pluck", lambda: PluckShape(width=-1.0)),
        ("Pluck", lambda: PluckShape(height=math.nan)),
    ],
)
def test_what_cannot_be_simulated_is_refused(field: str, wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError, match=field):
        wrong()
