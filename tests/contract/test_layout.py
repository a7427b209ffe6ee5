"""The repository's own rules: what may import what, what an import loads, and that what pages name exists."""

import ast
import pkgutil
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

ROOT = Path(__file__).parents[2]
GENERATED = {ROOT / "docs" / "reference" / f"{name}.md" for name in ("commands", "plugins", "presets")}
PAGES = {
    page: page.read_text(encoding="utf-8")
    for page in (*ROOT.glob("*.md"), *sorted((ROOT / "docs").rglob("*.md")))
    if page not in GENERATED and page.parent.name != "library" and "_build" not in page.parts
}
SRC = ROOT / "src" / "monochord"
HEAVY = {"numba", "scipy", "matplotlib", "torch", "jack", "sounddevice", "soundfile", "soxr", "rich.live"}
QUICK = (
    "import monochord",
    "import monochord.cli",
    "import monochord.core.types, monochord.capture.sources, monochord.live.sinks",
    "import monochord.perception.estimators, monochord.figures",
    "assert monochord.cli.run(['--help']) == 0",
)
VOCABULARY = re.compile(
    r"monochord\.core\.(types|units|errors|config|windows|reasons|ranges|shapes|presets)|monochord\..*\.base"
)
"""Modules that are public as a whole: the vocabulary, and the base classes of plug-ins."""


def test_the_front_door_loads_nothing_heavy() -> None:
    lines = [f"{each}; print('loaded', {each!r}, {HEAVY} & set(sys.modules) or '')" for each in QUICK]
    code = "\n".join(["import sys", *lines])
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = [line for line in run.stdout.splitlines() if line.startswith("loaded ")]
    assert len(loaded) == len(QUICK)
    assert not [line for line in loaded if line.endswith("}")]


def test_every_package_is_in_architecture() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    packages = {file.parent.name for file in SRC.glob("[!_]*/__init__.py")}
    assert {"core", "cli"} <= packages
    assert not {name for name in packages if f"`src/monochord/{name}/`" not in text}


def imported(file: Path) -> Iterator[tuple[str, str]]:
    """Yield the module and the name of each import; "" for a module itself."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            yield from ((node.module or "", alias.name) for alias in node.names)
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)


def test_studies_and_packages_import_public_names_alone_and_nothing_imports_a_study() -> None:
    private = [
        f"{file.name}: {name} of {module}"
        for folder in ("studies", "packages")
        for file in (ROOT / folder).rglob("*.py")
        for module, name in imported(file)
        if re.match(r"monochord(_encoders)?\.", module) or (module == "monochord" and name)
        if module.split(".")[0] not in file.relative_to(ROOT).parts
        if not VOCABULARY.fullmatch(module) and name not in getattr(import_module(module), "__all__", ())
    ]
    assert not private
    sources = [file for file in SRC.rglob("*.py") if "studies" in file.read_text(encoding="utf-8")]
    assert not [file for file in sources for module, _ in imported(file) if module.split(".")[0] == "studies"]


def test_names_paths_and_links_lead_somewhere() -> None:
    absent: list[str] = []
    for page, text in PAGES.items():
        targets = re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", text)
        paths = [(page.parent / each).resolve() for each in targets if "library/" not in each]
        absent += [f"{page.name}: {path}" for path in paths if path not in GENERATED and not path.exists()]
        if page.parent.name == "design" or page.name == "CHANGELOG.md":  # may name what stood once
            continue
        start = "[A-Za-z]" if page.name == "ARCHITECTURE.md" else "[a-z]"  # upgrade.md names former classes
        for names in re.findall(rf"`(monochord(?:\.{start}\w*)+)`|\.\. auto\w+:: (\S+)", text):
            try:
                pkgutil.resolve_name("".join(names))
            except (ImportError, AttributeError):
                absent.append(f"{page.name}: {''.join(names)}")
    # Paths in backquotes: what holds a slash or ends like a file, and neither spaces nor blanks to fill.
    quoted = re.findall(r"`([\w./-]*(?:/|\.(?:py|md|toml))[\w./-]*)`", PAGES[ROOT / "ARCHITECTURE.md"])
    assert len(quoted) > 20
    absent += [f"ARCHITECTURE.md: {path}" for path in quoted if not (ROOT / path).exists()]
    assert not absent


def code_lines(file: Path) -> tuple[int, int]:
    """Return how many lines of code a command's file has, and how many commands.

    Imports, docstrings and comments do not count, nor what declares options: decorators and parameters.
    """
    tree = ast.parse(file.read_text(encoding="utf-8"))
    counted, left_out, commands = set[int](), set[int](), 0
    for node in ast.walk(tree):
        if isinstance(node, ast.stmt | ast.expr):
            counted |= {node.lineno, node.end_lineno or 0}
        is_text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if isinstance(node, ast.Import | ast.ImportFrom) or is_text:
            left_out |= set(range(node.lineno, (node.end_lineno or 0) + 1))  # pyright: ignore[reportAttributeAccessIssue]
        if isinstance(node, ast.FunctionDef) and node.decorator_list:
            is_command = any(re.search(r"\bcommand\(", ast.unparse(each)) for each in node.decorator_list)
            commands += is_command
            if is_command:
                left_out |= set(range(node.decorator_list[0].lineno, node.body[0].lineno))
    return len(counted - left_out), commands


def test_a_command_has_at_most_sixty_lines_beyond_its_options() -> None:
    counts = {file.stem: code_lines(file) for file in (SRC / "cli").glob("[!_]*.py")}
    assert {"live", "sessions"} <= counts.keys()
    assert all(commands for _, commands in counts.values())
    assert not {name: count for name, count in counts.items() if count[0] > 60 * count[1]}
