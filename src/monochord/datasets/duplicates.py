"""Finds the same recording under two names: shifted, scaled, channels swapped, with noise added.

Two takes of one string are alike as no two pieces of music are: the same partials, steady for seconds. A
plain correlation finds them equal, as two sines of one frequency are at some lag. What only a copy shares
is everything else: onsets, scrapes, the hiss of the converter, at one lag throughout. So

1. each session is reduced to some 2 kHz and cut in stretches of a minute; the spectrum of a stretch keeps its
   phases and gives every frequency the same weight (Knapp & Carter 1976, phase transform): a steady partial
   is a few bins of a hundred thousand, the rest speaks for itself;
2. the correlation of two such stretches has a peak of the share of frequencies that agree, times the share of
   time that overlaps. In a minute of sound chance reaches 0.02; a peak of `MIN_PEAK` is looked into;
3. there the waveforms are compared at the full rate: at one lag, excerpts all over the overlap must correlate
   by `MIN_CORRELATION` or more in a share `MIN_LIKE_SHARE` of the places. So neither do music that plays
   beside two takes and the same motion carried out twice make them copies,
   nor a second that a simulation begins with each time;
4. an excerpt counts only if it is like no other place as much, by `MIN_LEAD`, or if a share
   `MIN_PHASE_SHARE` of all its frequencies agrees in phase. A string that sounds on
   unchanged is like itself everywhere.

It sees through noise 5 dB below a touched string. Of a string that nothing touches it finds copies without
added noise only: under noise such a copy cannot be distinguished from another take.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from os import cpu_count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Floats
from monochord.core.units import Samples

STEP: Samples = 20
"""Frames that become one where stretches are compared."""
STRETCH: Samples = 1 << 17
"""Reduced samples of a stretch: a minute at 44.1 kHz."""
MIN_STRETCH: Samples = 1 << 10
"""Reduced samples that a stretch must have to be compared: half a second."""
TAPER = 0.05
"""Share of a stretch over which it fades in and out: keeps a loud partial from leaking into all bins."""
MIN_PEAK = 0.05
MIN_CORRELATION = 0.7
MIN_LIKE_SHARE = 0.5
MIN_LEAD = 0.1
MIN_PHASE_SHARE = 0.2
MIN_OVERLAP = 0.2
"""How much of the shorter session must overlap the other at least."""
MIN_PEAK_SIGMAS = 6.0
"""What a peak must reach at least, in deviations of the peaks by chance."""
EXCERPT: Samples = 1 << 13
PLACES = 16
"""Frames of an excerpt that is compared at the full rate, and how many there are."""
LONG: Samples = 1 << 16
LAG_REACH: Samples = 200
"""Frames of an excerpt by which the exact lag is measured, and how far about the rough lag it is searched."""

Track = Callable[[int], Audio]
"""Returns the samples (channels, n) of a session by its number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Duplicate:
    """Two sessions that hold the same sound: frame f of `first` is frame f + `lag` of `second`.

    `peak` is the share of their frequencies that agree, `share` that of the places where their waveforms do.
    """

    first: int
    second: int
    lag: Samples
    peak: float
    share: float


@dataclass(frozen=True, slots=True)
class _Stretch:
    begin: Samples  # in reduced samples
    size: Samples
    phases: NDArray[np.complex64]


def find_duplicates(track: Track, pairs: Iterable[tuple[int, int]]) -> list[Duplicate]:
    """Return the pairs of sessions that hold the same sound, at the lag where they agree.

    Parameters
    ----------
    track
        Gives the samples of a session.
    pairs
        Numbers of the sessions to compare with each other.

    Returns
    -------
    list of Duplicate
        In the order of `pairs`.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> sound = rng.normal(size=(2, 88200)).astype(np.float32)
    >>> takes = [sound, rng.normal(size=(2, 88200)).astype(np.float32), -0.5 * sound[:, 4410:]]
    >>> [(d.first, d.second, d.lag) for d in find_duplicates(takes.__getitem__, [(0, 1), (0, 2), (1, 2)])]
    [(0, 2, -4410)]
    """
    pairs = list(pairs)
    numbers = sorted({number for pair in pairs for number in pair})
    with ThreadPoolExecutor(cpu_count()) as pool:  # transforms leave the interpreter to others
        cut = pool.map(lambda number: list(_stretches(track(number))), numbers)
        stretches = dict(zip(numbers, cut, strict=True))
        duplicates = pool.map(lambda pair: _compared(track, pair, stretches), pairs)
        return [duplicate for duplicate in duplicates if duplicate]


def _compared(
    track: Track, pair: tuple[int, int], stretches: Mapping[int, Sequence[_Stretch]]
) -> Duplicate | None:
    """Return at which lag two sessions hold the same sound; None if they do not."""
    for one, other in product(stretches[pair[0]], stretches[pair[1]]):
        peak, lag = _agreement(one, other)
        if peak < max(MIN_PEAK, MIN_PEAK_SIGMAS / math.sqrt(min(one.size, other.size) / 2)):
            continue
        sounds = track(pair[0]), track(pair[1])
        first, last = _overlap(*sounds, lag * STEP)
        if last - first < max(2 * EXCERPT, MIN_OVERLAP * min(each.shape[1] for each in sounds)):
            continue
        exact = _exact(*sounds, lag * STEP)
        share = _share(*sounds, exact)
        if share >= MIN_LIKE_SHARE:
            return Duplicate(first=pair[0], second=pair[1], lag=exact, peak=peak, share=share)
    return None


