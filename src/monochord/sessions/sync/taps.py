"""Estimates the offsets between streams from taps that all of them detect.

An offset is positive where the stream is late: stream time minus offset is reference time.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError
from monochord.core.types import Audio, Flags, Floats
from monochord.core.units import Metres, Seconds
from monochord.sessions.sync.onsets import first_onset, loudness_of, novelty, surprise
from monochord.sessions.sync.pulses import Taps, dip, middle_of_dip

MIN_TAPS, TAPS = 3, 5
"""The least number of taps that count at an end of a recording, and the number that people are asked for."""
HOW_TO_TAP = f"tap the string {TAPS} times with the drivers off, at the beginning and at the end"
"""What every message and page asks for."""
REACH: Seconds = 1.0
FRAME: Seconds = 1e-3
"""Resolution of the search over a group of taps, in s."""
BEFORE, AFTER = 0.012, 0.0015
"""A tap's onset is searched within this distance of the group's estimate, in s."""
MAX_RIVAL = 0.8
"""A second peak of this relative height makes the offset ambiguous."""
AGREEMENT_STD: Seconds = 0.5e-3
"""Standard uncertainty below which three or more taps agree better than by chance, in s."""
RIVAL_STD_RATIO = 3.0
"""A competing offset this many times more uncertain is left out."""
FEW_TAPS_SCATTER: Seconds = 2e-3
"""Scatter assumed for fewer than three taps, where a wrong one cannot be detected."""
MIN_LOUDNESS, DEAF_LOUDNESS = 3.0, 1.5
"""Loudness ratio above which a tap picked up by one microphone counts, and below which the other is deaf.

Live microphones reach 1.6 and more in the twin's realistic world, dead ones 1.2 and less (median of three
taps).
"""
ONSET_STD: Seconds = 0.1e-3
"""Uncertainty of an onset's instant, in s: a contact takes that long to build up."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Offset:
    """A stream's delay against a reference, `value` in s with its standard uncertainty `std`.

    `each` (n,) holds the offsets of single taps, NaN for a missed tap or an outlier; `taps` counts the rest.
    `rival` is the relative height of the second best coarse match; near 1 the match is ambiguous. Without a
    usable tap, `value` is NaN and `std` infinite.
    """

    value: Seconds
    std: Seconds
    taps: int
    rival: float
    each: Floats

    @property
    def is_determined(self) -> bool:
        """Whether there is a value and no competing one of similar quality.

        >>> offset_of(np.array([0.01, 0.0102]), spacing=1e-3).is_determined
        True
        """
        return self.taps > 0 and self.rival < MAX_RIVAL


def offset_of(each: Floats, *, spacing: Seconds, rival: float = 0.0) -> Offset:
    """Return the mean of single taps' offsets (n,) in s with its standard uncertainty, outliers left out.

    u^2 = s^2 / n + d^2. Here s is the scatter over the n taps, at least `spacing` sqrt(1/12), the
    quantisation error of readings that far apart (and at least 2 ms for fewer than three taps); d is the
    build-up time of a contact. An outlier differs from the median by more than six times the median deviation
    and by more than `spacing`, in s: for two streams, the root of the sum of squares. A missed tap is NaN.

    >>> offset = offset_of(np.array([0.0101, 0.0099, 0.0100, 0.3]), spacing=1e-4)
    >>> round(offset.value, 6), offset.taps
    (0.01, 3)
    """
    used = np.array(each, dtype=np.float64)
    if not np.isfinite(used).any():
        return Offset(value=math.nan, std=math.inf, taps=0, rival=rival, each=used)
    off = np.abs(used - np.nanmedian(used))
    used[~(off <= max(6.0 * float(np.nanmedian(off)), spacing, 2.0 * ONSET_STD))] = np.nan
    good = used[np.isfinite(used)]
    n = good.size
    floor = spacing * math.sqrt(1.0 / 12.0)
    scatter = max(
        float(np.std(good, ddof=1)) if n > 1 else 0.0, floor, FEW_TAPS_SCATTER if n < MIN_TAPS else 0.0
    )
    # Few taps estimate their own scatter badly: the factor is that of Student's distribution.
    wide = math.sqrt((n - 1) / (n - 3)) if n > 3 else 1.7
    std = math.hypot(scatter * (wide if scatter > floor else 1.0) / math.sqrt(n), ONSET_STD)
    return Offset(value=float(good.mean()), std=std, taps=n, rival=rival, each=used)


