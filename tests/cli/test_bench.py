import json
from collections.abc import Iterator

import pytest
from tests.cli.running import Capture

from monochord.benchmarks.base import Benchmark, Row
from monochord.cli import run
from monochord.cli.bench import _line
from monochord.core.errors import InputError

KEYS = {"benchmark", "name", "value", "unit", "baseline", "baseline_value", "ratio"}


class _Bench(Benchmark):
    def __init__(self, *, ready: bool) -> None:
        self.ready = ready

    def run(self) -> Iterator[Row]:
        if not self.ready:
            raise InputError("no real recordings", "a folder with manifest.csv", "name it")
        yield Row(name="a", value=1.0, unit="s", baseline="b", baseline_value=4.0)
        yield Row(name="c", value=2.0, unit="s")


class _Shelf:
    """Benchmarks of which each has what it needs or not."""

    def __init__(self, **ready: bool) -> None:
        self.ready = ready

    def names(self) -> list[str]:
        return list(self.ready)

    def build(self, name: str, options: object, *, where: str) -> Benchmark:
        del options, where
        return _Bench(ready=self.ready[name])


@pytest.mark.parametrize(("second", "status"), [(True, 0), (False, 2)])
def test_of_all_benchmarks_one_that_lacks_something_is_skipped(
    second: bool,  # noqa: FBT001
    status: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: Capture,
) -> None:
    monkeypatch.setattr("monochord.cli.bench.BENCHMARKS", _Shelf(first=False, second=second))
    assert run(["bench", "--json"]) == status
    captured = capsys.readouterr()
    assert "no real recordings" in captured.err
    rows = [json.loads(line) for line in captured.out.splitlines()]
    assert len(rows) == 2 * second
    assert all(set(row) == KEYS and row["benchmark"] == "second" for row in rows)
    assert [row["ratio"] for row in rows] == [0.25, None][: len(rows)]


def test_a_table_names_the_machine(monkeypatch: pytest.MonkeyPatch, capsys: Capture) -> None:
    monkeypatch.setattr("monochord.cli.bench.BENCHMARKS", _Shelf(only=True))
    assert run(["bench", "only"]) == 0
    machine, _, name, *rows = capsys.readouterr().out.splitlines()
    assert machine.startswith("machine: ")
    assert name == "only"
    assert "0.25" in rows[0]


@pytest.mark.parametrize(
    "row",
    [
        Row(name="a", value=1.5, unit="s", baseline="b", baseline_value=0.0),
        Row(name="a", value=float("nan"), unit="s"),
    ],
)
def test_a_row_of_no_ratio_is_printed(row: Row) -> None:
    assert f"{row.value:g} s" in _line(row)
