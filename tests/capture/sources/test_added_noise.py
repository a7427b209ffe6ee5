"""Noise that is added block by block has the level and the spectrum that it is asked for, and no jumps."""

import time

import numpy as np
import pytest

from monochord.capture.sources._added_noise import AddedNoise
from monochord.core.types import Audio, Floats

RATE, BLOCK, SECONDS = 44100, 441, 5  # longer than the loop
TONE = 0.1 * np.tile(np.sin(2 * np.pi * 1000.0 * np.arange(BLOCK) / RATE), (2, 1)).astype(np.float32)
LEVEL = 0.1 / np.sqrt(2.0)


def added(kind: str, ratio: float, levels: Floats) -> Audio:
    """Return the noise alone that is added to blocks of a tone, each of which has a level."""
    noise, deadline = AddedNoise(RATE, seed=1), time.monotonic() + 60.0
    while np.array_equal(noise.added(levels[0] * TONE, 0, kind, ratio), levels[0] * TONE):
        assert time.monotonic() < deadline
        time.sleep(0.01)
    blocks = [level * TONE for level in levels]
    sound = [noise.added(block, BLOCK * k, kind, ratio) for k, block in enumerate(blocks)]
    return np.concatenate(sound, axis=1) - np.concatenate(blocks, axis=1)


STEADY = np.ones(SECONDS * RATE // BLOCK)


@pytest.mark.parametrize(("kind", "ratio"), [("white", 30.0), ("chord", 10.0), ("motor", 10.0)])
def test_it_is_as_loud_as_it_is_asked_for_in_both_channels(kind: str, ratio: float) -> None:
    level = np.sqrt(np.mean(np.square(added(kind, ratio, STEADY), dtype=np.float64), axis=1))
    assert 20 * np.log10(level / LEVEL) == pytest.approx([-ratio, -ratio], abs=0.5)


def share_below(sound: Audio, limit: float) -> float:
    power = np.abs(np.fft.rfft(sound[0].astype(np.float64))) ** 2
    return float(power[np.fft.rfftfreq(sound.shape[1], 1.0 / RATE) < limit].sum() / power.sum())


def test_white_noise_is_white_and_music_and_motors_are_low_and_alike_at_both_microphones() -> None:
    white = added("white", 10.0, STEADY)
    assert share_below(white, 5000.0) == pytest.approx(5000.0 / (RATE / 2), rel=0.05)
    assert abs(np.mean(white[0] * white[1])) < 0.05 * np.mean(white**2)
    for kind in ("chord", "motor"):
        noise = added(kind, 10.0, STEADY)
        assert share_below(noise, 5000.0) > 0.8
        np.testing.assert_allclose(noise[0], noise[1], atol=1e-6)


def test_it_does_not_jump_between_blocks_even_where_the_sound_gets_louder() -> None:
    count, turn = STEADY.size, STEADY.size // 2
    noise = added("hum", 10.0, np.where(np.arange(count) < turn, 0.1, 1.0))[0]
    steps = np.abs(np.diff(noise, append=0.0)).reshape(count, BLOCK)
    assert (steps[turn - 1 : turn + 8, -1] < 1.5 * steps[turn - 1 : turn + 8, :-1].max(axis=1)).all()
    steady = steps[:turn]
    assert steady[:, -1].max() <= 1.05 * steady[:, :-1].max()
    level = noise.reshape(count, BLOCK).std(axis=1)
    assert level[-100:].mean() > 5.0 * level[:100].mean()  # it follows the sound
