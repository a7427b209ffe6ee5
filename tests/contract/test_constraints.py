"""What `make` installs: one file of versions, which covers all that Monochord may ask for."""

import re
import shutil
import subprocess
from importlib.metadata import requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).parents[2]
LINES = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
PINS = {canonicalize_name(name): version for name, version in (line.split("==") for line in LINES)}
REQUIRED = [Requirement(line) for line in requires("monochord") or ()]


def test_it_holds_names_and_versions_only() -> None:
    assert all(re.fullmatch(r"[\w.-]+==[\w.]+", line) for line in LINES)
    assert len(PINS) == len(LINES)
    assert not {"torch", "monochord"} & set(PINS)


@pytest.mark.parametrize("requirement", REQUIRED, ids=lambda requirement: str(requirement.name))
def test_every_requirement_has_a_version_that_it_allows(requirement: Requirement) -> None:
    if requirement.name != "torch":
        pinned = Version(PINS[canonicalize_name(requirement.name)])
        assert requirement.specifier.contains(pinned, prereleases=True)


@pytest.mark.skipif(not shutil.which("make"), reason="make is not installed")
def test_every_installation_of_monochord_is_by_these_versions(tmp_path: Path) -> None:
    command = ["make", "--dry-run", "--always-make", f"VENV={tmp_path}", "docs"]
    printed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    installations = [line for line in printed.splitlines() if "pip" in line and " install " in line]
    assert len(installations) == 4  # Monochord, PyTorch, all else, the documentation's
    assert all("--constraint constraints.txt" in line for line in installations)


def test_the_workflow_runs_what_anybody_runs_and_nothing_else() -> None:
    workflow = (ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8")
    assert re.findall(r"^\s*- run: (.*)$", workflow, re.MULTILINE) == [".ci/run"]
    assert 'python-version: "3.11"' in workflow
