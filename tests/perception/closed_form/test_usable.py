"""Windows that can be used, and why others cannot."""

import numpy as np
import pytest

from monochord.core.types import Audio, Floats, Window
from monochord.perception.closed_form.usable import CLIPPED_SHARE, SILENCE, why_unusable

SIZE = 4410
TONE = 0.3 * np.sin(0.2 * np.arange(2.0 * SIZE)).reshape(2, SIZE)


def why(samples: Audio | Floats, *, has_gap: bool = False) -> str:
    window = Window(samples=np.asarray(samples, np.float32), start=0, sample_rate=44100, has_gap=has_gap)
    return why_unusable(window)


def test_a_tone_is_usable_and_no_longer_with_a_gap() -> None:
    assert why(TONE) == ""
    assert why(TONE, has_gap=True) == "gap"


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_one_sample_that_is_not_a_number_is_enough(bad: float) -> None:
    samples = TONE.copy()
    samples[1, 4000] = bad
    assert why(samples) == "samples that are not numbers"


def test_silence_is_judged_about_the_mean_and_by_the_louder_channel() -> None:
    unit = TONE / TONE.std()
    assert why(0.5 + 0.9 * SILENCE * np.sign(TONE)) == "silence"
    assert why(0.5 + 1.5 * SILENCE * unit) == ""
    assert why(np.stack((np.zeros(SIZE), TONE[1]))) == ""


@pytest.mark.parametrize("top", [1.0, 0.4])
def test_clipping_is_seen_at_any_level(top: float) -> None:
    unit = TONE / 0.3
    assert why(top * np.clip(unit / np.cos(0.5 * np.pi * 1.3 * CLIPPED_SHARE), -1.0, 1.0)) == "clipped"
    assert why(top * np.clip(unit / np.cos(0.5 * np.pi * 0.7 * CLIPPED_SHARE), -1.0, 1.0)) == ""
