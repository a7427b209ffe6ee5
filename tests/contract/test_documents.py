"""What the documents tell people to type works."""

import json
import re
import shlex
import subprocess
import sys
from html import unescape
from pathlib import Path
from urllib.parse import unquote

import click
import pytest
from tests.contract.test_layout import PAGES, ROOT

from monochord.cli import monochord as commands
from monochord.cli import run

README = PAGES[ROOT / "README.md"]


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def shown_commands(text: str) -> list[str]:
    """Return each command of `monochord` that a page shows, as a line for the shell."""
    lines = "\n".join(blocks(text, "sh")).replace("\\\n", " ").splitlines()
    return [line.strip() for line in lines if line.strip().startswith("monochord ")]


def command_lines(text: str) -> list[list[str]]:
    """Return the words behind `monochord` of each command that a page shows."""
    return [shlex.split(line, comments=True)[1:] for line in shown_commands(text)]


def parse(name: str, *arguments: str) -> None:
    parent = click.Context(commands, info_name="monochord", **commands.context_settings)
    command = commands.get_command(parent, name)
    assert command is not None, "no such command"
    command.make_parser(click.Context(command, info_name=name, parent=parent)).parse_args(list(arguments))


def test_every_command_line_in_a_document_can_be_parsed() -> None:
    shown = [(page.name, words) for page, text in PAGES.items() for words in command_lines(text)]
    assert len(shown) > 8
    wrong: list[object] = []
    for page, words in shown:
        try:
            parse(*words)
        except (AssertionError, click.ClickException) as error:
            wrong.append((page, words, error))
    assert not wrong


def test_every_make_target_in_a_document_exists() -> None:
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    targets = set(re.findall(r"^([a-z-]+):", makefile, re.MULTILINE))
    named = {
        name for text in PAGES.values() for name in re.findall(r"(?:`|^)make ([a-z-]+)", text, re.MULTILINE)
    }
    assert {"demo", "test"} <= named
    assert named <= targets


def test_the_readmes_touch_is_simulated_and_found_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    readme = [words for words in command_lines(README) if "take.wav" in words]
    simulate, locate = sorted(readme, key=lambda words: words[0], reverse=True)
    assert run(simulate) == 0
    place, force = (float(simulate[simulate.index(name) + 1]) for name in ("--at", "--force"))
    last: dict[str, dict[str, float]] = {}
    for command in (locate, ["live", *locate[1:]]):
        capsys.readouterr()
        assert run(command) == 0
        last[command[0]] = json.loads(capsys.readouterr().out.splitlines()[-1])
        assert last[command[0]]["position"] == pytest.approx(place, abs=5e-4)
    assert last["live"]["force"] == pytest.approx(force, abs=0.15)


SELF_CONTAINED = (
    "index", "how-to/design", "how-to/identify", "how-to/publish", "how-to/robot",
    "how-to/train-a-policy", "how-to/tune", "reference/physics", "reference/twin",
)  # fmt: skip
"""Pages whose programs need nothing but Monochord; those of the tutorials run in `tests/e2e`."""


@pytest.mark.slow
@pytest.mark.parametrize("name", SELF_CONTAINED)
def test_the_programs_of_a_page_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    programs = blocks(PAGES[ROOT / "docs" / f"{name}.md"], "python")
    assert programs
    space: dict[str, object] = {}  # a page is read from its top
    for program in programs:
        exec(program, space)  # noqa: S102


@pytest.mark.slow
def test_the_documentation_builds_without_a_warning(tmp_path: Path) -> None:
    pytest.importorskip("furo", reason="the docs extra is not installed: make docs")
    pytest.importorskip("myst_parser", reason="the docs extra is not installed: make docs")
    build = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", "docs", str(tmp_path)]
    made = subprocess.run(build, cwd=ROOT, capture_output=True, text=True, check=False)
    assert made.returncode == 0, made.stderr
    assert (tmp_path / "index.html").is_file()
    pages = {page: page.read_text(encoding="utf-8") for page in tmp_path.rglob("*.html")}
    for name in ("tutorial/first-sound", "reference/physics"):
        assert "<math" in pages[tmp_path / f"{name}.html"]
    physics = pages[tmp_path / "reference" / "physics.html"]
    functions = re.findall(r'href="[^"]*#(monochord\.[\w.]+)"', physics)
    assert len(functions) == PAGES[ROOT / "docs" / "reference" / "physics.md"].count("{py:func}")
    assert "copybtn" in (tmp_path / "_static" / "copybutton.js").read_text(encoding="utf-8")
    assert (tmp_path / "index.html").read_text(encoding="utf-8").count("sd-card-title") == 3
    assert not [page.name for page, text in pages.items() if FETCHED.search(text)]
    styles = [sheet for sheet in tmp_path.rglob("*.css") if FETCHED.search(sheet.read_text(encoding="utf-8"))]
    assert not styles
    assert not dead_links(pages)


FETCHED = re.compile(
    r"""<(?:script|link|img|iframe|source|video|object)\b[^>]*\b(?:src|href|data)=["'](?:https?:)?//"""
    r"""|(?:@import|url\()\s*["']?(?:https?:)?//"""
)
"""What a browser would load from another host as it shows a page."""


def dead_links(pages: dict[Path, str]) -> list[str]:
    """Return the links of built pages that lead to no file of the site, or to no place in a page."""
    places = {page: set(re.findall(r'\bid="([^"]+)"', text)) for page, text in pages.items()}
    dead: list[str] = []
    for page, text in pages.items():
        for link in re.findall(r'<a\b[^>]*\bhref="([^":]*)"', text):
            path, _, anchor = unquote(unescape(link)).partition("#")
            target = (page.parent / path).resolve() if path else page
            if not target.exists() or (anchor and target in places and anchor not in places[target]):
                dead.append(f"{page.name}: {link}")
    return dead


def test_a_dead_link_and_a_fetched_file_are_found(tmp_path: Path) -> None:
    page, other = tmp_path / "page.html", tmp_path / "other.html"
    other.touch()
    links = "".join(f'<a href="{each}">' for each in ("other.html#a%20b", "other.html#no", "#no", "no.html"))
    found = dead_links({page: links, other: '<p id="a b">'})
    assert found == ["page.html: other.html#no", "page.html: #no", "page.html: no.html"]
    for text in (
        '<script src="https://a/b.js">',
        '<link rel="x" href="//a/b.css">',
        "url(https://a/font.woff2)",
    ):
        assert FETCHED.search(text)
    assert not FETCHED.search('<a href="https://a">a</a><script src="b.js"></script>')
