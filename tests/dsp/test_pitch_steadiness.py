"""Steadiness of a series: what it measures on tones that hold, glide and jitter."""

import numpy as np
import pytest

from monochord.core.types import Audio
from monochord.dsp.pitch_steadiness import SteadinessMeter

RATE, SIZE = 44100, 4410
METER = SteadinessMeter(sample_rate=RATE, size=SIZE)


def tone(frequency: float, *, glide: float = 0.0, decay: float = 0.0, jitter: float = 0.0) -> Audio:
    """Return a harmonic tone whose pitch is `frequency` at the middle and changes by `glide` a second."""
    time = (np.arange(SIZE) - 0.5 * SIZE) / RATE
    wander = jitter * np.random.default_rng(3).standard_normal(13)[:, np.newaxis]
    n = np.arange(1.0, 13.0)[:, np.newaxis]
    slope = glide + wander[: n.size]
    phase = 2.0 * np.pi * n * frequency * (time + 0.5 * slope * time**2) + n
    return (np.exp(-decay * n * time) / n * np.sin(phase)).sum(axis=0)[np.newaxis].astype(np.float32)


@pytest.mark.parametrize("frequency", [60.0, 900.0])
@pytest.mark.parametrize("decay", [0.0, 2.0])
def test_a_string_that_holds_or_decays_is_steady(frequency: float, decay: float) -> None:
    steadiness = METER.measure(tone(frequency, decay=decay), frequency, 0.0)
    assert abs(steadiness.glide) < 0.02
    assert steadiness.scatter < 0.02
    assert steadiness.missing < 0.1


@pytest.mark.parametrize(("frequency", "glide"), [(110.0, -0.6), (220.0, 0.2), (220.0, 0.6)])
def test_a_glide_is_measured(frequency: float, glide: float) -> None:
    steadiness = METER.measure(tone(frequency, glide=glide), frequency, 0.0)
    assert steadiness.glide == pytest.approx(glide, rel=0.15)


def test_partials_that_move_apart_scatter() -> None:
    assert METER.measure(tone(150.0, jitter=0.5), 150.0, 0.0).scatter > 0.1


def test_silence_has_no_partial() -> None:
    assert METER.measure(np.zeros((1, SIZE), np.float32), 150.0, 0.0).missing == 1.0
