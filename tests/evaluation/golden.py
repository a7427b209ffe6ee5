"""What `evaluate` says of six sessions, kept beside the code.

``python -m tests.evaluation.golden`` writes it anew: after a change that must not touch a number,
``git diff`` shows whether one has moved, to the last bit.
"""

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import monochord as mc

FILE, PLAN = Path(__file__).with_name("golden.json"), Path(__file__).with_name("golden.toml")


def scores(folder: Path) -> dict[str, Any]:
    """Collect the plan's sessions into a folder and return each candidate's scores of all six."""
    mc.collect(PLAN, out=folder)
    files = str(folder / "*.mcap")
    reports = {
        "demo": mc.evaluate("demo", sessions=files, tuned=True, baselines=False),
        "closed_form": mc.evaluate(estimator="closed_form", sessions=files, tuned=True, baselines=False),
    }
    return {name: json.loads(json.dumps(report.tree())) for name, report in reports.items()}


if __name__ == "__main__":
    with TemporaryDirectory() as scratch:
        FILE.write_text(json.dumps(scores(Path(scratch)), indent=0) + "\n", encoding="utf-8")
    sys.stdout.write(f"{FILE}: {FILE.stat().st_size} bytes\n")
