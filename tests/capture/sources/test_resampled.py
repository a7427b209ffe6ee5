"""A stream at another rate: the same sound at the same times, whatever the blocks."""

from collections.abc import Iterator, Sequence

import numpy as np
import pytest

from monochord.capture.sources._resampled import at_rate
from monochord.capture.sources.base import Stream
from monochord.core.types import Audio, Block, Signal, StreamHealth, Truth
from monochord.core.windows import windows
from monochord.dsp.resample import Conversion, resampled

NEW = 44100
RATES = (48000, 88200, 96000, 192000)
BEGUN = 1000.0


def tones(rate: int, seconds: float) -> Audio:
    """A chord at one microphone, a tone of 18 kHz at the other."""
    time = np.arange(round(rate * seconds)) / rate
    chord = sum(0.2 * np.sin(2.0 * np.pi * f * time + f) for f in (50.0, 1009.0, 7013.0))
    return np.stack((chord, 0.5 * np.sin(2.0 * np.pi * 18000.0 * time))).astype(np.float32)


def cut(samples: Audio, rate: int, sizes: Sequence[int], gaps: Sequence[tuple[int, int]] = ()) -> list[Block]:
    """Blocks of these sizes in turn, without the frames of the gaps."""
    blocks, start, end, k = list[Block](), 0, 0, 0
    while start < samples.shape[1]:
        inside = [stop for first, stop in gaps if first <= start < stop]
        if inside:
            start = inside[0]
            continue
        stop = min(start + sizes[k % len(sizes)], samples.shape[1], *[g for g, _ in gaps if g > start])
        part, time = samples[:, start:stop], BEGUN + start / rate
        blocks.append(Block(samples=part, start=start, dropped=start - end, adc_time=time))
        start, end, k = stop, stop, k + 1
    return blocks


def joined(blocks: Iterator[Block]) -> Audio:
    """The frames of a stream, NaN where they are lost; every block continues the one before."""
    parts, end = list[Audio](), 0
    for block in blocks:
        assert block.start == end + block.dropped
        if block.adc_time is not None:
            assert block.adc_time == pytest.approx(BEGUN + block.start / NEW, abs=1e-9)
        parts += [np.full((block.samples.shape[0], block.dropped), np.nan, np.float32), block.samples]
        end = block.start + block.samples.shape[1]
    return np.concatenate(parts, axis=1)


@pytest.mark.parametrize("rate", [*RATES, 32000])
def test_each_frame_is_the_sound_at_its_time(rate: int) -> None:
    sound = tones(rate, 0.3)[: 1 if rate < NEW else 2]
    found = joined(resampled(cut(sound, rate, [256]), sample_rate=rate, new_rate=NEW))
    assert found.shape[1] == round(0.3 * NEW)
    error = found - tones(NEW, 0.3)[: len(sound)]
    assert np.abs(error[:, 150:-150]).max() < 2e-5


def test_what_the_new_rate_cannot_hold_is_gone() -> None:
    time = np.arange(9600) / 96000
    for pitch in (24500.0, 30000.0, 47000.0):
        tone = np.sin(2.0 * np.pi * pitch * time).astype(np.float32)[None]
        found = joined(resampled([Block(samples=tone, start=0)], sample_rate=96000, new_rate=NEW))
        assert np.abs(found[:, 150:-150]).max() < 3e-5


def test_blocks_of_any_size_give_the_same_bits_and_gaps_stay_where_they_were() -> None:
    sound = np.random.default_rng(3).standard_normal((2, 24000)).astype(np.float32)
    gaps = [(3000, 3002), (8000, 16800)]
    whole, parts = (
        joined(resampled(cut(sound, 48000, sizes, gaps), sample_rate=48000, new_rate=NEW))
        for sizes in ([24000], [1, 7, 256, 64, 3000])
    )
    np.testing.assert_array_equal(parts, whole)
    lost = np.isnan(whole).all(axis=0)
    assert np.array_equal(lost, np.isnan(whole).any(axis=0))
    at = np.arange(lost.size) * 48000 / NEW
    expected = np.zeros(lost.size, np.bool_)
    for first, stop in gaps:
        expected |= (at >= first) & (at < stop)
    np.testing.assert_array_equal(lost, expected)


def test_a_frame_comes_as_soon_as_its_last_input() -> None:
    conversion = Conversion.between(48000, NEW)
    assert conversion.delay < 1e-3
    arrived = given = 0

    def arriving() -> Iterator[Block]:
        nonlocal arrived
        for block in cut(tones(48000, 0.2), 48000, [64]):
            assert arrived / 48000 - given / NEW < conversion.delay + 1 / NEW
            arrived = block.start + block.samples.shape[1]
            yield block

    for block in resampled(arriving(), sample_rate=48000, new_rate=NEW):
        given = block.start + block.samples.shape[1]
    assert given == round(0.2 * NEW)


class Played(Stream):
    """A stream of blocks, of which half of the frames are still to come."""

    def __init__(self, blocks: list[Block], rate: int) -> None:
        self._blocks, self._rate = blocks, rate

    @property
    def signal(self) -> Signal:
        return Signal(sample_rate=self._rate, channels=2)

    def __iter__(self) -> Iterator[Block]:
        return iter(self._blocks)

    def in_time(self) -> Iterator[Block]:
        absent = Block(samples=np.zeros((2, 0), np.float32), start=96000, dropped=48000)
        return iter([*self._blocks, absent])

    @property
    def pending(self) -> int:
        return 4800

    @property
    def health(self) -> StreamHealth:
        return StreamHealth(frames=48000, dropped=3)

    def truth(self, start: int, stop: int) -> Truth:
        return {"position": start / self._rate, "force": stop / self._rate}


def test_a_stream_at_another_rate_is_on_its_clock() -> None:
    own = Played(cut(tones(48000, 1.0), 48000, [480]), 48000)
    stream = at_rate(own, NEW)
    assert (stream.signal, stream.pending) == (Signal(sample_rate=NEW, channels=2), 4410)
    assert stream.health == own.health
    assert stream.truth(441 * 7, 441 * 17) == {"position": 0.07, "force": 0.17}
    assert 0.0 < stream.delay < 1e-3 > own.delay == 0.0
    cuts = list(windows(stream, size=4410, hop=441, sample_rate=NEW))
    assert [window.start for window in cuts] == [441 * k for k in range(91)]
    # An absent device's lost frames pass as windows with a gap, one a hop.
    late = list(windows(at_rate(own, NEW).in_time(), size=4410, hop=441, sample_rate=NEW))
    assert [window.has_gap for window in late[:-1]] == [k > 90 for k in range(len(late) - 1)]
    assert len(late) >= 190


def test_a_stream_at_its_reader_s_rate_or_below_is_left_alone() -> None:
    own = Played([], 48000)
    assert at_rate(own, 48000) is at_rate(own, None) is at_rate(own, 96000) is own
