"""The drivers' ear, and the three ways of the paper's Eq. 12."""

from dataclasses import replace

import numpy as np
import pytest

from monochord.core.types import Contact, Floats
from monochord.physics.split_string import Drive, SplitString
from monochord.physics.split_string.feedback import advance, begin, lines, listen, retune
from monochord.physics.strings import load_string

APPENDIX = load_string("appendix")
RATE = 44100


def setup(**drive: object) -> SplitString:
    return SplitString(
        string=APPENDIX.string,
        contact=Contact(position=0.2275, force=0.0),
        drive=Drive(**drive),  # pyright: ignore[reportArgumentType]
    )


def tone(frequency: float, seconds: float = 0.05, phase: float = 0.0, level: float = 1.0) -> Floats:
    times = np.arange(round(seconds * RATE)) / RATE
    return level * np.sin(2.0 * np.pi * frequency * times + phase)


@pytest.mark.parametrize("frequency", [120.0, 243.25, 695.006, 1999.9, 8000.1])
@pytest.mark.parametrize("size", [2048, 2205])
def test_a_line_is_read_between_bins(frequency: float, size: int) -> None:
    signal = tone(frequency, phase=0.7)[:size]
    heard, phase = lines(np.stack((signal, 1e-4 * signal)), RATE)
    assert heard == pytest.approx([frequency] * 2, rel=2e-4)
    now = 2.0 * np.pi * frequency * signal.size / RATE + 0.7
    assert np.cos(phase - now) == pytest.approx([1.0, 1.0], abs=0.02)


def test_silence_has_no_line() -> None:
    heard, _ = lines(np.zeros((2, 2205)), RATE)
    assert heard.tolist() == [0.0, 0.0]


def test_a_driver_is_silent_until_it_has_heard_a_window_then_joins_in_phase() -> None:
    case = setup()
    sound = np.stack((tone(700.0, phase=1.0), tone(370.0, phase=2.0)))
    drivers = begin(case.drive, RATE)
    assert np.isnan(drivers.tone).all()
    drivers = retune(listen(drivers, sound[:, :1000]), case, RATE, 0.02)
    assert np.isnan(drivers.tone).all()
    assert not drivers.swing(10, 1e-4).any()
    drivers = retune(listen(drivers, sound[:, 1000:]), case, RATE, 0.05)
    assert drivers.frequency == pytest.approx([700.0, 370.0], rel=1e-3)
    goes_on = 2.0 * np.pi * np.array([700.0, 370.0]) * 0.05 + [1.0, 2.0]
    assert np.cos(drivers.phase - goes_on) == pytest.approx([1.0, 1.0], abs=0.02)


def test_the_phase_runs_on_when_the_frequency_changes_unless_printed() -> None:
    sound = np.stack((tone(700.0), tone(370.0)))
    accumulated = setup(start_frequencies=(650.0, 350.0))
    drivers = advance(listen(begin(accumulated.drive, RATE), sound), 0.05)
    after = retune(drivers, accumulated, RATE, 0.05)
    assert after.frequency != pytest.approx(drivers.frequency)
    assert after.phase.tolist() == drivers.phase.tolist()
    printed = replace(accumulated, drive=replace(accumulated.drive, phase="printed"))
    jumped = retune(drivers, printed, RATE, 0.05)
    assert jumped.phase == pytest.approx(2.0 * np.pi * jumped.frequency * 0.05)


def test_literal_feedback_leads_both_drivers_by_the_first_microphone() -> None:
    sound = np.stack((tone(700.0), tone(370.0, level=0.5)))
    case = setup(feedback="literal")
    drivers = retune(listen(begin(case.drive, RATE), sound), case, RATE, 0.05)
    assert drivers.frequency == pytest.approx([700.0, 700.0], rel=1e-3)


def test_without_feedback_the_start_frequencies_stay() -> None:
    case = setup(feedback="off", start_frequencies=(650.0, 350.0))
    drivers = listen(begin(case.drive, RATE), np.stack((tone(700.0), tone(370.0))))
    assert retune(drivers, case, RATE, 0.05).frequency.tolist() == [650.0, 350.0]


def test_the_swing_is_the_sine_of_the_running_phase() -> None:
    drivers = advance(begin(Drive(start_frequencies=(650.0, 350.0)), RATE), 0.013)
    times = np.linspace(0.0, 999e-6, 1000)
    assert drivers.swing(1000, 1e-6).imag == pytest.approx(np.sin(drivers.phases(times)), abs=1e-12)
