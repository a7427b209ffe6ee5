"""The README and the tutorial followed from top to bottom, as a newcomer does: every step, in its order."""

import json
import os
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README, TUTORIAL = ROOT / "README.md", ROOT / "docs" / "tutorial" / "first-sound.md"
SETS_UP = ("make ", "sudo ", "pip ")
"""Commands that set the machine up: `make` has done so where this runs."""
CORES = 2
LEARNING_PATH = ("collect", "build", "train", "evaluate", "live")


def steps(page: Path) -> list[list[str]]:
    """The commands and programs of a page, in order; `make` has set the machine up where this runs."""
    blocks = re.findall(
        r"^```(sh|python)\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    found: list[list[str]] = []
    for kind, text in blocks:
        if kind == "python":
            found.append([sys.executable, "-c", text])
        else:
            found += [
                ["bash", "-c", line] for line in text.splitlines() if line and not line.startswith(SETS_UP)
            ]
    return found


def seconds_of_processor() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def follow(page: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, float]:
    """Take the steps of a page in a folder, and return the seconds of processor that each command took."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    costs: dict[str, float] = {}
    for step in steps(page):
        began, used = time.monotonic(), seconds_of_processor()
        ran = subprocess.run(
            step, cwd=folder, env=os.environ | {"PATH": path}, capture_output=True, text=True, check=False
        )
        assert ran.returncode == 0, f"{step[-1]}\n{ran.stderr}"
        assert "nan" not in ran.stdout, step[-1]
        used = costs[step[-1]] = seconds_of_processor() - used
        with capsys.disabled():
            line = step[-1].partition("\n")[0]
            print(f"\n{time.monotonic() - began:6.1f} s  {used:6.1f} s of processor  {line}", end="")  # noqa: T201
    return costs


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_every_step_works_and_the_learning_path_ends_well(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    costs = follow(README, tmp_path, capsys)
    learning = [cost for line, cost in costs.items() if line.split()[1] in LEARNING_PATH]
    assert len(learning) == len(LEARNING_PATH)
    assert sum(learning) < CORES * 180.0
    scores = json.loads((tmp_path / "report" / "scores.json").read_text(encoding="utf-8"))
    (touched,) = (row for row in scores["table"] if row["state"] == "touched" and row["condition"] == "clean")
    assert touched["position"]["mae"]["value"] < 0.5e-3
    assert touched["force"]["mae"]["value"] < 0.2
    assert min(touched[name]["answered"] for name in ("position", "force")) > 0.98


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_every_step_of_the_tutorial_works(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    follow(TUTORIAL, tmp_path, capsys)
