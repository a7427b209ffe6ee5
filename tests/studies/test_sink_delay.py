"""The benchmark of the sinks."""

import shutil

import pytest
from studies.sink_delay import Sinks

from monochord.core.errors import InputError


@pytest.mark.slow
@pytest.mark.real_time
@pytest.mark.skipif(not shutil.which("jackd"), reason="jackd is not installed (Debian: apt install jackd2)")
def test_every_window_is_accounted_for_and_heard_by_another_process() -> None:
    benchmark = Sinks(seconds=5.0)
    rows = {row.name: row for row in benchmark.run()}
    estimated, skipped = rows["windows estimated"].value, rows["windows skipped"].value
    assert estimated + skipped == benchmark.due
    assert estimated > 0.5 * benchmark.due
    assert rows["wrenches received"].value > 0.5 * estimated
    assert rows["loop p99"].baseline_value
    for sink in ("csv", "jsonl", "mcap", "ros2", "terminal", "udp", "web"):
        assert rows[f"left out by {sink}"].value <= 0.05 * estimated


def test_windows_that_end_within_the_run_are_due() -> None:
    assert Sinks(seconds=5.0).due == 491  # the first ends after 0.1 s
    assert Sinks(seconds=5.0, hop=0.05).due == 99


def test_too_short_a_run_is_refused() -> None:
    with pytest.raises(InputError, match="seconds"):
        Sinks(seconds=1.0)
