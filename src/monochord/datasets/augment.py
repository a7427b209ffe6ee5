"""Adds noise to windows for training; pitch and time stay unchanged, since they carry the position."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from monochord.core.errors import InputError, did_you_mean
from monochord.core.ranges import Checked, Pair, SampleRate, Share, Whole, checked, refuse_unordered
from monochord.core.shapes import batch, numbers
from monochord.core.types import Audio, Floats, Indices
from monochord.dsp.noise import NOISES, STEADY, mixed

RECORDED = "recorded"
"""The noise kind that uses files of music or speech."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Augmentation(Checked):
    """Adds noise to windows: a random kind at a random signal-to-noise ratio for each window.

    The noise depends only on the seed, the epoch and the window's row in the dataset: not on order, batch
    size or the number of workers. "white", "pink" and "band" are independent in each microphone, like
    preamplifier noise; "hum" and recordings are the same in both.

    Parameters
    ----------
    copies
        Number of noisy copies of each window added to the clean one in training; 0 for none.
    kinds
        Kinds from `monochord.dsp.noise.NOISES`, equally likely; `recordings` add the kind "recorded".
    ratios
        Range of the signal-to-noise ratio in dB, relative to the window's power over both microphones.
    share
        Share of windows with added noise.
    recordings
        Files of music or speech for random excerpts. They are read and resampled once.

    Raises
    ------
    InputError
        If a kind is unknown, copies, ratios or share are out of range, or a recording is unreadable or too
        short.

    Examples
    --------
    >>> windows = np.random.default_rng(0).normal(size=(2, 2, 4410)).astype(np.float32)
    >>> noisy = Augmentation()(windows, [7, 8], seed=1)
    >>> alone = Augmentation()(windows[1:], [8], seed=1)
    >>> bool((noisy[1] == alone[0]).all()), bool((noisy[0] == windows[0]).any())
    (True, False)
    """

    copies: Annotated[int, Meta(ge=0, le=100)] = 0
    kinds: tuple[str, ...] = STEADY
    ratios: Pair[Annotated[float, Meta(ge=-100.0, le=200.0)]] = (5.0, 25.0)
    share: Share = 1.0
    recordings: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        for kind in self.kinds:
            if kind not in NOISES:
                raise InputError(f"noise '{kind}'", ", ".join(NOISES), did_you_mean(kind, NOISES))
        if not self.kinds and not self.recordings:
            raise InputError("augmentation without noises", "a kind or a recording", "omit it instead")
        refuse_unordered("noise", ratios=self.ratios)

    @checked
    def __call__(
        self,
        windows: Audio,
        rows: Sequence[int] | Indices,
        *,
        seed: Whole = 0,
        epoch: Whole = 0,
        sample_rate: SampleRate = 44100,
    ) -> Audio:
        """Return windows (n, channels, frames) with noise added, as a copy.

        `rows` (n,) are the windows' rows in the dataset, and `sample_rate` is in Hz. A window that is silent
        or holds non-finite values is returned unchanged: it has no level for a ratio.
        """
        windows = batch(windows)
        numbered = numbers(rows, np.int64, "rows")
        if numbered.shape != (len(windows),):
            raise InputError(f"rows of shape {numbered.shape}", f"({len(windows)},), one for each window")
        out = windows.copy()
        for number, row in enumerate(numbered.tolist()):
            out[number] = self._noisy(windows[number], (seed, epoch, int(row)), sample_rate)
        return out

    def _noisy(self, window: Audio, seeds: tuple[int, int, int], sample_rate: int) -> Audio:
        power = float(np.vdot(window, window))
        if not 0.0 < power < np.inf:
            return window
        noise, ratio = _drawn(self, seeds, window.shape, sample_rate)
        if noise is None:
            return window
        return mixed(window.astype(np.float64), noise, ratio).astype(np.float32)

    def drawn(
        self, seeds: tuple[int, int, int], shape: tuple[int, ...], sample_rate: int
    ) -> tuple[Floats | None, float]:
        """Return the noise that these seeds give, None for none, and its signal-to-noise ratio in dB."""
        stream = np.random.Generator(np.random.SFC64(np.random.SeedSequence(seeds)))
        if stream.random() >= self.share:
            return None, 0.0
        kinds = (*self.kinds, RECORDED) if self.recordings else self.kinds
        kind = kinds[int(stream.integers(len(kinds)))]
        ratio = stream.uniform(*self.ratios)
        if kind == RECORDED:
            return self._excerpt(stream, shape, sample_rate), ratio
        return NOISES[kind](stream, shape, float(sample_rate)), ratio

    def _excerpt(self, stream: np.random.Generator, shape: tuple[int, ...], sample_rate: int) -> Floats:
        sounds = _sounds(self.recordings, sample_rate)
        sound = sounds[int(stream.integers(len(sounds)))]
        if sound.size < shape[-1]:
            given = f"a recording of {sound.size / sample_rate:.3g} s"
            raise InputError(given, "a recording at least as long as a window")
        for _ in range(8):  # a pause in speech has no level
            begin = int(stream.integers(sound.size - shape[-1] + 1))
            excerpt = sound[begin : begin + shape[-1]].astype(np.float64)
            if excerpt.any():
                return np.broadcast_to(excerpt, shape)
        return NOISES["white"](stream, shape, float(sample_rate))


@lru_cache(maxsize=1)  # some windows in turn have the same
def _drawn(
    noise: Augmentation, seeds: tuple[int, int, int], shape: tuple[int, ...], sample_rate: int
) -> tuple[Floats | None, float]:
    return noise.drawn(seeds, shape, sample_rate)


@lru_cache(maxsize=1)
def _sounds(recordings: tuple[Path, ...], sample_rate: int) -> tuple[Audio, ...]:
    return tuple(_read(path, sample_rate) for path in recordings)


def _read(path: Path, sample_rate: int) -> Audio:
    """Return a recording as one channel (n,) at the windows' sample rate."""
    import soundfile  # noqa: PLC0415
    import soxr  # noqa: PLC0415

    try:
        samples, file_rate = soundfile.read(path, dtype="float32", always_2d=True)
    except (OSError, RuntimeError) as error:
        raise InputError(f"recording {path} ({error})", "a wav or flac file") from error
    sound = np.asarray(soxr.resample(samples.mean(axis=1), file_rate, sample_rate), np.float32)
    if not np.isfinite(sound).all() or not sound.any():
        raise InputError(f"recording {path}", "finite samples with a level above zero")
    return sound
