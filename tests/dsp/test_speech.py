import numpy as np

from monochord.dsp.speech import babble

RATE = 44100


def test_synthetic_speech_has_syllables_and_lies_below_five_kilohertz() -> None:
    sound = babble(np.random.default_rng(3), 4 * RATE, float(RATE))
    power = np.abs(np.fft.rfft(sound)) ** 2
    frequency = np.fft.rfftfreq(sound.size, 1 / RATE)
    assert power[frequency < 5000.0].sum() > 0.9 * power.sum()
    level = np.sqrt(np.mean(sound.reshape(-1, RATE // 20) ** 2, axis=1))
    assert level.min() < 0.1
    assert level.max() > 1.0
