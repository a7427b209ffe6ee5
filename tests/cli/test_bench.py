import json

import pytest

from monochord.benchmarks.base import Row
from monochord.cli import run
from monochord.cli.bench import _line

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
    ],
)
def test_what_is_wrong_is_said(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["bench", "--json", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert message in captured.err.splitlines()[-1]
