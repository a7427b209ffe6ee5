"""Detects onsets in the microphones' sound: when something strikes the string."""

import math

import numpy as np

from monochord.core.types import Audio, Floats
from monochord.core.units import Samples

ORDER = 48
"""Order of the linear prediction; it follows two dozen sinusoids."""
MIN_ONSET_SHARE = 0.1
"""Share of the largest error below which no onset begins: high-frequency waves arrive first."""
MIN_LOUDNESS_RATIO = 3.0
"""An earlier event must be this many times louder than the sound before it."""
MIN_NOISE: Samples = 64
"""Smallest number of noise frames before an event. Ten of them have a third of their usual size by chance."""
ONSET_MARGIN: Samples = 8
"""Frames skipped before an event, where its beginning may reach into."""
MAX_NOVELTY = 5.0
"""Limit of the novelty in nepers of power; it keeps one loud event from standing for many."""
FLOOR = 1e-7
"""Share of white noise added; nothing below it is predicted away."""


def surprise(samples: Audio | Floats) -> Floats:
    """Return each channel's linear prediction error (channels, n) over its median absolute error.

    The best linear prediction over the whole stretch, at least a few hundred frames, removes steady sound: a
    ringing string, hum, tones of music. New sound stands out, with a bandwidth that follows from how sudden
    it was. Silence gives zero.

    >>> time = np.arange(4410) / 44100
    >>> sound = np.sin(2 * np.pi * 400 * time) + 1e-4 * np.random.default_rng(0).standard_normal(4410)
    >>> sound[2000:] += 0.05
    >>> int(np.abs(surprise(sound[np.newaxis])[0]).argmax())
    2000
    """
    from scipy.linalg import solve_toeplitz  # noqa: PLC0415

    errors = np.zeros(samples.shape)
    for row, channel in enumerate(samples.astype(np.float64)):
        size = 1 << int(np.ceil(np.log2(channel.size + ORDER + 1)))
        power = np.abs(np.fft.rfft(channel, size)) ** 2
        likeness = np.fft.irfft(power)[: ORDER + 1]
        if not likeness[0] > 0.0:
            continue
        likeness[0] *= 1.0 + FLOOR
        weights = solve_toeplitz(likeness[:-1], likeness[1:])
        error = np.convolve(channel, np.concatenate([[1.0], -weights]))[: channel.size]
        error[:ORDER] = 0.0
        usual = float(np.median(np.abs(error)))
        errors[row] = error / (usual if usual > 0.0 else float(np.abs(error).max()) or 1.0)
    return errors


def novelty(sound: Audio | Floats, size: Samples) -> Floats:
    """Return how much louder each frame of `size` samples is than the 20 frames before it, in nepers.

    `sound` is (channels, n), the result (n // size,). Channels have equal weight. A frame that is not louder
    counts as zero.

    >>> errors = np.random.default_rng(0).standard_normal((2, 4400))
    >>> errors[:, 2200:2244] *= 20.0
    >>> int(novelty(errors, 44).argmax())
    50
    """
    frames = sound.shape[1] // size
    cut = sound[:, : frames * size].astype(np.float64).reshape(sound.shape[0], frames, size)
    power = np.mean(cut**2, axis=2)
    usual = np.median(power, axis=1, keepdims=True)
    level = np.log(np.mean(power / np.where(usual > 0.0, usual, 1.0), axis=0) + 1e-12)
    padded = np.concatenate([np.full(20, level[:20].max(initial=0.0)), level])
    before = np.lib.stride_tricks.sliding_window_view(padded, 20)[:frames]
    return np.clip(level - np.quantile(before, 0.9, axis=1), 0.0, MAX_NOVELTY)


def pick(errors: Floats) -> float:
    """Return where noise turns into an event, by Akaike's criterion, as a sample index; NaN if nowhere.

    The result is the index k that minimises k log var(e[:k]) + (n - k - 1) log var(e[k:]) (Maeda 1985): the
    most likely split of one channel (n,) into two stretches of constant variance. A hundredth of the largest
    square is added to both variances.

    >>> errors = np.random.default_rng(0).standard_normal(400)
    >>> errors[250:] *= 10.0
    >>> abs(pick(errors) - 250) <= 2
    True
    """
    n = errors.size
    if n < 16 or not np.any(errors):
        return float("nan")
    count, tiny = np.arange(1, n), float(MIN_ONSET_SHARE * np.abs(errors).max()) ** 2
    total, square = np.cumsum(errors), np.cumsum(errors**2)
    left = square[:-1] / count - (total[:-1] / count) ** 2
    right = (square[-1] - square[:-1]) / (n - count) - ((total[-1] - total[:-1]) / (n - count)) ** 2
    cost = count * np.log(left + tiny) + (n - count - 1) * np.log(right + tiny)
    inner = slice(6, n - 8)
    return float(np.argmin(cost[inner]) + inner.start + 1)


def first_onset(errors: Floats) -> float:
    """Return the sample index of the first event that stands out beside the strongest, or NaN.

    Louder events, such as its release, follow a touch. `pick` finds the strongest, then the event before it,
    for as long as the earlier event is several times louder than the sound before it. The channel (n,) begins
    with `MIN_NOISE` samples of noise or more.

    >>> errors = np.random.default_rng(0).standard_normal(600)
    >>> errors[250:] *= 10.0
    >>> errors[450:] *= 5.0
    >>> abs(pick(errors) - 450) <= 3, abs(first_onset(errors) - 250) <= 3
    (True, True)
    """
    onset, smallest = pick(errors), MIN_ONSET_SHARE * float(np.abs(errors).max(initial=0.0))
    while np.isfinite(onset):
        stop = int(onset) - ONSET_MARGIN
        sooner = pick(errors[: max(stop, 0)])
        if not sooner >= MIN_NOISE:  # nor NaN
            break
        noise, event = (np.sqrt(np.mean(e**2)) for e in (errors[: int(sooner)], errors[int(sooner) : stop]))
        if event < max(MIN_LOUDNESS_RATIO * noise, 0.5 * smallest):
            break
        onset = sooner
    return onset if onset >= MIN_NOISE else math.nan


def loudness_of(errors: Floats, onset: float) -> float:
    """Return how many times louder one channel (n,) is just after an onset than before; NaN without an onset.

    >>> errors = np.random.default_rng(0).standard_normal(400)
    >>> errors[250:] *= 10.0
    >>> round(loudness_of(errors, 250.0))
    10
    """
    if not onset >= 1.0:
        return math.nan
    at = int(onset)
    before, after = (float(np.sqrt(np.mean(part**2))) for part in (errors[:at], errors[at : at + MIN_NOISE]))
    return after / max(before, 1e-30)
