"""The README followed from top to bottom, as a newcomer does: every command of it, in its order."""

import json
import os
import re
import resource
import subprocess
import sys
import time
from pathlib import Path

import pytest

README = Path(__file__).parents[2] / "README.md"
SETS_UP = ("make ", "sudo ", "pip ")
"""Commands that set the machine up: `make` has done so where this runs."""
CORES = 2
LEARNING_PATH = ("collect", "build", "train", "evaluate", "live")


def commands() -> list[str]:
    blocks = re.findall(r"^```sh\n(.*?)^```$", README.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    lines = [line for block in blocks for line in block.splitlines() if line.strip()]
    return [line for line in lines if not line.startswith(SETS_UP)]


def seconds_of_processor() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_every_command_works_and_the_learning_path_ends_well(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = os.environ | {"PATH": path}
    learning = 0.0
    for line in commands():
        began, used = time.monotonic(), seconds_of_processor()
        ran = subprocess.run(
            ["bash", "-c", line], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert ran.returncode == 0, f"{line}\n{ran.stderr}"
        used = seconds_of_processor() - used
        if line.split()[1] in LEARNING_PATH:
            learning += used
        with capsys.disabled():
            print(f"\n{time.monotonic() - began:6.1f} s  {used:6.1f} s of processor  {line}", end="")  # noqa: T201
    assert learning < CORES * 180.0
    scores = json.loads((tmp_path / "report" / "scores.json").read_text(encoding="utf-8"))
    (touched,) = (row for row in scores["table"] if row["state"] == "touched" and row["condition"] == "clean")
    assert touched["position"]["mae"]["value"] < 0.5e-3
    assert touched["force"]["mae"]["value"] < 0.2
    assert min(touched[name]["answered"] for name in ("position", "force")) > 0.98
