"""Why a window cannot be used."""

import numpy as np
import pytest

from monochord.core.clipping import DISTORTED_SHARE
from monochord.core.reasons import Reason
from monochord.core.silence import SILENT_LEVEL
from monochord.core.types import Audio, Floats, Window
from monochord.perception.usable import unusable_reason

RATE, SIZE = 44100, 4410
TONE = 0.3 * np.sin(0.2 * np.arange(2.0 * SIZE)).reshape(2, SIZE)


def window(samples: Audio | Floats, *, has_gap: bool = False) -> Window:
    return Window(samples=np.asarray(samples, np.float32), start=0, sample_rate=RATE, has_gap=has_gap)


def test_a_tone_is_usable_without_a_gap() -> None:
    assert unusable_reason(window(TONE)) is Reason.NONE
    assert unusable_reason(window(TONE, has_gap=True)) is Reason.GAP


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_one_sample_that_is_not_a_number_is_enough(bad: float) -> None:
    samples = TONE.copy()
    samples[1, 4000] = bad
    assert unusable_reason(window(samples)) is Reason.NOT_NUMBERS


def test_silence_is_judged_about_the_mean_and_by_the_louder_channel() -> None:
    unit = TONE / TONE.std()
    assert unusable_reason(window(0.5 + 0.9 * SILENT_LEVEL * np.sign(TONE))) is Reason.SILENCE
    assert unusable_reason(window(0.5 + 1.5 * SILENT_LEVEL * unit)) is Reason.NONE
    assert unusable_reason(window(np.stack((np.zeros(SIZE), TONE[1])))) is Reason.NONE


@pytest.mark.parametrize("top", [1.0, 0.4])
def test_clipping_at_any_level(top: float) -> None:
    unit = TONE / 0.3
    for share, reason in ((1.3, Reason.CLIPPED), (0.7, Reason.NONE)):
        peak = np.cos(0.5 * np.pi * share * DISTORTED_SHARE)
        assert unusable_reason(window(top * np.clip(unit / peak, -1.0, 1.0))) == reason
