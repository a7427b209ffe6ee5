"""Voices are harmonic, too, and are no string: the far form hardly gives them a position."""

import numpy as np
import pytest
from tests.perception.windows import cut

from monochord.core.types import Audio, Signal
from monochord.dsp.speech import babble
from monochord.evaluation import recordings
from monochord.perception.estimators.closed_form import ClosedForm


def answers(sound: Audio, rate: int, open_frequency: float) -> list[float]:
    """Return the positions in a sound (n,), window by window, without the abstentions."""
    size = rate // 10
    signal = Signal(sample_rate=rate, channels=1)
    estimate = ClosedForm(length=0.65, open_frequency=open_frequency).prepare(signal, size)
    windows = cut(sound[np.newaxis], size // 2, size=size, rate=rate)
    positions = [estimate(window)["position"] for window in windows]
    return [position.value for position in positions if position.valid]


def test_speech_has_hardly_a_position() -> None:
    sound = 0.1 * babble(np.random.default_rng(4), 4 * 44100, 44100.0).astype(np.float32)
    assert len(answers(sound, 44100, 110.0)) <= 4


@pytest.mark.skipif(recordings.folder() is None, reason="no real recordings (MONOCHORD_REALSTRINGS)")
@pytest.mark.parametrize("open_frequency", [82.4, 146.8, 246.9])
def test_a_recorded_voice_has_hardly_a_position(open_frequency: float) -> None:
    (speech,) = [take for take in recordings.takes(kind="interference") if take.path.stem[0].isdigit()]
    samples, rate = speech.read()
    assert len(answers(samples[0], rate, open_frequency)) <= 9