def _stretches(samples: Audio) -> Iterator[_Stretch]:
    reduced = _reduced(samples)
    for begin in range(0, reduced.size, STRETCH):
        piece = reduced[begin : begin + STRETCH].copy()
        if piece.size < MIN_STRETCH or not piece.any():
            continue
        fade = max(int(TAPER * piece.size), 1)
        ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(fade, dtype=np.float32) + 0.5) / fade)
        piece[:fade] *= ramp
        piece[-fade:] *= ramp[::-1]
        spectrum = np.fft.rfft(piece, 2 * STRETCH)
        phases = (spectrum / np.maximum(np.abs(spectrum), 1e-30)).astype(np.complex64)
        yield _Stretch(begin, piece.size, phases)


def _reduced(samples: Audio) -> Audio:
    """Return the sum of the channels, averaged over `STEP` frames; what is no number counts as silence."""
    frames = samples.shape[1] // STEP * STEP
    means = samples[:, :frames].sum(axis=0, dtype=np.float32).reshape(-1, STEP).mean(axis=1)
    return np.nan_to_num(means, nan=0.0, posinf=0.0, neginf=0.0)


def _agreement(one: _Stretch, other: _Stretch) -> tuple[float, int]:
    """Return the peak of the phase correlation, and its lag between the sessions in reduced samples.

    Short stretches need no longer transform: every other bin is that of half the length. What overlaps by
    less than `MIN_OVERLAP` may wrap around.
    """
    from scipy.fft import irfft  # noqa: PLC0415

    most = other.size - round(MIN_OVERLAP * min(one.size, other.size))  # the largest lag that counts
    skip = 1
    while one.size + most <= STRETCH // skip:
        skip *= 2
    length = 2 * STRETCH // skip
    agreeing: Any = irfft(one.phases[::skip].conj() * other.phases[::skip], length)  # in single precision
    curve: Audio = np.abs(agreeing)
    at = int(curve.argmax())
    lag = at if at <= most else at - length
    return float(curve[at]), lag + other.begin - one.begin


def _exact(one: Audio, other: Audio, lag: Samples) -> Samples:
    """Return the lag in frames near the given one, by the phase correlation at the full rate."""
    first, last = _overlap(one, other, lag)
    size = min(LONG, last - first)
    fade = np.hanning(size)
    total = np.zeros(2 * LAG_REACH + 1)
    for begin in np.linspace(first, last - size, PLACES // 4).astype(int).tolist():
        a, b = (
            np.fft.rfft(fade * _mono(each, at, size)) for each, at in ((one, begin), (other, begin + lag))
        )
        cross = a.conj() * b
        curve = np.fft.irfft(cross / np.maximum(np.abs(cross), 1e-30), size)
        total += np.concatenate([curve[-LAG_REACH:], curve[: LAG_REACH + 1]])
    return lag + int(np.abs(total).argmax()) - LAG_REACH


def _share(one: Audio, other: Audio, lag: Samples) -> float:
    """Return in which share of places all over the overlap the waveforms are alike, as no others are."""
    first, last = _overlap(one, other, lag)
    begins = np.linspace(first, last - EXCERPT, PLACES).astype(int)
    a, b = (
        np.stack([_mono(each, begin, EXCERPT) for begin in starts.tolist()])
        for each, starts in ((one, begins), (other, begins + lag))
    )
    a, b = (each / np.maximum(np.linalg.norm(each, axis=1, keepdims=True), 1e-30) for each in (a, b))
    own = np.abs(np.sum(a * b, axis=1))
    if np.mean(own >= MIN_CORRELATION) < MIN_LIKE_SHARE:
        return 0.0
    left, right = np.fft.rfft(a), np.fft.rfft(b)
    shifts = range(PLACES // 4, PLACES, PLACES // 4)
    rivals = [
        np.abs(np.fft.irfft(left.conj() * np.roll(right, by, axis=0), EXCERPT)).max(axis=1) for by in shifts
    ]
    fade = np.hanning(EXCERPT)
    cross = np.fft.rfft(fade * a).conj() * np.fft.rfft(fade * b)
    phases = np.abs(np.mean((cross / np.maximum(np.abs(cross), 1e-30)).real, axis=1))
    alone = (own - np.median(rivals, axis=0) >= MIN_LEAD) | (phases >= MIN_PHASE_SHARE)
    return float(np.mean((own >= MIN_CORRELATION) & alone))


def _overlap(one: Audio, other: Audio, lag: Samples) -> tuple[Samples, Samples]:
    return max(0, -lag), min(one.shape[1], other.shape[1] - lag)


def _mono(samples: Audio, begin: Samples, size: Samples) -> Floats:
    """Return the sum of the channels from frame `begin` on, zeros where there is none."""
    out = np.zeros(size)
    low, high = max(begin, 0), min(begin + size, samples.shape[1])
    total = samples[:, low:high].sum(axis=0, dtype=np.float64)
    out[low - begin : high - begin] = np.nan_to_num(total, nan=0.0, posinf=0.0, neginf=0.0)
    return out
