"""Packages of the repository that are not installed, made known to Monochord by their entry points."""

import tomllib
from pathlib import Path

import pytest

PACKAGES = Path(__file__).parents[2] / "packages"
YAMNET = PACKAGES / "monochord-yamnet"


@pytest.fixture
def yamnet_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install the package of YAMNet as far as the path goes: its entry points, as its project states them."""
    project = tomllib.loads((YAMNET / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    about = tmp_path / "site" / "monochord_yamnet-0.1.0.dist-info"
    about.mkdir(parents=True)
    about.joinpath("METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n", encoding="utf-8"
    )
    groups = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in entries.items())
        for group, entries in project["entry-points"].items()
    ]
    about.joinpath("entry_points.txt").write_text("\n".join(groups), encoding="utf-8")
    monkeypatch.syspath_prepend(about.parent)
