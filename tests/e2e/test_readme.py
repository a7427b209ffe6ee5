"""README and tutorial followed from top to bottom as a newcomer does, in the state that `make demo` leaves.

There is Monochord with what it depends on, and nothing of its extras: no PyTorch, no matplotlib. Each command
works, or says by which line of the page its library is installed; then it is, and the command works as there.
"""

import json
import os
import re
import resource
import shlex
import subprocess
import time
import venv
from pathlib import Path

import pytest
import soundfile
from packaging.requirements import Requirement
from tests.e2e.printed import missing_comments, missing_lines, outputs
from tests.e2e.requirements import link
from tests.e2e.workshop import riff

ROOT = Path(__file__).parents[2]
README, TUTORIAL = ROOT / "README.md", ROOT / "docs" / "tutorial" / "first-sound.md"
SETS_UP = ("make ", "sudo ", "pip install .", "pip install '.[")
"""Commands that set the machine up: what `newcomer` makes has that behind it."""
LEFT_OUT = ("monochord demo", "monochord bench", "python -m studies.")
"""Mentioned within a sentence: `make demo` has shown the first; others take minutes, or need recordings."""
INSTALL = "pip install "
LEARNING_PATH = ("collect", "build", "train", "evaluate", "live")
LEARNING_LIMIT = 120.0
"""Seconds of processor of the five commands of the learning path, which the README says take a minute."""
FENCE, MENTION = r"^```(sh|python)\n(.*?)^```$", r"`((?:monochord|python|pip) [^`\n]+)`"
BLOCK = re.compile(f"{FENCE}|{MENTION}", re.MULTILINE | re.DOTALL)


def steps(page: Path) -> list[str]:
    """The commands of a page, in order, those within its sentences too; a program is one command."""
    found: list[str] = []
    for kind, text, inline in BLOCK.findall(page.read_text(encoding="utf-8")):
        lines = [f"python -c {shlex.quote(text)}"] if kind == "python" else [*text.splitlines(), inline]
        found += [line for line in lines if line and not line.startswith(SETS_UP)]
    return [line for line in found if line.partition("#")[0].strip() and not line.startswith(LEFT_OUT)]


def programs_of(text: str) -> list[str]:
    """The programs of a page, in order."""
    return [program for kind, program, _ in BLOCK.findall(text) if kind == "python"]


