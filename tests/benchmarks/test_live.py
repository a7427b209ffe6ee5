"""The benchmark of the live loop, kept short, and what it measures with."""

import mmap
import os
import threading
from pathlib import Path

import numpy as np
import pytest
import soundfile

from monochord.benchmarks._process import one_core, resident
from monochord.benchmarks._take import write_take
from monochord.benchmarks.live import Live
from monochord.core.errors import InputError
from monochord.physics.strings import load_string


@pytest.fixture(scope="module")
def rows() -> dict[str, tuple[float, float | None]]:
    return {row.name: (row.value, row.ratio) for row in Live(seconds=1.2, minutes=0.5).run()}


def test_latency_is_compared_with_the_autocorrelation(rows: dict[str, tuple[float, float | None]]) -> None:
    p50, p95, p99, longest = (rows[f"latency {name}"][0] for name in ("p50", "p95", "p99", "max"))
    assert 0.0 < p50 <= p95 <= p99 <= longest
    assert rows["latency p50"][1] is not None
    assert p50 < 3.0


def test_the_take_is_one_that_the_estimator_answers(rows: dict[str, tuple[float, float | None]]) -> None:
    assert rows["windows with a position"][0] > 0.9
    # A busy machine skips some, and counts them.
    assert rows["windows"][0] + rows["windows skipped"][0] > 100
    assert rows["windows"][0] > 75


def test_memory_is_flat(rows: dict[str, tuple[float, float | None]]) -> None:
    assert rows["resident at the end"][0] > 10.0
    assert abs(rows["memory growth"][0]) < 5.0
    assert rows["pace of the memory run"][0] == pytest.approx(20.0, rel=0.25)


def test_memory_can_be_left_out() -> None:
    rows = {row.name: row for row in Live(seconds=0.2, minutes=0.0).run()}
    assert not [name for name in rows if "memory" in name]
    assert 0.0 < rows["filter p50"].value <= rows["filter p99"].value
    assert rows["filter p50"].ratio is not None


def test_one_core_holds_every_thread_and_lets_go() -> None:
    before = os.sched_getaffinity(0)
    stop = threading.Event()
    thread = threading.Thread(target=stop.wait)
    thread.start()
    assert thread.native_id is not None
    try:
        with one_core():
            assert len(os.sched_getaffinity(0)) == 1
            assert len(os.sched_getaffinity(thread.native_id)) == 1
        assert os.sched_getaffinity(0) == os.sched_getaffinity(thread.native_id) == before
    finally:
        stop.set()
        thread.join()


def test_resident_memory_sees_what_is_taken() -> None:
    before = resident()
    with mmap.mmap(-1, 64_000_000) as taken:  # an array might be given pages that others have left
        taken.write(b"x" * len(taken))
        after = resident()
    assert after - before == pytest.approx(64.0, abs=8.0)


def test_the_take_has_the_pitch_of_its_far_segment(tmp_path: Path) -> None:
    preset = load_string("plain_012")
    write_take(tmp_path / "take.wav", preset, 1.0, 44100)
    samples, rate = soundfile.read(tmp_path / "take.wav")
    assert (rate, samples.size) == (44100, 44100)
    peak = float(np.argmax(np.abs(np.fft.rfft(samples * np.hanning(samples.size)))))
    assert peak == pytest.approx(preset.open_frequency / 0.6, abs=1.0)


def test_an_unknown_string_is_refused() -> None:
    with pytest.raises(InputError, match="plain_12"):
        list(Live(string="plain_12").run())
