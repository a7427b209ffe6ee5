import json
from collections.abc import Iterator

import pytest

from monochord.benchmarks.base import Benchmark, Row
from monochord.cli import run
from monochord.cli.bench import _line
from monochord.core.errors import InputError

SHORT = ["--set", "seconds=1", "--set", "minutes=0.05"]
KEYS = {"benchmark", "name", "value", "unit", "baseline", "baseline_value", "ratio"}


def test_one_object_a_row(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["bench", "live", "--json", *SHORT]) == 0
    captured = capsys.readouterr()
    rows = [json.loads(line) for line in captured.out.splitlines()]
    assert all(set(row) == KEYS for row in rows)
    assert {row["benchmark"] for row in rows} == {"live"}
    assert "machine: " in captured.err
    for row in rows:
        assert (row["baseline"] is None) == (row["baseline_value"] is None)
        if row["ratio"] is not None:
            assert row["ratio"] == pytest.approx(row["value"] / row["baseline_value"])


def test_a_table_names_the_machine(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["bench", "live", *SHORT]) == 0
    first, _, name, *rows = capsys.readouterr().out.splitlines()
    assert first.startswith("machine: ")
    assert name == "live"
    assert any("latency p99" in row and "autocorrelation" in row for row in rows)


@pytest.mark.parametrize(
    ("row", "text"),
    [
        (Row(name="windows", value=300, unit="1"), ["windows", " 300"]),
        (Row(name="a", value=2.0, unit="ms", baseline="b", baseline_value=4.0), [" 2 ms", "0.5 times b (4)"]),
        (Row(name="a", value=1.23456, unit="ms"), ["1.235 ms"]),
        (Row(name="a", value=1.5, unit="s", baseline="b", baseline_value=0.0), ["1.5 s", "b (0)"]),
        (Row(name="a", value=float("nan"), unit="s"), ["nan s"]),
    ],
)
def test_rows_as_a_person_reads_them(row: Row, text: list[str]) -> None:
    line = _line(row)
    for part in text:
        assert part in line


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["lve"], "did you mean 'live'"),
        (["live", "--set", "second=1"], "did you mean 'seconds'"),
        (["--set", "seconds=1"], "one NAME with --set"),
        (["live", "--set", "string=apendix", *SHORT], "did you mean 'appendix'"),
        (["live", "--set", "seconds=0"], "0.2 s or more"),
        (["fdtd", "--set", "sec=1"], "option 'fdtd.sec'"),
        (["fdtd", "--set", "seconds=0"], "0.001 to 3600 s"),
        (["bound", "--set", "windows=0"], "1 or more"),
        (["realstrings", "--set", "window=0"], "window 0 s: allowed is"),
        (["realstrings", "--set", "hop=0"], "hop 0 s: allowed is"),
        (["realstrings", "--set", "first=5"], "from 5 s to 1.05 s: allowed is"),
        (["realstrings", "--set", "last=0.1"], "to 0.1 s: allowed is"),
    ],
)
def test_what_is_wrong_is_said(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["bench", "--json", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert message in captured.err.splitlines()[-1]


@pytest.mark.parametrize("arguments", [["lve"], ["fdtd", "--set", "sec=1"], ["fdtd", "--set", "seconds=0"]])
def test_what_is_refused_is_refused_before_anything_is_measured(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["bench", "--json", *arguments]) == 2
    assert capsys.readouterr().err.count("\n") == 1


class _Shelf:
    """Benchmarks of which one has what it needs and one has not."""

    def __init__(self, **ready: bool) -> None:
        self.ready = ready

    def names(self) -> list[str]:
        return list(self.ready)

    def build(self, name: str, options: object) -> Benchmark:
        del options
        return _Bench(ready=self.ready[name])


class _Bench(Benchmark):
    def __init__(self, *, ready: bool) -> None:
        self.ready = ready

    def run(self) -> Iterator[Row]:
        if not self.ready:
            raise InputError("no real recordings", "a folder with manifest.csv", "name it")
        yield Row(name="a", value=1.0, unit="s")


@pytest.mark.parametrize(("second", "status"), [(True, 0), (False, 2)])
def test_of_all_benchmarks_one_that_lacks_something_is_skipped(
    second: bool,  # noqa: FBT001
    status: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("monochord.cli.bench.BENCHMARKS", _Shelf(first=False, second=second))
    assert run(["bench", "--json"]) == status
    captured = capsys.readouterr()
    assert "first  skipped: no real recordings" in captured.err
    assert len(captured.out.splitlines()) == int(second)