def audio_offset(
    taps: Taps,
    samples: Audio,
    *,
    first: Seconds,
    rate: float,
    travel: Seconds | tuple[Seconds, ...] = 0.0,
    reach: Seconds = REACH,
) -> Offset:
    """Return the delay of the taps' sound against the taps' onsets.

    First, all taps together: the shift at which most taps coincide with new sound, to a millisecond; unequal
    times between taps make it unambiguous. Then each tap alone: the onset in each microphone's prediction
    error (see `monochord.sessions.sync.onsets`), minus the wave's travel time. One offset a tap: the mean
    over the microphones, or one microphone's value where they disagree.

    `samples` (channels, n) begin at `first` in s, by the audio's stamps, at the measured `rate` in Hz, best
    with `reach` to spare on both sides: the largest offset searched, either way, in s. `travel` in s is x / c
    and (L - x) / c; for unknown x, L / 2c for both keeps their mean correct.

    >>> rng = np.random.default_rng(0)
    >>> sound = 1e-3 * rng.standard_normal((2, 3 * 44100))
    >>> begin = np.array([0.7, 1.0, 1.7])
    >>> for place in np.rint((begin + 0.05) * 44100).astype(int):
    ...     sound[:, place : place + 200] += 0.1
    >>> taps = Taps(begin=begin, end=begin + 0.006, spacing=1 / 7000)
    >>> offset = audio_offset(taps, sound.astype(np.float32), first=0.0, rate=44100.0)
    >>> round(offset.value, 3), offset.taps
    (0.05, 3)
    """
    channels = samples.shape[0]
    travels = (float(travel),) * channels if isinstance(travel, int | float) else travel
    if samples.ndim != 2 or not channels or len(travels) != channels:
        raise InputError(
            f"samples {samples.shape} and {len(travels)} travel times", "one travel time for each channel"
        )
    size = max(round(FRAME * rate), 1)
    if not len(taps) or samples.shape[1] < 64 * size:
        return offset_of(np.full(len(taps), np.nan), spacing=taps.spacing)
    errors = surprise(samples)
    # What is broad shows among tones, what is loud among noises.
    news = novelty(errors, size) + novelty(samples, size)
    when = np.arange(news.size, dtype=np.float64) * (size / rate) + (first + 0.5 * size / rate)
    spacing = math.hypot(taps.spacing, 1.0 / rate)

    def onset_offsets(shift: Seconds) -> tuple[Floats, Floats]:
        """Return the offset (taps, channels) of each tap near a given shift, and the loudness."""
        each, loudness = np.full((2, len(taps), channels), np.nan)
        for k, begin in enumerate(taps.begin):
            start = round((begin + shift - BEFORE - first) * rate)
            stop = round((begin + shift + AFTER - first) * rate)
            if start >= 0 and stop <= samples.shape[1]:
                near = errors[:, start:stop]
                onsets = np.array([first_onset(near[c]) for c in range(channels)])
                each[k] = first + (start + onsets) / rate - begin - np.array(travels)
                loudness[k] = [loudness_of(near[c], onsets[c]) for c in range(channels)]
        return each, loudness

    shifts = shifts_of_group(taps.begin, when, news, reach)
    onsets = [(*onset_offsets(shift), share) for shift, share in shifts]
    return _best_agreeing(
        [
            offset_of(each[:, _picking_up(loudness)].mean(axis=1), spacing=spacing, rival=share)
            for each, loudness, share in onsets
        ]
    )


def height_offset(taps: Taps, time: Floats, height: Floats, *, reach: Seconds = REACH) -> Offset:
    """Return the delay of a tool's height against taps: the middle of each dip minus the contact's middle.

    `height` (n,) in m is read at rising `time` (n,) in s, best with `reach` to spare on both sides: the
    largest offset searched, either way, in s.

    >>> middle = np.array([1.003, 1.402, 2.001])
    >>> taps = Taps(begin=middle - 0.003, end=middle + 0.003, spacing=1 / 7000)
    >>> time = np.arange(0.0, 4.0, 0.004)
    >>> height = np.minimum(np.abs(time[:, None] - 0.1 - middle).min(axis=1) * 0.2, 3e-3)
    >>> offset = height_offset(taps, time, height)
    >>> abs(offset.value - 0.1) < 2e-3, offset.taps
    (True, 3)
    """
    if time.ndim != 1 or time.shape != height.shape:
        raise InputError(f"times {time.shape} and heights {height.shape}", "one value for each time")
    if not len(taps) or time.size < 8:
        return offset_of(np.full(len(taps), np.nan), spacing=taps.spacing)
    spacing = float(np.median(np.diff(time)))
    down = dip(time, height)
    depth = 1.0 / (1.0 + 1e-3 / np.maximum(down, 1e-9))  # a deep dip counts little more than one of some mm
    when = np.arange(time[0], time[-1], FRAME)
    (shift, _), (_, rival) = shifts_of_group(taps.middle, when, np.interp(when, time, depth), reach)[:2]
    near = taps.middle + shift
    each = np.array([middle_of_dip(time, down, float(t)) for t in near]) - taps.middle
    return offset_of(each, spacing=math.hypot(taps.spacing, spacing), rival=rival)


