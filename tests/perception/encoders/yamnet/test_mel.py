"""The spectrogram that YAMNet was trained on, against its definition written out."""

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.perception.encoders.yamnet.mel import YamnetMel

TIME = np.arange(15600) / 16000.0


def test_it_is_its_definition_written_out() -> None:
    sound = np.random.default_rng(0).normal(0.0, 0.1, (1, 15600)).astype(np.float32)
    found = YamnetMel(size=15600, hop=160, centred=False)(sound)
    assert found.shape == (1, 96, 64)
    place = 160 * 40
    k = np.arange(400)
    frame = sound[0, place : place + 400] * (0.5 - 0.5 * np.cos(2.0 * np.pi * k / 400))
    magnitude = np.abs(frame @ np.exp(-2j * np.pi * np.outer(k, np.arange(257)) / 512))
    mels = 1127.0 * np.log(1.0 + np.arange(257) * 31.25 / 700.0)
    low, high = 1127.0 * np.log(1.0 + np.array([125.0, 7500.0]) / 700.0)
    width = (high - low) / 65.0
    for band in (0, 20, 63):
        weight = np.maximum(1.0 - np.abs(mels - (low + width * (band + 1))) / width, 0.0)
        assert found[0, 40, band] == pytest.approx(np.log(weight @ magnitude + 0.001), abs=1e-5)


def test_silence_is_the_floor_and_a_tone_is_in_its_band() -> None:
    energies = YamnetMel(size=15600, hop=160, centred=False)
    np.testing.assert_allclose(energies(np.zeros((2, 15600), np.float32)), np.log(0.001), rtol=1e-6)
    tones = np.stack([np.sin(2.0 * np.pi * f * TIME) for f in (300.0, 700.0, 5000.0)]).astype(np.float32)
    loudest = energies(tones).mean(axis=1).argmax(axis=1)
    low, high = np.log1p(np.array([125.0, 7500.0]) / 700.0)
    expected = (np.log1p(np.array([300.0, 700.0, 5000.0]) / 700.0) - low) / (high - low) * 65.0 - 1.0
    assert np.abs(loudest - expected).max() <= 1.0


def test_frames_of_a_window() -> None:
    assert YamnetMel(size=1600, hop=16).frames == 100
    assert YamnetMel(size=1600, hop=160, centred=False).frames == 8
    assert YamnetMel(size=1600, hop=16).bands == 64


def test_what_it_cannot_serve_is_refused() -> None:
    with pytest.raises(InputError, match="20 ms of sound: allowed is a frame or more; use a longer window"):
        YamnetMel(size=320, hop=160, centred=False)
    with pytest.raises(InputError, match="a signal of 100 samples: allowed is 1600 samples"):
        YamnetMel(size=1600, hop=16)(np.zeros((2, 100), np.float32))