class Newcomer:
    """Somebody in a folder beside the examples, with a virtual environment as `make demo` makes one."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.home = folder / "work", folder / "venv"
        self.folder.mkdir()
        (self.folder / "examples").symlink_to(ROOT / "examples")
        venv.create(self.home, symlinks=True)
        (self.site,) = self.home.glob("lib/python*/site-packages")
        link("monochord", self.site)
        script = self.home / "bin" / "monochord"
        script.write_text(f'#!/bin/sh\nexec {self.home}/bin/python -m monochord "$@"\n', encoding="utf-8")
        script.chmod(0o755)
        path = os.pathsep.join([str(script.parent), os.environ["PATH"]])
        self._environment = os.environ | {"PATH": path, "PYTHONPATH": str(ROOT / "src")}

    def run(self, command: str) -> subprocess.CompletedProcess[str]:
        """Run a command as typed there."""
        return subprocess.run(
            ["bash", "-c", command],
            cwd=self.folder,
            env=self._environment,
            capture_output=True,
            text=True,
            stdin=subprocess.DEVNULL,
            check=False,
        )


@pytest.fixture
def newcomer(tmp_path: Path) -> Newcomer:
    for name in ("torch", "matplotlib"):
        pytest.importorskip(name)
    somebody = Newcomer(tmp_path)
    soundfile.write(somebody.folder / "riff.mp3", riff(44100, 82.41), 44100, format="MP3")
    for name in ("torch", "matplotlib", "pandas", "pytest"):
        assert somebody.run(f"python -c 'import {name}'").returncode == 1
    return somebody


def seconds_of_processor() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def follow(page: Path, newcomer: Newcomer, capsys: pytest.CaptureFixture[str]) -> dict[str, float]:
    """Take the steps of a page, and return the seconds of processor that each command took.

    What the page installs is withheld until a command asks for it, by the same line. What it says that a
    command or a program prints is printed.
    """
    costs: dict[str, float] = {}
    text = page.read_text(encoding="utf-8")
    said = outputs(text)
    programs = {f"python -c {shlex.quote(program)}": program for program in programs_of(text)}
    named, asked_for = set[str](), set[str]()
    for step in steps(page):
        if step.startswith(INSTALL):
            named.add(step.removeprefix(INSTALL))
            continue
        began, used = time.monotonic(), seconds_of_processor()
        ran = newcomer.run(step)
        asked = re.search(rf"Install it: \S+ -m {INSTALL}(.+)$", ran.stderr.strip())
        if asked:
            asked_for.add(asked[1])
            link(Requirement(shlex.split(asked[1])[0]).name, newcomer.site)
            began, used = time.monotonic(), seconds_of_processor()
            ran = newcomer.run(step)
        assert ran.returncode == 0, f"{step}\n{ran.stderr}"
        assert "nan" not in ran.stdout, step
        program = programs.get(step, step)
        assert missing_comments(program, ran.stdout) == [], ran.stdout
        assert missing_lines(said.get(program, ""), ran.stdout) == [], ran.stdout
        used = costs[step] = seconds_of_processor() - used
        with capsys.disabled():
            line = step.partition("\n")[0]
            print(f"\n{time.monotonic() - began:6.1f} s  {used:6.1f} s of processor  {line}", end="")  # noqa: T201
    assert asked_for == named
    return costs


def test_its_first_program_prints_what_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    program = programs_of(README.read_text(encoding="utf-8"))[0]
    exec(compile(program, "README.md", "exec"), {})  # noqa: S102
    printed = capsys.readouterr().out
    assert missing_comments(program, printed) == []
    assert missing_comments(program.replace("# 90.0 +- 0.5", "# 80.0 +- 0.5"), printed)  # a stale page
    assert missing_comments(program.replace("# (41, 300)", "# (41, 392)"), printed)


def test_what_a_page_prints_is_compared_by_words_and_numbers() -> None:
    said, printed = (
        "wood: 0.05 mm, 79% answered\n",
        "plastic: 0.03 mm, 90% answered\nwood: 0.06 mm, 74% answered",
    )
    assert missing_lines(said, printed) == []
    assert missing_lines(said.replace("wood", "cork"), printed) == ["cork: 0.05 mm, 79% answered"]
    assert missing_lines(said.replace("0.05", "0.50"), printed) == ["wood: 0.50 mm, 79% answered"]
    assert missing_lines(said.replace("79", "55"), printed) == ["wood: 0.05 mm, 55% answered"]
    page = "```sh\none\ntwo\n```\nIt prints\n```text\n1 mm\n```\n```python\nprint(2)\n```\n```text\n2\n```\n"
    assert outputs(page) == {"two": "1 mm\n", "print(2)\n": "2\n"}


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_every_step_works_and_the_learning_path_ends_well(
    newcomer: Newcomer, capsys: pytest.CaptureFixture[str]
) -> None:
    costs = follow(README, newcomer, capsys)
    learning = [cost for line, cost in costs.items() if line.split()[1] in LEARNING_PATH]
    assert len(learning) == len(LEARNING_PATH)
    assert sum(learning) < LEARNING_LIMIT
    scores = json.loads((newcomer.folder / "report" / "scores.json").read_text(encoding="utf-8"))
    (touched,) = (row for row in scores["table"] if row["state"] == "touched" and row["condition"] == "clean")
    assert touched["position"]["mae"]["value"] < 0.5e-3
    assert touched["force"]["mae"]["value"] < 0.2
    assert min(touched[name]["answered"] for name in ("position", "force")) > 0.98


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_every_step_of_the_tutorial_works(newcomer: Newcomer, capsys: pytest.CaptureFixture[str]) -> None:
    follow(TUTORIAL, newcomer, capsys)
