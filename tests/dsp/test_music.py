import numpy as np
import pytest

from monochord.dsp.music import LOUDNESS, loop

RATE = 8000


def test_a_loop_depends_on_its_seed_repeats_without_a_seam_and_has_bass_middle_and_treble() -> None:
    first, second = (loop(seed, sample_rate=RATE) for seed in (1, 2))
    np.testing.assert_array_equal(first, loop(1, sample_rate=RATE))
    assert np.corrcoef(first, second)[0, 1] < 0.9
    assert abs(float(first[0]) - float(first[-1])) <= np.abs(np.diff(first)).max()
    sound = first.astype(float)
    assert np.sqrt(np.mean(sound**2)) == pytest.approx(LOUDNESS)
    power = np.abs(np.fft.rfft(sound)) ** 2
    frequency = np.fft.rfftfreq(sound.size, 1.0 / RATE)
    bands = [(40, 250), (250, 2000), (2000, 4000)]
    share = [power[(frequency >= low) & (frequency < high)].sum() / power.sum() for low, high in bands]
    assert share[0] > share[1] > share[2] > 1e-3
