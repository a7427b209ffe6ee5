import numpy as np
import pytest

from monochord.capture.recording.steadiness import Steadiness
from monochord.core.types import Block

RATE = 44100
FRAMES = 512


def follow(begin_of: "list[float]", *, dropped: "dict[int, int] | None" = None) -> float:
    """Return by how much a stream slipped whose k-th block says that frame 0 was at `begin_of[k]`."""
    steady, start = Steadiness(RATE), 0
    for k, begin in enumerate(begin_of):
        start += (dropped or {}).get(k, 0)
        steady.add(
            Block(samples=np.zeros((1, FRAMES), np.float32), start=start, adc_time=begin + start / RATE)
        )
        start += FRAMES
    return steady.slipped


def test_a_steady_stream_does_not_slip() -> None:
    assert follow([5.0] * 500) == 0.0


def test_jitter_of_single_blocks_is_no_slip() -> None:
    jitter = np.random.default_rng(0).exponential(2e-3, 2000)
    assert follow((5.0 + jitter).tolist()) == 0.0


def test_two_clocks_that_drift_are_no_slip() -> None:
    assert follow((5.0 + 300e-6 * np.arange(3000) * FRAMES / RATE).tolist()) == 0.0


def test_a_gap_that_was_counted_is_no_slip() -> None:
    assert follow([5.0] * 500, dropped={250: 44100}) == 0.0


@pytest.mark.parametrize("periods", [1, 20, -3])
def test_periods_that_were_not_counted_are(periods: int) -> None:
    lost = periods * FRAMES / RATE
    assert follow([5.0] * 250 + [5.0 + lost] * 250) == pytest.approx(lost, rel=1e-6)


def test_blocks_without_times_say_nothing() -> None:
    steady = Steadiness(RATE)
    for k in range(100):
        steady.add(Block(samples=np.zeros((1, FRAMES), np.float32), start=k * FRAMES))
    assert steady.slipped == 0.0
