"""The touch figure: what is played is what its phases say, and the labels stand below the sound."""

from functools import cache

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.figures.touch import PHASES, RATE, SIZE, Touch, spectrogram
from monochord.physics.twin import Take


@cache
def played() -> Take:
    return Touch().play()


def during(number: int) -> slice:
    """Return the middle half of a phase."""
    edges = np.concatenate([[0.0], np.cumsum([seconds for _, seconds in PHASES])]) + 0.5 * SIZE
    start, stop = edges[number], edges[number + 1]
    quarter = 0.25 * (stop - start)
    return slice(round((start + quarter) * RATE), round((stop - quarter) * RATE))


def test_labels_follow_the_phases() -> None:
    labels = played().labels
    names = [name for name, _ in PHASES]
    for number, name in enumerate(names):
        cut = during(number)
        slips = name.startswith("slide")
        touched = name in {"press", "hold"} or slips
        if name != "release":
            assert labels.contact[0, cut].all() == touched
        if touched and name != "press":
            assert labels.slip[0, cut].mean() == pytest.approx(float(slips), abs=0.05)
            assert labels.force[0, cut].mean() == pytest.approx(1.0, abs=0.05)
    across, along = during(names.index("slide across")), during(names.index("slide along"))
    assert labels.across[0, across].mean() == pytest.approx(0.03, rel=0.05)
    assert labels.along[0, along].mean() == pytest.approx(0.1, rel=0.02)
    assert labels.settled[during(names.index("hold"))].all()


def test_the_string_sounds_before_between_and_after() -> None:
    sound = played().microphones
    for number in (0, 3, len(PHASES) - 1):
        assert np.abs(sound[:, during(number)]).max() > 0.05
    assert np.abs(sound).max() < 1.0


def test_spectrogram_counts_from_the_middle_of_its_window() -> None:
    time = np.arange(round(0.2 * RATE)) / RATE
    tone = np.sin(2.0 * np.pi * 3000.0 * time) * (time > 0.1)
    times, frequencies, levels = spectrogram(tone.astype(np.float32), 5000.0)
    row = levels[np.argmin(np.abs(frequencies - 3000.0))]
    # Half of the tone is in the window that lies about its beginning: 6 dB below the whole.
    begins = times[np.argmin(np.abs(row - (row.max() - 6.0)))] + 0.5 * SIZE
    assert begins == pytest.approx(0.1, abs=0.004)
    assert frequencies[-1] <= 5000.0


def test_panels_carry_units_and_say_simulated() -> None:
    page = Touch().draw()
    labels = {axes.get_ylabel() for axes in page.axes}
    assert {"microphone 1 (kHz)", "x (mm)", "F (N)", "slip\n(mm/s)", "level (dB)"} <= labels
    assert any("simulated" in axes.get_title() for axes in page.axes)
    assert any(axes.get_xlabel() == "time (s)" for axes in page.axes)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"start": 1.5}, "start 1.5: allowed is a share"),
        ({"force": 0.0}, "force 0 N"),
        ({"speed": 1.0}, "speed 1 m/s"),
        ({"highest": 100.0}, "highest 100 Hz"),
    ],
)
def test_options_out_of_range_are_refused(options: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Touch(**options)  # pyright: ignore[reportArgumentType]
