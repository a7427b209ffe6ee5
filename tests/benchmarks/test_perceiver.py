"""The benchmark of a window's cost."""

import pytest

from monochord.benchmarks import BENCHMARKS
from monochord.benchmarks.perceiver import drawn
from monochord.errors import InputError
from monochord.physics.sensors import load_sensor
from monochord.types import Signal


def test_a_perceiver_stands_beside_the_closed_form() -> None:
    rows = [*BENCHMARKS.build("perceiver", {"count": 60}).run()]
    assert [row.name for row in rows] == [f"perceiver, {what}" for what in ("median", "p99", "largest")]
    assert 0.0 < rows[0].value <= rows[1].value <= rows[2].value
    for row in rows:
        assert row.ratio is not None
        assert row.ratio < 20.0


def test_one_that_is_drawn_can_be_heard_with() -> None:
    signal = Signal(sample_rate=44100, channels=2, string=load_sensor("prototype").string)
    perceiver = drawn("fft_harmonic", "untouched", signal, 4410)
    assert perceiver.definition.title == "weights drawn at random"
    perceiver.open(signal)


def test_no_windows_are_refused() -> None:
    with pytest.raises(InputError, match="0 windows: allowed is 1 or more"):
        BENCHMARKS.build("perceiver", {"count": 0})
