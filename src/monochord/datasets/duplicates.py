"""Finds copies of a recording, whole or cut, by shared samples.

Runs of `RUN` samples, rounded to 16 bits, are compared. Two takes share a run by chance as rarely as two
random numbers are equal, because of the converter's noise. The samples' bits decide where runs begin, at
about one in `SPACING`, so that the same sound gives the same runs wherever a recording begins
(content-defined chunks; Manber 1994, Finding similar files in a large file system). Runs are sorted in
buckets of their keys, which spill to a temporary file each: time grows as the sound, and memory holds one
bucket, for any number of sessions.

A copy that was scaled, resampled or mixed with other sound shares no samples and is not found.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from tempfile import SpooledTemporaryFile
from typing import IO

import numpy as np
from numpy.typing import NDArray

from monochord.core.types import Audio, Flags, Indices
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
COMPARED = 16
"""Number of following sessions with the same content that a session is compared with. So a thousand copies
of a session are found in linear time, if not each of their half a million pairs."""
BUCKETS = 64
"""Number of buckets of runs: one's share of the memory for all runs."""
IN_MEMORY = 1 << 16
"""Size up to which a bucket stays in memory, in bytes: all of them are 4 MB."""
RUN_TYPE = np.dtype([("key", np.uint64), ("frame", np.int64), ("session", np.int32)])

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


def find_duplicates(track: Track, parts: Sequence[int] | Indices) -> list[Duplicate]:
    """Return the sessions in different parts with the same sound, each at the lag with most matching samples.

    `track` returns the samples of a session; `parts` (sessions,) are bit masks of the parts in which it has
    windows. Of more than `COMPARED` sessions with the same sound, not every pair is returned.

    >>> rng = np.random.default_rng(0)
    >>> sound = rng.normal(size=(2, 88200)).astype(np.float32)
    >>> takes = [sound, rng.normal(size=(2, 88200)).astype(np.float32), sound[:, 4410:]]
    >>> [(d.first, d.second, d.lag) for d in find_duplicates(takes.__getitem__, [1, 1, 2])]
    [(0, 2, -4410)]
    """
    masks, counts = np.asarray(parts, np.int64), np.zeros(len(parts), np.int64)
    matches = np.zeros((0, 4), np.int64)
    with ExitStack() as stack:
        buckets = [stack.enter_context(SpooledTemporaryFile(IN_MEMORY)) for _ in range(BUCKETS)]
        for number in np.flatnonzero(masks).tolist():
            counts[number] = _sort_into(buckets, number, *_runs(track(number)))
        for bucket in buckets:
            matches = _summed(np.concatenate([matches, *_matches(bucket, masks)]))
    return list(_copies(matches, counts))


def crossing(masks: Indices, first: Indices, second: Indices) -> Flags:
    """Return which pairs of sessions (n,) have windows in different parts, given each session's bit mask.

    >>> crossing(np.array([1, 2, 0, 3]), np.array([0, 0, 1, 3]), np.array([1, 2, 1, 3])).tolist()
    [True, False, False, True]
    """
    both = masks[first] | masks[second]
    return (masks[first] > 0) & (masks[second] > 0) & (both & (both - 1) > 0)


def _sort_into(buckets: Sequence[IO[bytes]], session: int, keys: NDArray[np.uint64], frames: Indices) -> int:
    """Write a session's runs, by rising key, into buckets of equal ranges of keys; return their number."""
    runs = np.empty(len(keys), RUN_TYPE)
    runs["key"], runs["frame"], runs["session"] = keys, frames, session
    width = np.uint64(2**64 // len(buckets))
    edges = np.searchsorted(keys, np.arange(1, len(buckets), dtype=np.uint64) * width)
    for bucket, some in zip(buckets, np.split(runs, edges), strict=True):
        bucket.write(some.tobytes())
    return len(keys)


def _matches(bucket: IO[bytes], masks: Indices) -> Iterator[Indices]:
    """Yield rows (n, 4) of first session, second session, lag and 1 for the runs shared across parts."""
    bucket.seek(0)
    runs = np.frombuffer(bucket.read(), RUN_TYPE)
    runs = runs[np.lexsort((runs["session"], runs["key"]))]
    keys, frames, sessions = runs["key"], runs["frame"], runs["session"].astype(np.int64)
    for apart in range(1, COMPARED + 1):
        one = np.flatnonzero(keys[:-apart] == keys[apart:])
        if not one.size:
            return
        one = one[crossing(masks, sessions[one], sessions[one + apart])]
        other = one + apart
        yield np.stack(
            [sessions[one], sessions[other], frames[other] - frames[one], np.ones_like(one)], axis=1
        )


def _summed(matches: Indices) -> Indices:
    """Return rows (n, 4) of different sessions and lags, with the sums of the last column."""
    rows, which = np.unique(matches[:, :3], axis=0, return_inverse=True)
    sums = np.bincount(which.ravel(), weights=matches[:, 3], minlength=len(rows)).astype(np.int64)
    return np.column_stack([rows, sums])


def _copies(matches: Indices, counts: Indices) -> Iterator[Duplicate]:
    """Yield the pairs of sessions that share enough runs; `counts` is the number of runs of each session."""
    starts = np.flatnonzero(np.any(np.diff(matches[:, :2], axis=0, prepend=-1) != 0, axis=1))
    for rows in np.split(matches, starts[1:]) if len(starts) else ():
        first, second = rows[0, :2].tolist()
        shared, count = int(rows[:, 3].sum()), int(min(counts[first], counts[second]))
        if shared >= max(MIN_RUNS, MIN_SHARE * count):
            lag = int(rows[rows[:, 3].argmax(), 2])
            yield Duplicate(first=first, second=second, lag=lag, share=shared / count)


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
