"""The benchmark of the recorder, kept short."""

import pytest

from monochord.benchmarks.recording import Recording
from monochord.core.errors import InputError


@pytest.fixture(scope="module")
def rows() -> dict[str, tuple[float, float | None]]:
    return {row.name: (row.value, row.ratio) for row in Recording(seconds=2.0, rate=2000.0).run()}


def test_the_recorder_takes_a_part_of_a_core(rows: dict[str, tuple[float, float | None]]) -> None:
    assert 0.0 < rows["audio alone"][0] < 100.0
    assert rows["audio and force"][1] is not None
    assert rows["the same"][1] == pytest.approx(rows["audio and force"][0] / 25.0)


def test_every_reading_is_recorded(rows: dict[str, tuple[float, float | None]]) -> None:
    assert 0.5 < (rows["readings a second"][1] or 0.0) < 1.1  # what sends them is late on a busy machine
    assert rows["readings missing"][0] == 0
    assert rows["frames dropped"][0] == 0


def test_memory_is_flat(rows: dict[str, tuple[float, float | None]]) -> None:
    assert abs(rows["memory growth"][0]) < 10.0


def test_too_short_a_run_is_refused() -> None:
    with pytest.raises(InputError, match="seconds"):
        Recording(seconds=0.1)
