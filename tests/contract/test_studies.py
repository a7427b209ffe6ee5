"""Studies stand outside the package: they import public names alone, and say what they make."""

import ast
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
STUDIES = sorted((ROOT / "studies").glob("[a-z]*.py"))
FILES = sorted((ROOT / "studies").rglob("*.py"))
VOCABULARY = re.compile(r"monochord\.core\.(types|units|errors|config|windows)|monochord\..*\.base")
"""Modules that are public as a whole: the vocabulary, and the base classes of plug-ins."""


def imported(file: Path) -> Iterator[tuple[str, str]]:
    """Yield the module and the name of each import of ours; "" for a module itself."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "monochord":
            yield from ((node.module or "", alias.name) for alias in node.names)
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names if alias.name.startswith("monochord."))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_study_imports_public_names_alone(file: Path) -> None:
    private = [
        f"{module}: {name}"
        for module, name in imported(file)
        if not VOCABULARY.fullmatch(module) and name not in getattr(import_module(module), "__all__", ())
    ]
    assert not private


@pytest.mark.parametrize("file", STUDIES, ids=lambda file: file.stem)
def test_a_study_says_what_it_makes_from_what_and_how_long_it_takes(file: Path) -> None:
    said = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    assert re.search(r"^Makes? ", said, re.MULTILINE)
    assert re.search(r"\b(seconds|minutes?|hours)\b", said)
    assert f"python -m studies.{file.stem}" in " ".join(said.split())


def test_no_module_of_the_package_imports_a_study() -> None:
    for file in (ROOT / "src").rglob("*.py"):
        imports = re.findall(r"^\s*(?:from|import) studies", file.read_text(encoding="utf-8"), re.MULTILINE)
        assert not imports, file
