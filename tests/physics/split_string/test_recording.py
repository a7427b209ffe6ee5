"""The two features of the paper, from microphones that hear both segments."""

import math

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.physics.split_string import Recording, peaks
from monochord.physics.theory import mixing_matrix


def recording(own: float, loud: float = 1.0, seconds: float = 0.4) -> Recording:
    times = np.arange(round(seconds * 44100)) / 44100
    tones = (np.sin(2.0 * np.pi * 695.0 * times), loud * np.sin(2.0 * np.pi * 374.2 * times))
    mixing = mixing_matrix(own, own)
    return Recording(
        segments=np.stack(tones),
        microphones=mixing @ np.stack(tones),
        sample_rate=44100,
        mixing=mixing,
        drive_frequencies=np.zeros((2, 1)),
        drive_interval=0.02,
    )


@pytest.mark.parametrize("loud", [0.05, 1.0, 20.0])
@pytest.mark.parametrize("own", [1.0, 0.8, 0.55])
def test_each_segment_gives_its_own_peak_however_loud_the_other(own: float, loud: float) -> None:
    assert peaks(recording(own, loud)) == pytest.approx((695.0, 374.2), rel=1e-5)


def test_the_transient_is_left_out() -> None:
    take = recording(0.9)
    take.microphones[:, :6000] = np.sin(2.0 * np.pi * 3000.0 * np.arange(6000) / 44100)
    assert peaks(take) == pytest.approx((695.0, 374.2), rel=1e-5)


def test_a_silent_segment_has_no_peak() -> None:
    first, second = peaks(recording(1.0, 0.0))
    assert first == pytest.approx(695.0, rel=1e-5)
    assert math.isnan(second)


def test_what_cannot_be_told_apart_is_refused() -> None:
    with pytest.raises(InputError, match="two microphones that hear the segments differently"):
        peaks(recording(0.5))
    with pytest.raises(InputError, match=r"recording of 0.00498866 s: allowed is 0.01 s or more"):
        peaks(recording(0.9, seconds=0.005))
    assert recording(0.9).duration == 0.4
