"""The benchmark of several strings, kept short."""

import pytest
from studies._strings import strings_cost
from studies.strings_speed import Strings


def test_windows_of_all_strings_are_timed_and_counted() -> None:
    seen = strings_cost(2, seconds=0.4, hop=0.05)
    assert seen.strings == 2
    assert 0.0 < seen.rate < 40.0
    assert 0.0 < seen.cost < 0.05
    assert 0.0 <= seen.skipped <= 1.0


@pytest.mark.slow
def test_processes_share_the_strings() -> None:
    seen = strings_cost(3, seconds=0.4, hop=0.05, processes=2)
    assert seen.strings == 3
    assert 0.0 < seen.rate < 40.0
    assert 0.0 < seen.cost < 0.05


def test_each_number_of_strings_is_compared_with_the_first() -> None:
    rows = list(Strings(strings=(1, 3), seconds=0.8, hop=0.05).run())
    costs = [row for row in rows if row.name.endswith("cost of an estimate")]
    assert [row.name for row in costs] == ["N = 1, cost of an estimate", "N = 3, cost of an estimate"]
    assert costs[0].ratio == 1.0
    assert {row.baseline for row in costs} == {"N = 1"}


def test_the_cores_needed_are_compared_with_the_processes() -> None:
    rows = {row.name: row for row in Strings(strings=(2,), seconds=0.8, hop=0.05).run()}
    cores, cost = rows["N = 2, cores needed"], rows["N = 2, cost of an estimate"]
    assert cores.value == pytest.approx(2 * 1e-3 * cost.value / 0.05)
    assert (cores.baseline, cores.baseline_value) == ("processes", 1.0)
