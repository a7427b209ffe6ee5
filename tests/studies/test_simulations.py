"""Figures of simulations: what they compute agrees with theory, and they draw it."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from studies.convergence import STEADY, TRANSIENT, Convergence, SegmentSound, envelope, spectrum
from studies.modes import PATTERN_TOLERANCE, Modes
from studies.touch import PHASES, RATE, SIZE, Touch
from studies.trends import Sweep, Trends, simulated_spectra, simulator

from monochord.core.errors import InputError
from monochord.core.types import Contact, Floats
from monochord.physics.sensors import load_sensor
from monochord.physics.split_string import SplitString, simulate
from monochord.physics.strings import load_string
from monochord.physics.theory import segment_frequencies, split_frequencies
from monochord.physics.twin import Take
from studies import convergence, modes, touch

APPENDIX = load_string("appendix").string
SPLIT_STRING = simulator("split_string")
SENSOR = load_sensor("prototype")
FEW_HISTORIES = Modes(histories=6, after=2.0)


@pytest.fixture(scope="module")
def segments() -> list[SegmentSound]:
    contact = Contact(position=0.35 * APPENDIX.length, force=0.0)
    recording = simulate(SplitString(string=APPENDIX, contact=contact), 0.4, route="modal")
    both = zip(recording.segments, segment_frequencies(APPENDIX, contact), strict=True)
    return [SegmentSound(velocity=v, rate=float(recording.sample_rate), expected=f) for v, f in both]


def test_a_touch_settles_on_the_frequencies_of_theory(segments: list[SegmentSound]) -> None:
    for segment in segments:
        others: list[float] = []
        for span in (TRANSIENT, STEADY):
            frequencies, levels = spectrum(segment, span)
            others.append(levels[(frequencies > 1.6 * segment.expected) & (frequencies < 8000.0)].max())
        assert frequencies[np.argmax(levels)] == pytest.approx(segment.expected, rel=2e-3)
        assert others[1] < others[0] - 20.0
        times, frequencies, levels = convergence.spectrogram(segment, 3000.0)
        assert levels.shape == (frequencies.size, times.size)
        assert (times[0], times[-1]) == pytest.approx((0.015, 0.385), abs=3e-3)
        ridge = frequencies[np.argmax(levels, axis=0)]
        np.testing.assert_allclose(ridge, segment.expected, atol=frequencies[1])


def test_the_envelope_of_a_decaying_tone_is_its_amplitude() -> None:
    t = np.arange(0.0, 0.2, 1e-4)
    amplitude = np.exp(-t / 0.5)
    tone = SegmentSound(velocity=amplitude * np.sin(2 * np.pi * 200.0 * t), rate=1e4, expected=200.0)
    np.testing.assert_allclose(envelope(tone)[50:-50], amplitude[50:-50], rtol=0.02)


def test_convergence_draws_waves_spectrograms_and_spectra() -> None:
    page = Convergence(string="prototype", seconds=0.35, route="modal").draw()
    panels = {axes.get_title(loc="left"): axes for axes in page.axes}
    assert set("ABCDEF") <= set(panels)
    assert panels["A"].get_xlim() == pytest.approx((0.0, 350.0))
    assert all(panels[letter].collections for letter in "CD")


def ridge_near(frequencies: Floats, levels: Floats, expected: float) -> float:
    """Return the frequency of the strongest bin within a quarter of a fundamental either side."""
    near = np.flatnonzero(np.abs(frequencies - expected) < expected / 4.0)
    return float(frequencies[near[np.argmax(levels[near])]])


def test_the_tension_law_applies_to_theory_and_every_simulator() -> None:
    plain = load_string("plain_010").string
    sweep = Trends(steps=3, highest_force=20.0, law="geometric").sweeps(plain)[1]
    frequencies, levels = simulated_spectra(SPLIT_STRING, plain, sweep)
    f1, _ = sweep.fundamentals(plain)
    assert f1[2] > 1.2 * f1[0]
    assert ridge_near(frequencies, levels[2], f1[2]) == pytest.approx(f1[2], abs=3.0)
    peaks: list[float] = []
    for law in ("linear", "geometric"):
        one = Sweep(positions=np.array([0.09]), forces=np.array([2.0]), law=law)
        frequencies, levels = simulated_spectra(simulator("twin"), SENSOR.string, one)
        peaks.append(float(frequencies[levels[0].argmax()]))
    # k_T 0.3 against 4 N^2 of stretch: 0.6 N and 1.2 N on 65 N.
    assert peaks[1] > peaks[0] + 2.0


def test_trends_draws_theory_in_millimetres() -> None:
    curve = Trends(steps=3).draw().axes[0].lines[0]
    x, f = np.asarray(curve.get_xdata()), np.asarray(curve.get_ydata())
    np.testing.assert_allclose(f, split_frequencies(APPENDIX, x / 1e3, np.ones(3))[0])


def levels_of(*peaks: float) -> np.ndarray:
    """One sound a level: that of its first partial in both channels, the others absent."""
    levels = np.full((len(peaks), 2, modes.PARTIALS), modes.FLOOR)
    levels[:, :, 0] = np.array(peaks)[:, None]
    return levels


def test_similar_sounds_and_those_linked_by_others_are_one_pattern() -> None:
    assert modes.patterns(levels_of(-20.0, -3.0, -3.0, -1.0, -20.0, -3.0)).tolist() == [1, 0, 0, 0, 1, 0]
    linked = levels_of(-3.0, -8.0, -13.0, -18.0)  # 5 dB apart each, 15 dB from end to end
    assert modes.patterns(linked).tolist() == [0, 0, 0, 0]
    assert sorted(modes.patterns(linked[[0, 3]]).tolist()) == [0, 1]
    levels = np.random.default_rng(3).uniform(-30.0, 0.0, (30, 2, 8)).round(-1)
    order = np.random.default_rng(4).permutation(30)
    one, other = modes.patterns(levels)[order], modes.patterns(levels[order])
    assert ((one[:, None] == one) == (other[:, None] == other)).all()


def test_partial_levels_are_relative_to_the_whole() -> None:
    time, f0 = np.arange(22050) / modes.RATE, 1010.565
    strong, weak = np.sin(2 * np.pi * 2 * f0 * time), 0.1 * np.sin(2 * np.pi * 3 * f0 * time)
    levels = modes.partial_levels(np.array([strong, weak], dtype=np.float32), SENSOR)
    # A hundredth of the power in the second channel: 10 log10(1 / 1.01) and 20 dB below.
    assert levels[0, 1] == pytest.approx(-0.043, abs=0.02)
    assert levels[1, 2] == pytest.approx(-20.04, abs=0.02)
    assert (np.delete(levels[0], 1) == modes.FLOOR).all()


def test_histories_stay_within_range_and_force_and_end_clear_of_the_string() -> None:
    is_touch = set[bool]()
    for seed in range(60):
        past = modes.history(SENSOR, seed)
        is_touch.add(past.scene.pluck is None)
        assert past == modes.history(SENSOR, seed)
        for each in past.scene.touches:
            assert all(0.05 <= key.position <= 0.15 for key in each.motion)
            assert all(0.1 <= key.force <= 2.0 for key in each.motion[1:-1])
            assert each.motion[-1].clearance > 0.0
            assert each.motion[-1].time == past.released
    assert is_touch == {True, False}


def test_modes_counts_every_history_once_and_draws_a_column_for_each_pattern() -> None:
    numbers = FEW_HISTORIES.numbers()
    counts = numbers["counts"]
    assert (numbers["histories"], numbers["seeds"]) == (6, [0, 5])
    assert sum(counts) == numbers["steady"] <= 6
    assert counts == sorted(counts, reverse=True) == [one["count"] for one in numbers["patterns"]]
    pattern = numbers["patterns"][0]
    sound, _ = modes.sound_of(SENSOR, pattern["seed"], 2.0)
    levels = modes.partial_levels(sound[:, -22050:], SENSOR)
    np.testing.assert_allclose(levels, pattern["levels_db"], atol=PATTERN_TOLERANCE)
    letters = {axes.get_title(loc="left") for axes in FEW_HISTORIES.draw().axes}
    assert set("ABCDE"[: len(counts)]) <= letters


def test_the_spectrogram_of_modes_is_in_decibels_of_full_scale_about_the_release() -> None:
    time = np.arange(3 * 44100) / 44100
    sine = (0.1 * np.sin(2 * np.pi * 1033.59 * time)).astype(np.float32)
    times, frequencies, levels = modes.spectrogram(sine, 1.0)
    assert (times[0], times[-1]) == pytest.approx((-0.2, 0.8), abs=0.02)
    assert levels.max() == pytest.approx(-20.0, abs=0.2)
    assert frequencies[levels[:, 0].argmax()] == pytest.approx(1033.59, abs=22.0)


@cache
def played() -> Take:
    return Touch().play()


def during(number: int) -> slice:
    """Return the middle half of a phase."""
    edges = np.concatenate([[0.0], np.cumsum([seconds for _, seconds in PHASES])]) + 0.5 * SIZE
    start, stop = edges[number], edges[number + 1]
    quarter = 0.25 * (stop - start)
    return slice(round((start + quarter) * RATE), round((stop - quarter) * RATE))


def test_the_touch_sounds_throughout_and_is_drawn() -> None:
    sound = played().microphones
    for number in (0, 3, len(PHASES) - 1):
        assert np.abs(sound[:, during(number)]).max() > 0.05
    assert np.abs(sound).max() < 1.0
    panels = {axes.get_title(loc="left"): axes for axes in Touch().draw().axes}
    assert panels["A"].collections
    assert panels["B"].collections


def test_the_spectrogram_of_a_touch_counts_from_the_middle_of_its_window() -> None:
    time = np.arange(round(0.2 * RATE)) / RATE
    tone = np.sin(2.0 * np.pi * 3000.0 * time) * (time > 0.1)
    times, frequencies, levels = touch.spectrogram(tone.astype(np.float32), 5000.0)
    row = levels[np.argmin(np.abs(frequencies - 3000.0))]
    # Half of the tone is in the window around its beginning: 6 dB below the whole.
    begins = times[np.argmin(np.abs(row - (row.max() - 6.0)))] + 0.5 * SIZE
    assert begins == pytest.approx(0.1, abs=0.004)
    assert frequencies[-1] <= 5000.0


@pytest.mark.parametrize(
    ("figure", "options"),
    [
        (Convergence, {"position": 0.0}),
        (Convergence, {"seconds": 0.3}),
        (Convergence, {"highest": 0.0}),
        (Trends, {"edge": 0.5}),
        (Trends, {"position": 1.0}),
        (Trends, {"force": -1.0}),
        (Trends, {"highest": 1.0}),
        (Trends, {"steps": 1}),
        (Trends, {"model": "splitstring"}),
        (Trends, {"route": "modl"}),
        (Trends, {"string": "appendx"}),
        (Modes, {"histories": 0}),
        (Modes, {"first": -1}),
        (Modes, {"after": 1.0}),
        (Modes, {"shown": 0}),
        (Modes, {"sensor": "protoype"}),
        (Touch, {"start": 1.5}),
        (Touch, {"force": 0.0}),
        (Touch, {"speed": 1.0}),
        (Touch, {"highest": 100.0}),
    ],
)
def test_options_out_of_range_are_refused(figure: Any, options: dict[str, Any]) -> None:
    ((name, value),) = options.items()
    with pytest.raises(InputError, match=value if isinstance(value, str) else name):
        figure(**options).draw()
