import time
from itertools import count

import pytest
from hypothesis import given
from hypothesis import strategies as st

from monochord.core.clock import SampleClock, clock_offsets

rates = st.sampled_from([16000, 44100, 48000, 96000])
year = 365 * 86400


@given(rates, st.floats(-1e6, 1e6), st.integers(0, year * 44100))
def test_an_index_goes_to_a_time_and_comes_back(rate: int, origin: float, index: int) -> None:
    clock = SampleClock(sample_rate=rate, origin=origin)
    assert clock.index(clock.time(index)) == index


@given(rates, st.integers(0, year), st.integers(0, 10**6))
def test_time_does_not_drift(rate: int, seconds: int, index: int) -> None:
    clock = SampleClock(sample_rate=rate)
    assert clock.time(seconds * rate) == seconds
    assert clock.time(index) < clock.time(index + 1)


def test_the_offsets_lead_from_one_clock_to_another() -> None:
    offsets = clock_offsets()
    now = time.monotonic()
    assert now + offsets["realtime"] == pytest.approx(time.time(), abs=0.05)
    raw = time.clock_gettime(time.CLOCK_MONOTONIC_RAW)
    assert now + offsets["monotonic_raw"] == pytest.approx(raw, abs=0.05)


def test_a_wait_between_two_clocks_does_not_count(monkeypatch: pytest.MonkeyPatch) -> None:
    usual, real, calls = clock_offsets()["realtime"], time.clock_gettime_ns, count()

    def delayed(clock: int) -> int:
        if next(calls) % 3 != 1:
            time.sleep(0.02)
        return real(clock)

    monkeypatch.setattr(time, "clock_gettime_ns", delayed)
    assert clock_offsets()["realtime"] == pytest.approx(usual, abs=2e-3)
