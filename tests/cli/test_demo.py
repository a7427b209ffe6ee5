import json
import signal
import subprocess
import sys

import pytest

from monochord.cli import run


@pytest.fixture(scope="module")
def result() -> dict[str, float]:
    """Return what some seconds of the demonstration ended with."""
    from contextlib import redirect_stdout
    from io import StringIO

    out = StringIO()
    with redirect_stdout(out):
        assert run(["demo", "--seconds", "6", "--json"]) == 0
    return json.loads(out.getvalue())


def test_the_touch_is_found(result: dict[str, float]) -> None:
    assert result["answered"] > 60
    assert result["median_error"] < 2e-3
    assert result["abstained"] < result["answered"]


def test_it_keeps_the_pace_of_real_time(result: dict[str, float]) -> None:
    total = result["windows"] + result["skipped"]
    assert total == pytest.approx(591, abs=2)
    assert result["skipped"] < 0.2 * total


def test_the_view_ends_with_the_error_against_truth(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["demo", "--seconds", "2"]) == 0
    out = capsys.readouterr().out
    assert "position error" in out
    assert "simulated" in out
    assert "truth" in out
    assert "latency" in out


def test_no_time_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["demo", "--seconds", "0"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_told_to_terminate_it_ends_with_its_result() -> None:
    code = "from monochord.cli import main; main(['demo', '--seconds', '60'])"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout
        assert process.stderr
        process.stdout.readline()
        process.send_signal(signal.SIGTERM)
        rest, told = process.stdout.read(), process.stderr.read()
    assert process.returncode == 0, told
    assert told == ""
    assert "All of this is simulated sound." in rest
