"""The benchmark of a window's cost."""

import pytest
from studies.model_speed import HOP, ModelSpeed, drawn

from monochord.core.errors import InputError
from monochord.core.types import Signal
from monochord.physics.sensors import load_sensor


def test_a_model_stands_beside_the_closed_form() -> None:
    rows = [*ModelSpeed(count=60).run()]
    whats = ("median", "p99", "largest")
    kinds = ("", " of processor time")
    assert [row.name for row in rows] == [f"model, {what}{kind}" for kind in kinds for what in whats]
    for first in (0, 3):
        assert 0.0 < rows[first].value <= rows[first + 1].value <= rows[first + 2].value
    for row in rows:
        assert row.ratio is not None
        if row.name == "model, median" or row.name.endswith("of processor time"):
            assert row.ratio < 20.0  # what else the machine does lengthens single windows by the clock


def test_the_bundled_model_takes_much_less_than_a_hop() -> None:
    rows = {row.name: row for row in ModelSpeed(path="demo", count=60).run()}
    median = rows["model, median of processor time"]
    assert median.value < 0.5 * HOP  # 1 ms, but machines that others share are slower at times
    assert median.ratio is not None
    assert median.ratio < 3.0


def test_a_random_model_can_be_run() -> None:
    signal = Signal(sample_rate=44100, channels=2, string=load_sensor("prototype").string)
    model = drawn("fft_harmonic", signal, 4410)
    model.check(signal)


def test_no_windows_are_refused() -> None:
    with pytest.raises(InputError, match="count' = 0"):
        ModelSpeed(count=0)