def travel_time(length: Metres, wave_speed: float, position: Metres | None = None) -> tuple[Seconds, Seconds]:
    """Return a wave's travel time from a touch to both ends of a string, in s: x / c and (L - x) / c.

    Without a position, both get the mean of the two.

    >>> travel_time(0.25, 512.0, 0.125)
    (0.000244140625, 0.000244140625)
    """
    if position is None:
        mean = 0.5 * length / wave_speed
        return mean, mean
    return position / wave_speed, (length - position) / wave_speed


def _picking_up(loudness: Floats) -> Flags:
    """Return which microphones (channels,) pick up the taps, from loudness (taps, channels).

    All microphones count, unless one stands out and the other is deaf: the deaf one's onsets are noise, which
    may agree by chance.
    """
    usual = np.median(np.nan_to_num(loudness), axis=0)
    deaf = usual < DEAF_LOUDNESS
    return ~deaf if (usual >= MIN_LOUDNESS).any() else np.ones(usual.size, bool)


def _best_agreeing(candidates: list[Offset]) -> Offset:
    """Return the candidate whose taps agree best, among those with a share (`rival`) near the best.

    Its `rival` becomes the largest share among the other candidates whose taps agree or that are clearly
    weaker. With fewer than three taps, agreement is undefined, and the largest share wins.
    """
    near = [offset for offset in candidates if offset.rival >= MAX_RIVAL]
    agreed = [o for o in near if _has_enough_taps(o)]
    chosen = min(agreed, key=lambda offset: offset.std) if agreed else candidates[0]
    sure = bool(agreed) and chosen.std < AGREEMENT_STD
    beaten = [o for o in near if sure and (o.taps < MIN_TAPS or o.std > RIVAL_STD_RATIO * chosen.std)]
    others = [o.rival for o in candidates if o is not chosen and not any(o is b for b in beaten)]
    return replace(chosen, rival=max(others, default=0.0) / chosen.rival)


def _has_enough_taps(offset: Offset) -> bool:
    return offset.taps >= max(MIN_TAPS, offset.each.size - offset.each.size // 5)


SAME_SHIFT: Seconds = 0.03
"""Shifts closer than this count as one, in s."""
CANDIDATES = 4


def shifts_of_group(
    taps: Floats, when: Floats, notice: Floats, reach: Seconds
) -> list[tuple[Seconds, float]]:
    """Return the shifts at which novelty summed over the taps peaks, with their share of the best.

    The best comes first; there is always a second. `when` (n,) is evenly spaced and `notice` (n,) is not
    negative.
    """
    step = float(when[1] - when[0])
    # A tap may fall between two frames: the greater counts.
    wide = np.maximum.reduce([notice, np.roll(notice, 1), np.roll(notice, -1)])
    shifts = np.arange(-round(reach / step), round(reach / step) + 1)
    at = np.rint((taps - when[0]) / step).astype(np.int64)
    place: NDArray[np.int64] = at[:, None] + shifts[None, :]
    inside = (place >= 0) & (place < notice.size)
    at_taps = np.where(inside, wide[np.clip(place, 0, notice.size - 1)], 0.0)
    total = at_taps.sum(axis=0)
    peak = float(total.max())
    if not peak > 0.0:
        return [(0.0, 1.0), (0.0, 1.0)]
    candidates: list[tuple[Seconds, float]] = []
    for _ in range(CANDIDATES):
        best = int(np.argmax(total))
        first = max(best - 8, 0)
        plateau = np.flatnonzero(total[first : best + 9] >= total[best] * (1.0 - 1e-9)) + first
        shift = float(shifts[plateau].mean()) * step
        candidates.append((shift, float(total[best]) / peak))
        total[np.abs(shifts * step - shift) <= SAME_SHIFT] = 0.0
    return candidates
