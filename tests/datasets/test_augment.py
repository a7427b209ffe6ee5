"""Noise is added at the ratio drawn, and depends on seed, epoch and window alone."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
import soundfile

from monochord.core.errors import InputError
from monochord.core.types import Audio
from monochord.datasets.augment import Augmentation

RATE = 44100


@pytest.fixture(name="windows")
def _windows() -> Audio:
    rng = np.random.default_rng(0)
    tones = np.sin(2 * np.pi * rng.uniform(200, 3000, (60, 2, 1)) * np.arange(4410) / RATE)
    return (tones * rng.uniform(0.001, 0.5, (60, 1, 1))).astype(np.float32)


def ratios(windows: Audio, noisy: Audio) -> np.ndarray:
    added = noisy.astype(float) - windows
    return 10.0 * np.log10((windows.astype(float) ** 2).mean(axis=(1, 2)) / (added**2).mean(axis=(1, 2)))


def test_ratios_are_drawn_from_the_whole_range_against_each_windows_own_level(windows: Audio) -> None:
    measured = ratios(windows, Augmentation()(windows, range(60)))
    assert 4.9 < measured.min() < 7.0
    assert 23.0 < measured.max() < 25.1
    fixed = ratios(windows, Augmentation(ratios=(12.0, 12.0))(windows, range(60)))
    assert fixed == pytest.approx(12.0, abs=0.01)


def test_a_windows_noise_does_not_depend_on_its_batch(windows: Audio) -> None:
    noisy = partial(Augmentation(), seed=3, epoch=2)
    whole = noisy(windows, range(60))
    order = np.random.default_rng(1).permutation(60)
    shuffled = np.concatenate([noisy(windows[part], part) for part in np.array_split(order, 7)])
    assert (shuffled == whole[order]).all()


@pytest.mark.parametrize("other", [{"seed": 4}, {"epoch": 1}, {"first": 60}])
def test_seed_epoch_and_row_change_the_noise(windows: Audio, other: dict[str, int]) -> None:
    first = other.get("first", 0)
    noisy = Augmentation()
    usual = noisy(windows, range(60), seed=3)
    seed, epoch = other.get("seed", 3), other.get("epoch", 0)
    changed = noisy(windows, range(first, first + 60), seed=seed, epoch=epoch)
    assert not (usual == changed).all(axis=(1, 2)).any()


def test_the_window_that_is_given_stays_as_it_is(windows: Audio) -> None:
    before = windows.copy()
    Augmentation()(windows, range(60))
    assert (windows == before).all()


def test_a_share_of_the_windows_gets_none(windows: Audio) -> None:
    same = (Augmentation(share=0.5)(windows, range(60)) == windows).all(axis=(1, 2))
    assert 15 < same.sum() < 45
    assert (Augmentation(share=0.0)(windows, range(60)) == windows).all()


def test_silence_and_what_is_no_number_stay(windows: Audio) -> None:
    windows[0], windows[1, 0, 5], windows[2, 1, 5] = 0.0, np.nan, np.inf
    noisy = Augmentation()(windows, range(60))
    assert np.array_equal(noisy[:3], windows[:3], equal_nan=True)
    assert not (noisy[3:] == windows[3:]).all(axis=(1, 2)).any()


def test_recordings_are_resampled_and_reach_both_microphones(windows: Audio, tmp_path: Path) -> None:
    tone = 0.3 * np.sin(2 * np.pi * 1000.0 * np.arange(48000) / 48000)
    soundfile.write(tmp_path / "tone.wav", np.stack([tone, tone], axis=1), 48000)
    music = Augmentation(kinds=(), recordings=(tmp_path / "tone.wav",), ratios=(0.0, 0.0))
    noisy = music(windows, range(60))
    added = noisy - windows
    assert np.abs(added[:, 0] - added[:, 1]).max() < 1e-6
    assert {int(np.abs(np.fft.rfft(each[0])).argmax()) for each in added} == {100}
    assert ratios(windows, noisy) == pytest.approx(0.0, abs=0.01)
    assert len({round(float(each[0, 0] / np.abs(each).max()), 2) for each in added}) > 20


@pytest.mark.parametrize(
    "options",
    [{"kinds": ("pnik",)}, {"kinds": ()}, {"ratios": (20.0, 10.0)}, {"share": 1.5}, {"copies": 101}],
)
def test_options_that_cannot_be_are_refused(options: dict[str, object]) -> None:
    with pytest.raises(InputError):
        Augmentation(**options)  # pyright: ignore[reportArgumentType]


def test_recordings_that_cannot_be_used_are_refused(windows: Audio, tmp_path: Path) -> None:
    soundfile.write(tmp_path / "short.wav", np.ones(100), RATE)
    soundfile.write(tmp_path / "silent.wav", np.zeros(9999), RATE)
    (tmp_path / "text.wav").write_text("no sound")
    for name in ("short", "silent", "text", "absent"):
        with pytest.raises(InputError):
            Augmentation(kinds=(), recordings=(tmp_path / f"{name}.wav",))(windows, range(60))
