import json
import signal
import subprocess
import sys
from typing import Any

import pytest

from monochord.cli import run
from monochord.cli.demo import HEARD_DAYS
from monochord.lab.plans import load_plan


@pytest.fixture(scope="module")
def result() -> dict[str, Any]:
    """Return what some seconds of the demonstration ended with."""
    from contextlib import redirect_stdout
    from io import StringIO

    out = StringIO()
    with redirect_stdout(out):
        assert run(["demo", "--seconds", "6", "--seed", "1", "--json"]) == 0  # none of it rolls
    return json.loads(out.getvalue())


def test_the_touch_is_told(result: dict[str, Any]) -> None:
    assert result["simulated"] is True
    assert result["estimator"] == "model"
    assert result["contact_accuracy"] > 0.98
    assert result["position_windows"] > 100
    assert result["position_mae"] < 1.5e-3
    assert result["force_mae"] < 0.2
    assert result["slip_accuracy"] > 0.7


def test_it_is_shown_what_it_was_not_trained_on(result: dict[str, Any]) -> None:
    assert (result["sensor"], result["build"], result["day"]) == ("prototype", 1, 10)
    assert result["materials"] == ["plastic"]
    plan = load_plan("paper")
    assert plan.build == result["build"]
    learned = [group for group in plan.groups if group.name.split("_")[0] in ("static", "slip", "transition")]
    assert {day for group in learned for day in group.days} == {*HEARD_DAYS}
    assert {group.material for group in learned} == {*result["materials"]}
    assert result["day"] not in {day for group in plan.groups for day in group.days}


def test_it_keeps_the_pace_of_real_time(result: dict[str, Any]) -> None:
    total = result["windows"] + result["skipped"]
    assert total == pytest.approx(591, abs=2)
    assert result["skipped"] < 0.2 * total


def test_the_view_ends_with_the_error_against_truth(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["demo", "--seconds", "2"]) == 0
    out = capsys.readouterr().out
    for words in (
        "position mean error",
        "force    mean error",
        "contact  ",
        "truth",
        "latency",
        "All of this is simulated, sound and training alike",
        "It learned from this sensor on days 1 to 7, never on day 10.",
        "takes most of them for sliding",
    ):
        assert words in out


def test_by_physics_alone(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["demo", "--seconds", "3", "--estimator", "closed-form"]) == 0
    out = capsys.readouterr().out
    assert "position error against truth: median 0." in out
    assert "All of this is simulated sound." in out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--build", "3"], "It learned from another sensor than this one"),
        (["--day", "2"], "It learned from this very sensor on this very day, 2"),
        (["--material", "wood", "--material", "plastic"], "it never met wood."),
    ],
)
def test_it_says_what_is_strange_to_it(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["demo", "--seconds", "0.5", *arguments]) == 0
    assert words in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--estimator", "modle"], "did you mean 'model'"),
        (["--material", "wod"], "did you mean 'wood'"),
        (["long"], "a string of 0.65 m for a model: allowed is 0.2 m"),
    ],
)
def test_what_it_cannot_show_is_one_line(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["demo", "--seconds", "1", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert words in captured.err


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
    assert "All of this is simulated, sound" in rest
