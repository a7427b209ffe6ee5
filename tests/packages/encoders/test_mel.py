"""The mel filter bank, the frames, and the log-mel energies, against their definition elsewhere."""

from collections.abc import Callable

import numpy as np
import pytest

from monochord.core.errors import InputError
from monochord.core.types import Audio, Floats
from monochord_encoders.mel import FLOOR, MEL_RATE, LogMel, frame_indices, mel, mel_filters

PLACE = mel(np.arange(257, dtype=np.float64) * 31.25)


def bank(bins: int, lowest: float = 20.0, highest: float = 8000.0) -> Floats:
    return mel_filters(bins, fft_size=512, sample_rate=MEL_RATE, lowest=lowest, highest=highest)


def corners(bins: int) -> Floats:
    low, high = mel(np.array([20.0, 8000.0])).tolist()
    return np.linspace(low, high, bins + 2)


@pytest.fixture
def sound() -> Audio:
    """A tenth of a second that is loud and soft, tonal and noisy, and has a mean."""
    rng, time = np.random.default_rng(5), np.arange(1600) / MEL_RATE
    tones = np.sum([np.sin(2 * np.pi * f * time + f) / f for f in (374.0, 695.0, 1390.0, 6100.0)], axis=0)
    return np.stack([0.1 + 100.0 * tones, 1e-3 * rng.standard_normal(1600)]).astype(np.float32)


def test_filters_lie_side_by_side() -> None:
    filters = bank(128)
    assert filters.min() == 0.0
    assert filters.max() <= 1.0
    inside = (corners(128)[1] <= PLACE) & (corners(128)[-2] >= PLACE)
    assert np.allclose(filters.sum(axis=0)[inside], 1.0)  # what one filter loses the next one gains


def test_a_filter_peaks_at_its_centre() -> None:
    nearest = np.abs(PLACE - corners(40)[1:-1, np.newaxis]).argmin(axis=1)
    assert (bank(40).argmax(axis=1)[10:] == nearest[10:]).all()  # the lowest are narrower than a bin


def test_centred_frames_mirror_the_ends() -> None:
    indices = frame_indices(1600, frame=400, hop=16, centred=True)
    assert indices.shape == (100, 400)
    assert indices[0, 190:194].tolist() == [1, 0, 0, 1]
    assert (indices[50] == 50 * 16 + 8 - 200 + np.arange(400)).all()
    assert indices[-1, -193:-190].tolist() == [1599, 1599, 1598]


def test_frames_of_a_sound_shorter_than_the_mirror_stay_inside() -> None:
    indices = frame_indices(100, frame=400, hop=16, centred=True)
    assert indices.min() == 0
    assert indices.max() == 99


def test_a_tone_is_loudest_in_its_band() -> None:
    tone = np.sin(2 * np.pi * 1000.0 * np.arange(1600) / MEL_RATE).astype(np.float32)
    energies = LogMel(size=1600, hop=16, centred=True)(tone[None])
    assert (energies[0, 12:-12].argmax(axis=1) == bank(128)[:, 32].argmax()).all()  # the rest is mirrored


def test_twice_as_loud_is_four_times_the_energy(sound: Audio) -> None:
    energies = LogMel(size=1600, hop=16, centred=True)
    once, twice = energies(sound), energies(2.0 * sound)
    above_floor = once > np.log(FLOOR) + 1e-3
    assert above_floor.mean() > 0.5
    assert np.abs(twice - once - np.log(4.0))[above_floor].max() < 1e-5


def test_silence_is_the_floor() -> None:
    energies = LogMel(size=1600, hop=160)(np.full((1, 1600), 0.25, np.float32))
    assert energies.shape == (1, 8, 128)
    assert np.allclose(energies, np.log(FLOOR))


def test_a_channel_does_not_depend_on_the_other(sound: Audio) -> None:
    energies = LogMel(size=1600, hop=16, centred=True)
    turned = energies(sound[::-1])
    assert np.allclose(energies(sound), turned[::-1], atol=1e-6)


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: bank(8, -1.0),
        lambda: bank(8, 20.0, 8001.0),
        lambda: bank(8, 400.0, 400.0),
        lambda: bank(0),
        lambda: LogMel(size=399, hop=160),
        lambda: LogMel(size=1600, hop=160)(np.zeros((1, 10), np.float32)),
    ],
)
def test_what_cannot_be_is_refused(wrong: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        wrong()


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(("hop", "centred"), [(160, False), (16, True)], ids=["AudioSet", "by a millisecond"])
def test_it_agrees_with_hugging_face(sound: Audio, hop: int, *, centred: bool) -> None:
    audio = pytest.importorskip("transformers.audio_utils", reason="transformers is not installed")
    filters = audio.mel_filter_bank(
        num_frequency_bins=257, num_mel_filters=128, min_frequency=20, max_frequency=8000,
        sampling_rate=MEL_RATE, norm=None, mel_scale="kaldi", triangularize_in_mel_space=True,
    )  # fmt: skip
    energies = LogMel(size=1600, hop=hop, centred=centred)(sound)
    for channel in (0, 1):
        wide = np.pad(sound[channel].astype(np.float64), 192 if centred else 0, mode="symmetric")
        theirs = audio.spectrogram(
            wide, audio.window_function(400, "hann", periodic=False), frame_length=400, hop_length=hop,
            fft_length=512, power=2.0, center=False, preemphasis=0.97, mel_filters=filters, log_mel="log",
            mel_floor=FLOOR, remove_dc_offset=True,
        ).T  # fmt: skip
        assert np.abs(energies[channel] - theirs).max() < 1e-4
