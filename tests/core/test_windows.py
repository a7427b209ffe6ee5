"""Windows equal slices of the whole signal, whatever the blocks and the gaps."""

import itertools
import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monochord.core.errors import InputError
from monochord.core.types import Audio, Block
from monochord.core.windows import windows

Sizes = list[tuple[int, int]]


def stream(sizes: Sizes, channels: int) -> tuple[list[Block], Audio, np.ndarray]:
    """Return blocks of (dropped, length), the whole signal with zeros for lost frames, and what was lost."""
    total = sum(dropped + length for dropped, length in sizes)
    whole = np.arange(1, channels * total + 1, dtype=np.float32).reshape(channels, total)
    lost = np.zeros(total, bool)
    blocks: list[Block] = []
    index = 0
    for dropped, length in sizes:
        lost[index : index + dropped] = True
        index += dropped
        blocks.append(Block(samples=whole[:, index : index + length].copy(), start=index, dropped=dropped))
        index += length
    whole[:, lost] = 0.0
    return blocks, whole, lost


gaps = st.one_of(st.just(0), st.integers(0, 60))
block_sizes: st.SearchStrategy[Sizes] = st.lists(st.tuples(gaps, st.integers(0, 40)), max_size=30)


@given(block_sizes, st.integers(1, 25), st.integers(1, 40), st.integers(1, 2))
def test_windows_are_slices_of_the_whole(sizes: Sizes, size: int, hop: int, channels: int) -> None:
    blocks, whole, lost = stream(sizes, channels)
    seen = list(windows(blocks, size=size, hop=hop, sample_rate=1000))
    starts = list(range(0, max(whole.shape[1] - size + 1, 0), hop))
    assert [w.start for w in seen] == starts
    for window in seen:
        span = slice(window.start, window.start + size)
        np.testing.assert_array_equal(window.samples, whole[:, span])
        assert window.has_gap == lost[span].any()
        assert window.sample_rate == 1000


@given(st.lists(st.integers(1, 50), min_size=1, max_size=20), st.integers(1, 20), st.integers(1, 20))
def test_a_window_comes_with_the_block_that_completes_it(lengths: list[int], size: int, hop: int) -> None:
    blocks, _, _ = stream([(0, length) for length in lengths], 1)
    given_so_far = 0

    def counted() -> Iterator[Block]:
        nonlocal given_so_far
        for block in blocks:
            given_so_far = block.start + block.samples.shape[1]
            yield block

    last_block = {end: end - n for n, end in zip(lengths, itertools.accumulate(lengths), strict=True)}
    for window in windows(counted(), size=size, hop=hop, sample_rate=1000):
        assert last_block[given_so_far] < window.start + size <= given_so_far


@pytest.mark.parametrize("channels", [1, 2])
def test_samples_own_their_memory(channels: int) -> None:
    blocks, whole, _ = stream([(0, 100)], channels)
    seen = list(windows(blocks, size=10, hop=5, sample_rate=1000))
    seen[0].samples[:] = -1.0
    np.testing.assert_array_equal(seen[1].samples, whole[:, 5:15])


def test_a_gap_of_an_hour_is_not_allocated() -> None:
    samples = np.ones((2, 441), np.float32)
    hour = 3600 * 44100
    blocks = [Block(samples=samples, start=0), Block(samples=samples, start=441 + hour, dropped=hour)]
    tracemalloc.start()
    seen = sum(w.has_gap for w in windows(blocks, size=4410, hop=44100, sample_rate=44100))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert seen == 3600
    assert peak < 2_000_000


def test_memory_does_not_grow_with_the_stream() -> None:
    def blocks() -> Iterator[Block]:
        for k in range(5_000):
            yield Block(samples=np.ones((2, 64), np.float32), start=64 * k)

    taken = windows(blocks(), size=441, hop=441, sample_rate=44100)
    next(taken)
    tracemalloc.start()
    for _ in taken:
        pass
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100_000


def test_an_index_that_goes_back_is_refused() -> None:
    samples = np.ones((1, 10), np.float32)
    blocks = [Block(samples=samples, start=0), Block(samples=samples, start=5)]
    with pytest.raises(InputError, match=r"5\b.*\b10"):
        list(windows(blocks, size=4, hop=4, sample_rate=1000))


@pytest.mark.parametrize(("size", "hop"), [(0, 1), (1, 0), (-5, 3)])
def test_sizes_below_one_are_refused(size: int, hop: int) -> None:
    with pytest.raises(InputError, match="expected a whole number of 1 or more"):
        list(windows([], size=size, hop=hop, sample_rate=44100))


@pytest.mark.parametrize("channels", [(1, 2), (2, 1)])
def test_blocks_of_other_channels_are_refused(channels: tuple[int, int]) -> None:
    blocks = [Block(samples=np.ones((count, 8), np.float32), start=8 * n) for n, count in enumerate(channels)]
    with pytest.raises(InputError, match=f"{channels[1]} channels after one of {channels[0]}"):
        list(windows(blocks, size=4, hop=4, sample_rate=44100))
