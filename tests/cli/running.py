"""Commands run in this process: what they print, and that what they refuse is refused in one line."""

import json
from typing import Any

import pytest

from monochord.cli import run

Capture = pytest.CaptureFixture[str]


def refusal(capture: Capture, *words: object) -> str:
    """Return the line of a command that is refused: status 2, nothing printed but that line."""
    capture.readouterr()
    assert run([str(word) for word in words]) == 2
    out, error = capture.readouterr()
    assert out == ""
    assert "Traceback" not in error
    (line,) = [line for line in error.splitlines() if line.startswith("monochord: ")]
    return line  # beside it, a first use may say that it compiles


def records(capture: Capture, *words: object) -> list[dict[str, Any]]:
    """Return the lines of a command that prints JSON."""
    capture.readouterr()
    assert run([*map(str, words), "--json"]) == 0
    return [json.loads(line) for line in capture.readouterr().out.splitlines()]


def record(capture: Capture, *words: object) -> dict[str, Any]:
    """Return the only line of such a command."""
    (line,) = records(capture, *words)
    return line
