"""What the documents tell people to type works."""

import importlib
import json
import pkgutil
import re
import shlex
import subprocess
import sys
from pathlib import Path

import click
import pytest

from monochord.cli import monochord as commands
from monochord.cli import run
from monochord.physics.materials import material_names
from monochord.physics.sensors import sensor_names
from monochord.physics.strings import string_names

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
GENERATED = {"commands.md", "plugins.md", "presets.md"}
COMMANDS = sorted(
    {
        (page.name, line.strip())
        for page in PAGES
        if page.name not in GENERATED
        for block in re.findall(
            r"^```sh\n(.*?)^```$", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
        )
        for line in block.replace("\\\n", " ").splitlines()
        if line.strip().startswith("monochord ")
    }
)


def test_there_are_commands_to_check() -> None:
    assert len(COMMANDS) > 8


@pytest.mark.parametrize(("page", "line"), COMMANDS)
def test_a_command_line_in_a_document_can_be_parsed(page: str, line: str) -> None:
    name, *arguments = shlex.split(line, comments=True)[1:]
    parent = click.Context(commands, info_name="monochord", **commands.context_settings)
    command = commands.get_command(parent, name)
    assert command is not None, page
    command.make_parser(click.Context(command, info_name=name, parent=parent)).parse_args(arguments)


@pytest.mark.parametrize(
    "target", re.findall(r"\bmake ([a-z-]+)`?", (ROOT / "README.md").read_text(encoding="utf-8"))
)
def test_a_make_target_in_the_readme_exists(target: str) -> None:
    assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)


@pytest.mark.slow
def test_the_readmes_python_runs(capsys: pytest.CaptureFixture[str]) -> None:
    blocks = re.findall(
        r"^```python\n(.*?)^```$", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    )
    for block in blocks:
        promised = re.findall(r"^print\(.*  # (.*?)(?: m)?$", block, re.MULTILINE)
        exec(block, {})  # noqa: S102
        printed = capsys.readouterr().out.split("\n")[:-1]
        assert promised
        assert printed
        # What comes of a run in real time is not promised, and is printed first.
        for said, is_so in zip(promised, printed[-len(promised) :], strict=True):
            assert numbers(is_so) == pytest.approx(numbers(said), abs=1e-9)


def numbers(line: str) -> list[float]:
    return [float(number) for number in re.findall(r"[\d.]+", line)]


def test_the_readmes_touch_is_simulated_and_found_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    readme = [
        shlex.split(line, comments=True)[1:]
        for page, line in COMMANDS
        if page == "README.md" and "take.wav" in line
    ]
    simulate, locate = sorted(readme, key=lambda words: words[0], reverse=True)
    assert run(simulate) == 0
    place, force = (float(simulate[simulate.index(name) + 1]) for name in ("--at", "--force"))
    last: dict[str, dict[str, float]] = {}
    for command in (locate, ["live", *locate[1:]]):
        capsys.readouterr()
        assert run(command) == 0
        last[command[0]] = json.loads(capsys.readouterr().out.splitlines()[-1])
        assert last[command[0]]["position"] == pytest.approx(place, abs=5e-4)
    assert last["live"]["force"] == pytest.approx(force, abs=0.05)


@pytest.mark.slow
def test_the_documentation_builds_without_a_warning(tmp_path: Path) -> None:
    pytest.importorskip("furo", reason="the docs extra is not installed: make docs")
    pytest.importorskip("myst_parser", reason="the docs extra is not installed: make docs")
    build = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", "docs", str(tmp_path)]
    made = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    assert (tmp_path / "index.html").is_file()


PICTURES = re.findall(
    r"!\[([^\]]*)\]\(([^)]+)\)\n\n\*([^*]*)\*", (ROOT / "README.md").read_text(encoding="utf-8")
)


@pytest.mark.parametrize(("shown", "path", "said"), PICTURES)
def test_a_picture_of_the_readme_is_light_described_and_said_to_be_simulated_or_real(
    shown: str, path: str, said: str
) -> None:
    assert len(shown) > 20
    assert (ROOT / path).stat().st_size < 300_000
    assert re.search(r"simulated|Real recordings", said)


def test_every_picture_of_the_readme_has_its_words_below() -> None:
    assert len(PICTURES) == (ROOT / "README.md").read_text(encoding="utf-8").count("![")


def test_the_presets_have_a_page_with_their_sources() -> None:
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        page = importlib.import_module("folders").presets()
    finally:
        sys.path.remove(str(ROOT / "docs"))
    for name in (*sensor_names(), *string_names(), *material_names()):
        assert f"### {name}\n" in page
    assert page.count("Source: ") == page.count("### ")


HAND_WRITTEN = [
    page
    for page in sorted((ROOT / "docs").rglob("*.md"))
    if page.name not in GENERATED and page.parent.name != "library"
]


@pytest.mark.parametrize("page", HAND_WRITTEN, ids=lambda page: page.name)
def test_names_and_links_of_a_page_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    if page.parent.name != "design":  # a design note may name what stood when it was written
        names = re.findall(r"`(monochord(?:\.[a-z]\w*)+)`|\.\. auto\w+:: (\S+)", text)
        for name in {one or other for one, other in names}:
            pkgutil.resolve_name(name)
    for target in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", text):
        generated = Path(target).name in GENERATED or "library/" in target
        assert generated or (page.parent / target).exists(), target


def test_every_package_has_a_library_page(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    folders = importlib.import_module("folders")
    pages = {package: folders.library(package) for package in folders.packages()}
    assert {"capture", "core", "perception", "physics"} <= set(pages)
    assert all(f".. automodule:: monochord.{package}" in page for package, page in pages.items())
