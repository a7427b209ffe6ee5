"""Simulates faulty microphones in windows: sound unlike the training data."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError, did_you_mean
from monochord.core.types import Audio, Floats
from monochord.core.units import Hertz
from monochord.dsp.noise import hum

HISS = 1e-5, 3e-3
"""Rms in full scale of the residual noise in a dead microphone's channel: assumed."""
MAINS: tuple[Hertz, Hertz] = (50.0, 60.0)
MAINS_LEVEL = 1e-4, 1e-2
"""Rms in full scale of mains hum in a dead channel, where there is any: assumed, for an open cable."""
SILENT_SHARE, MAINS_SHARE = 0.3, 0.5
"""Probability that a dead channel is all zeros, and that a nonzero one has mains hum."""
OVERDRIVE = 2.0, 20.0
"""Peak over full scale of a heavily clipped window."""
HUM = 1.0, 10.0
"""Rms of a hum that masks the string, relative to the window's."""
SECOND_LEVEL = 0.5, 1.5
"""Rms of a second string in the same channels, relative to the window's."""
SECOND_PITCH = 0.03, 0.3
"""Relative offset of its partials above or below the window's."""
FAULTS = ("microphone 1 dead", "microphone 2 dead", "microphones swapped", "clipping", "hum", "second string")


@dataclass(frozen=True, kw_only=True)
class Fault:
    """Makes windows with one fault; the result depends only on the seed, the epoch and the row.

    A dead microphone's channel is silent, or has hiss and mains hum; swapped microphones are exchanged; with
    clipping, most of a window is beyond full scale; hum is louder than the string. A second string is the
    window itself with each channel's partials shifted, like a string touched at another position.

    Parameters
    ----------
    kind
        A kind from `FAULTS`.

    Raises
    ------
    InputError
        For an unknown kind.

    Examples
    --------
    >>> windows = np.random.default_rng(0).normal(size=(1, 2, 4410)).astype(np.float32)
    >>> bool((Fault(kind="microphones swapped")(windows, [3])[0] == windows[0, ::-1]).all())
    True
    """

    kind: str

    def __post_init__(self) -> None:
        if self.kind not in FAULTS:
            raise InputError(f"fault '{self.kind}'", ", ".join(FAULTS), did_you_mean(self.kind, FAULTS))

    def __call__(
        self,
        windows: Audio,
        rows: Sequence[int] | NDArray[np.int64],
        *,
        seed: int = 0,
        epoch: int = 0,
        sample_rate: int = 44100,
    ) -> Audio:
        """Return windows (n, 2, frames) with the fault, as a copy.

        `rows` (n,) are the windows' rows in the dataset, and `sample_rate` is in Hz.
        """
        out = windows.copy()
        for window, row in zip(out, rows, strict=True):
            seeds = np.random.SeedSequence((seed, epoch, int(row), FAULTS.index(self.kind)))
            self._spoil(window, np.random.Generator(np.random.SFC64(seeds)), float(sample_rate))
        return out

    def _spoil(self, window: Audio, random: np.random.Generator, sample_rate: Hertz) -> None:
        if self.kind == "microphones swapped":
            window[:] = window[::-1].copy()
        elif self.kind == "clipping":
            peak = max(float(np.abs(window).max()), 1e-9)
            np.clip(window * (_between(random, OVERDRIVE) / peak), -1.0, 1.0, out=window)
        elif self.kind == "hum":
            rms = float(np.sqrt(np.mean(np.square(window, dtype=float))))
            mains = hum(random, window.shape, sample_rate)
            np.clip(window + rms * _between(random, HUM) * mains, -1.0, 1.0, out=window)
        elif self.kind == "second string":
            level = _between(random, SECOND_LEVEL)
            for channel in range(len(window)):
                pitch = (1.0 + _between(random, SECOND_PITCH)) ** float(random.choice((-1.0, 1.0)))
                window[channel] += level * _at_pitch(window[channel], pitch)
            window /= max(float(np.abs(window).max()), 1.0)
        else:
            window[int(self.kind == "microphone 2 dead")] = self._dead(random, window.shape[1], sample_rate)

    def _dead(self, random: np.random.Generator, frames: int, sample_rate: Hertz) -> Floats:
        """Return the content of a dead microphone's channel, (frames,)."""
        if random.random() < SILENT_SHARE:
            return np.zeros(frames)
        sound = _between(random, HISS) * random.standard_normal(frames)
        if random.random() < MAINS_SHARE:
            mains = hum(random, (1, frames), sample_rate, mains=float(random.choice(MAINS)))
            sound += _between(random, MAINS_LEVEL) * mains[0]
        return sound


def _at_pitch(samples: Audio, pitch: float) -> Floats:
    """Return samples (frames,) with frequencies scaled by `pitch`.

    Missing samples repeat the end backwards.
    """
    there_and_back = np.concatenate([samples, samples[-2:0:-1]])
    return np.interp(pitch * np.arange(samples.size), np.arange(there_and_back.size), there_and_back)


def _between(random: np.random.Generator, span: tuple[float, float]) -> float:
    return float(np.exp(random.uniform(*np.log(span))))
