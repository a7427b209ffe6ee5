"""The repository's own rules: where things stand, what an import loads."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SRC = ROOT / "src" / "monochord"
HEAVY = ("numba", "scipy", "matplotlib", "torch", "jack", "sounddevice", "soundfile", "soxr", "rich.live")


def modules() -> list[Path]:
    return sorted(path.relative_to(SRC) for path in SRC.rglob("*.py"))


def described(document: str) -> list[str]:
    """Paths in backquotes: what holds a slash or ends like a file, and neither spaces nor blanks to fill."""
    words = re.findall(r"`([^`\s]+)`", (ROOT / document).read_text(encoding="utf-8"))
    return sorted({word for word in words if re.fullmatch(r"[\w./-]*(/|\.(py|md|toml))[\w./-]*", word)})


def test_no_module_has_a_name_that_says_nothing() -> None:
    names = {part.strip("_") for module in modules() for part in module.with_suffix("").parts}
    assert not names & {"utils", "util", "common", "helpers", "misc"}


def test_every_path_in_architecture_exists() -> None:
    paths = described("ARCHITECTURE.md")
    assert len(paths) > 20
    absent = [path for path in paths if not (ROOT / path).exists()]
    assert not absent, f"ARCHITECTURE.md names what is not there: {absent}"


def test_every_package_is_in_architecture() -> None:
    packages = {f"src/monochord/{child.name}{'/' if child.is_dir() else ''}" for child in SRC.iterdir()}
    packages -= {package for package in packages if "/_" in package or package.endswith("py.typed")}
    assert packages <= set(described("ARCHITECTURE.md"))


@pytest.mark.parametrize("document", ["README.md", "CONTRIBUTING.md", "docs/ROADMAP.md"])
def test_links_between_documents_lead_somewhere(document: str) -> None:
    page = ROOT / document
    targets = re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8"))
    absent = [target for target in targets if not (page.parent / target).exists()]
    assert not absent, f"{document} links to what is not there: {absent}"


def loaded_by(statement: str) -> set[str]:
    code = f"import sys\n{statement}\nprint(*sys.modules, file=sys.stderr)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(run.stderr.split())


@pytest.mark.parametrize(
    "statement",
    [
        "import monochord",
        "import monochord.cli",
        "import monochord.core.types, monochord.capture.sources, monochord.live.sinks",
        "import monochord.perception.estimators, monochord.figures",
        "from monochord import cli; assert cli.run(['--help']) == 0",
    ],
)
def test_an_import_loads_nothing_heavy(statement: str) -> None:
    heavy = loaded_by(statement) & set(HEAVY)
    assert not heavy, f"'{statement}' loads {sorted(heavy)}"
