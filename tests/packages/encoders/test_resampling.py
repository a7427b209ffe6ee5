"""A window at another rate is the sound as it would have been sampled there."""

from collections.abc import Callable

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord_encoders.resampling import Resampler

RATE, NEW, SIZE = 44100, 16000, 4410


def partials(pitch: float, rate: int, seconds: float) -> Audio:
    time = np.arange(round(seconds * rate)) / rate
    numbers = range(1, int(7000.0 / pitch))
    return np.sum([np.sin(2 * np.pi * n * pitch * time + n * n) / n for n in numbers], axis=0)[None]


@pytest.mark.parametrize("pitch", [311.0, 1210.0])
def test_a_window_is_the_sound_at_the_new_rate_and_with_context_from_its_begin(pitch: float) -> None:
    true = partials(pitch, NEW, 0.3)[:, NEW // 10 : NEW // 5]
    sound = partials(pitch, RATE, 0.3).astype(np.float32)
    for context, first, most in ((0, 32, 2e-3), (441, 0, 1e-3)):
        resampler = Resampler(sample_rate=RATE, new_rate=NEW, size=SIZE + context, context=context)
        error = np.abs(resampler(sound[:, SIZE - context : 2 * SIZE]) - true) / np.abs(true).max()
        assert error.shape == (1, 1600)
        assert error.max() < 0.03
        assert error[:, first:-32].max() < most


@pytest.mark.parametrize(
    ("rate", "size", "length"), [(44100, 882, 320), (48000, 4800, 1600), (22050, 1103, 800)]
)
def test_it_has_as_many_samples_as_fit(rate: int, size: int, length: int) -> None:
    resampler = Resampler(sample_rate=rate, new_rate=NEW, size=size)
    assert resampler.length == length
    assert resampler(np.ones((2, size), np.float32)).shape == (2, length)


def test_the_same_rate_changes_nothing() -> None:
    sound = np.random.default_rng(0).standard_normal((2, 1600)).astype(np.float32)
    assert np.array_equal(Resampler(sample_rate=NEW, new_rate=NEW, size=1600)(sound), sound)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Resampler(sample_rate=0, new_rate=NEW, size=SIZE),
        lambda: Resampler(sample_rate=RATE, new_rate=NEW, size=SIZE, context=SIZE),
        lambda: Resampler(sample_rate=RATE, new_rate=NEW, size=SIZE, context=440),
        lambda: Resampler(sample_rate=RATE, new_rate=NEW, size=SIZE)(np.zeros((2, 100), np.float32)),
    ],
)
def test_what_cannot_be_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        wrong()
