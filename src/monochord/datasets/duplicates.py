"""Finds copies of a recording, whole or cut, by shared samples.

Runs of `RUN` samples, rounded to 16 bits, are compared. Two takes share a run by chance as rarely as two
random numbers are equal, because of the converter's noise. The samples' bits decide where runs begin, at
about one in `SPACING`, so that the same sound gives the same runs wherever a recording begins
(content-defined chunks; Manber 1994, Finding similar files in a large file system). All runs are sorted once,
for any number of sessions.

A copy that was scaled, resampled or mixed with other sound shares no samples and is not found.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Indices
from monochord.core.units import Samples

RUN: Samples = 24
SPACING = 256
FULL_SCALE = 32767.0
MIN_RANGE = 32
"""Smallest range of a run, in 16-bit steps: silence and clipping are the same everywhere."""
MIN_SHARE = 0.2
"""Share of the shorter session's runs that the other must contain."""
MIN_RUNS = 8
"""Smallest number of runs that two sessions must share."""
FACTOR = np.uint64(0x9E3779B97F4A7C15)
"""Odd, with its bits spread evenly: 2**64 over the golden ratio."""

Track = Callable[[int], Audio]
"""Returns the samples (channels, n) of a session by number."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Duplicate:
    """Two sessions with the same sound: frame f of `first` is frame f + `lag` of `second`.

    `share` is the share of the shorter session's runs that the other contains.
    """

    first: int
    second: int
    lag: Samples
    share: float


def find_duplicates(track: Track, pairs: Iterable[tuple[int, int]]) -> list[Duplicate]:
    """Return the pairs of sessions with the same sound, each at the lag with the most matching samples.

    Parameters
    ----------
    track
        Returns the samples of a session.
    pairs
        Pairs of session numbers to compare, the lower one first.

    Returns
    -------
    list of Duplicate
        In the order of `pairs`.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> sound = rng.normal(size=(2, 88200)).astype(np.float32)
    >>> takes = [sound, rng.normal(size=(2, 88200)).astype(np.float32), sound[:, 4410:]]
    >>> [(d.first, d.second, d.lag) for d in find_duplicates(takes.__getitem__, [(0, 1), (0, 2), (1, 2)])]
    [(0, 2, -4410)]
    """
    pairs = list(pairs)
    numbers = sorted({number for pair in pairs for number in pair})
    runs = {number: _runs(track(number)) for number in numbers}
    shared = _shared(runs)
    found: list[Duplicate] = []
    for pair in pairs:
        lags = shared.get(pair, np.zeros(0, np.int64))
        count = min(len(runs[number][0]) for number in pair)
        if len(lags) >= max(MIN_RUNS, MIN_SHARE * count):
            values, counts = np.unique(lags, return_counts=True)
            lag = int(values[counts.argmax()])
            found.append(Duplicate(first=pair[0], second=pair[1], lag=lag, share=len(lags) / count))
    return found


def _runs(samples: Audio) -> tuple[NDArray[np.uint64], Indices]:
    """Return the unique run keys of a session (n,), and their first frames (n,)."""
    keys: list[NDArray[np.uint64]] = []
    frames: list[Indices] = []
    for channel in samples:
        rounded = np.rint(FULL_SCALE * np.nan_to_num(channel, posinf=0.0, neginf=0.0)).astype(np.int64)
        bits = rounded.astype(np.uint64)
        chosen = (bits * FACTOR) >> np.uint64(32) & np.uint64(SPACING - 1) == 0
        begin = np.flatnonzero(chosen[: max(bits.size - RUN, 0)])
        run = begin[:, None] + np.arange(RUN)
        begin = begin[np.ptp(rounded[run], axis=1) >= MIN_RANGE] if len(begin) else begin
        key = np.zeros(len(begin), np.uint64)
        for after in range(RUN):
            key = (key ^ bits[begin + after]) * FACTOR
        keys.append(key)
        frames.append(begin)
    key, first = np.unique(np.concatenate(keys), return_index=True)
    return key, np.concatenate(frames)[first]


def _shared(
    runs: dict[int, tuple[NDArray[np.uint64], Indices]],
) -> dict[tuple[int, int], NDArray[np.int64]]:
    """Return the lags of all runs shared by two sessions, by pair."""
    if not runs:
        return {}
    keys = np.concatenate([key for key, _ in runs.values()])
    frames = np.concatenate([frame for _, frame in runs.values()])
    numbers = np.repeat(list(runs), [len(key) for key, _ in runs.values()])
    order = np.lexsort((numbers, keys))
    keys, frames, numbers = keys[order], frames[order], numbers[order]
    lags: dict[tuple[int, int], list[NDArray[np.int64]]] = {}
    for one, other in _neighbours(keys):
        pair_of = np.stack([numbers[one], numbers[other]], axis=1)
        pairs, which = np.unique(pair_of, axis=0, return_inverse=True)
        for at, pair in enumerate(pairs.tolist()):
            own = which.ravel() == at
            lags.setdefault((pair[0], pair[1]), []).append(frames[other][own] - frames[one][own])
    return {pair: np.concatenate(each) for pair, each in lags.items()}


def _neighbours(keys: NDArray[np.uint64]) -> Iterator[tuple[Indices, Indices]]:
    """Yield the indices of equal keys, which are sorted: adjacent ones, then those two apart, and so on."""
    apart = 1
    while True:
        one = np.flatnonzero(keys[:-apart] == keys[apart:])
        if not len(one):
            return
        yield one, one + apart
        apart += 1
