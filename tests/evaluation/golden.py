"""What `evaluate` says of six sessions, kept beside the code: a line for each part of the scores.

``python -m tests.evaluation.golden`` writes it anew: after a change that must not touch a number,
``git diff`` shows whether one has moved, to the last bit.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tests.processor import COMPILED_FOR

import monochord as mc

FILE, PLAN = Path(__file__).with_name("golden.json"), Path(__file__).with_name("golden.toml")
LEFT_OUT = ("by", "maps")
"""Parts that show the same errors again, by day and by place."""


def scores(folder: Path) -> dict[str, Any]:
    """Collect the plan's sessions into a folder and return each candidate's scores of all six, by part.

    A process of its own collects: the last bits of the twin depend on what the compiler has seen before it.
    """
    command = [sys.executable, "-m", "monochord", "collect", str(PLAN), "--out", str(folder)]
    command += ["--workers", "1"]  # more would each begin anew
    subprocess.run(command, check=True, capture_output=True, env=os.environ | COMPILED_FOR)
    files = str(folder / "*.mcap")
    reports = {
        "demo": mc.evaluate("demo", sessions=files, tuned=True, baselines=False),
        "closed_form": mc.evaluate(estimator="closed_form", sessions=files, tuned=True, baselines=False),
    }
    return {
        f"{name} {part}": json.loads(json.dumps(values))
        for name, report in reports.items()
        for part, values in report.tree().items()
        if part not in LEFT_OUT
    }


if __name__ == "__main__":
    with TemporaryDirectory() as scratch:
        parts = scores(Path(scratch))
    lines = ",\n".join(f"{json.dumps(part)}: {json.dumps(values)}" for part, values in parts.items())
    FILE.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")
