"""The made-up sounds of a room have the pitch, the band and the rhythm that they are said to have."""

import numpy as np

from monochord.evaluation.room_sounds import TEETH, TURNS, babble, motor

RATE = 44100


def test_a_motor_hums_at_its_turns_and_at_its_gear() -> None:
    sound = motor(np.random.default_rng(3), 2 * RATE, float(RATE))
    power = np.abs(np.fft.rfft(sound * np.hanning(sound.size))) ** 2
    frequency = np.fft.rfftfreq(sound.size, 1 / RATE)
    turning = (frequency > 0.95 * TURNS[0]) & (frequency < 1.05 * TURNS[1])
    turns = frequency[turning][power[turning].argmax()]
    mesh = np.abs(frequency - TEETH * turns) < 0.05 * TEETH * turns
    between = np.abs(frequency - 1.5 * TEETH * turns) < 0.05 * TEETH * turns
    assert power[mesh].sum() > 20.0 * power[between].sum()


def test_speech_comes_in_syllables_and_lies_below_five_kilohertz() -> None:
    sound = babble(np.random.default_rng(3), 4 * RATE, float(RATE))
    power = np.abs(np.fft.rfft(sound)) ** 2
    frequency = np.fft.rfftfreq(sound.size, 1 / RATE)
    assert power[frequency < 5000.0].sum() > 0.9 * power.sum()
    level = np.sqrt(np.mean(sound.reshape(-1, RATE // 20) ** 2, axis=1))
    assert level.min() < 0.1
    assert level.max() > 1.0


def test_equal_seeds_sound_equal_and_others_do_not() -> None:
    for make in (motor, babble):
        one, same, other = (make(np.random.default_rng(seed), RATE, float(RATE)) for seed in (1, 1, 2))
        np.testing.assert_array_equal(one, same)
        assert not np.allclose(one, other)
