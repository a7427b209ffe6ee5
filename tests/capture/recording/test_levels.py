import numpy as np
import pytest

from monochord.capture.recording.levels import HOLD, Levels
from monochord.core.types import Block


def block(*channels: list[float]) -> Block:
    return Block(samples=np.array(channels, np.float32), start=0)


def test_each_microphone_has_its_level() -> None:
    levels = Levels(channels=2)
    levels.add(block([0.3, -0.3], [0.0, 0.4]))
    levels.add(block([0.3, -0.3], [-0.4, 0.0]))
    first, second = levels.look(0.0)
    assert first.rms == pytest.approx(0.3)
    assert second.rms == pytest.approx(0.4 / np.sqrt(2))
    assert (first.peak, second.peak) == pytest.approx((0.3, 0.4))
    assert not first.clipping


def test_a_peak_is_held_for_a_while_and_the_highest_for_ever() -> None:
    levels = Levels(channels=1)
    levels.add(block([0.8]))
    levels.look(0.0)
    levels.add(block([-0.2]))
    (soon,) = levels.look(0.9 * HOLD)
    assert (soon.peak, soon.held) == pytest.approx((0.2, 0.8))
    levels.add(block([0.1]))
    (later,) = levels.look(1.1 * HOLD)
    assert (later.held, later.highest) == pytest.approx((0.1, 0.8))


def test_clipped_samples_are_counted_and_told_for_a_while() -> None:
    levels = Levels(channels=2)
    levels.add(block([1.0, 0.9, -1.0], [0.99, 0.0, -0.99]))
    first, second = levels.look(0.0)
    assert (first.clipped, second.clipped) == (2, 0)
    assert first.clipping
    levels.add(block([0.1], [0.1]))
    assert not levels.look(1.1 * HOLD)[0].clipping
    assert levels.look(1.1 * HOLD)[0].clipped == 2


def test_sixteen_bits_at_full_scale_count_as_clipped() -> None:
    levels = Levels(channels=1)
    levels.add(block([32767 / 32768]))
    assert levels.look(0.0)[0].clipped == 1


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_no_number_is_counted_and_left_out_of_the_level(bad: float) -> None:
    levels = Levels(channels=1)
    levels.add(block([bad, 0.5, -0.5, bad]))
    (level,) = levels.look(0.0)
    assert level.not_numbers == 2
    assert (level.rms, level.peak, level.highest) == pytest.approx((0.5, 0.5, 0.5))
    levels.add(block([bad]))
    assert levels.look(0.0)[0].rms == 0.0


def test_a_look_without_audio_tells_the_last() -> None:
    levels = Levels(channels=1)
    assert levels.look(0.0)[0].rms == 0.0
    levels.add(block([0.5]))
    assert levels.look(0.1) == levels.look(0.2)
