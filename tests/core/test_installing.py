"""Every line that installs something is made in one place, and works with and without a release."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from email.message import Message
from pathlib import Path
from typing import Any

import pytest

from monochord.core import installing
from monochord.core.installing import TORCH, TORCH_INDEX, installation

ROOT = Path(__file__).parents[2]
LISTED = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
EXTRAS = {
    "train": ["torch>=2.6"],
    "export": ["pyarrow>=17"],
    "cluster": ["dask>=2025.1", "distributed>=2025.1"],
}


class Installed:
    """What importlib.metadata tells of Monochord, installed from a place."""

    def __init__(self, noted: object) -> None:
        self._noted = noted
        self.requires = [f"{name}; extra == '{extra}'" for extra, names in EXTRAS.items() for name in names]
        self.metadata = Message()

    def read_text(self, name: str) -> str | None:
        assert name == "direct_url.json"
        return None if self._noted is None else json.dumps(self._noted)


@pytest.fixture
def python(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys, "executable", str(tmp_path / "my env" / "bin" / "python"))
    return tmp_path


def installed(monkeypatch: pytest.MonkeyPatch, noted: object) -> None:
    monkeypatch.setattr(installing, "distribution", lambda _: Installed(noted))


def arguments(line: str) -> list[list[str]]:
    """What each pip of a line is told to install."""
    words = [shlex.split(part) for part in line.split(" && ")]
    assert all(each[:4] == ["my env/bin/python", "-m", "pip", "install"] for each in words)
    return [each[4:] for each in words]


def test_pytorch_comes_first_and_from_its_index_for_the_cpu(
    python: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    installed(monkeypatch, {"url": python.as_uri(), "dir_info": {}})
    assert arguments(installation("train")) == [[TORCH, "--index-url", TORCH_INDEX]]
    monkeypatch.setattr(sys, "platform", "darwin")
    assert arguments(installation("train")) == [[TORCH]]


@pytest.mark.parametrize("with_torch", [True, False])
def test_a_package_comes_from_the_checkout_or_as_a_wheel(
    python: Path, monkeypatch: pytest.MonkeyPatch, *, with_torch: bool
) -> None:
    found = object() if with_torch else None
    monkeypatch.setattr(installing, "find_spec", lambda name: found if name == "torch" else object())
    (python / "a checkout" / "packages").mkdir(parents=True)
    (python / "monochord-0.2.0-py3-none-any.whl").touch()
    folder, wheel = python / "a checkout", python / "monochord-0.2.0-py3-none-any.whl"
    first = [] if with_torch else [[TORCH, "--index-url", TORCH_INDEX]]
    for noted, place in (
        ({"url": folder.as_uri(), "dir_info": {"editable": True}}, f"{folder}/packages"),
        ({"url": wheel.as_uri(), "archive_info": {}}, "./packages"),
        (None, "./packages"),
    ):
        installed(monkeypatch, noted)
        line, _, elsewhere = installation("monochord-encoders").partition(" # ")
        assert arguments(line) == [*first, [f"{place}/monochord-encoders"]]
        assert elsewhere.endswith(" from monochord_encoders-*.whl")
        assert arguments(installation("monochord-yamnet").partition(" # ")[0]) == [
            *first,
            [f"{place}/monochord-encoders", f"{place}/monochord-yamnet"],
        ]
    monkeypatch.chdir(folder)
    installed(monkeypatch, {"url": folder.as_uri(), "dir_info": {}})
    assert installation("monochord-encoders").partition(" # ")[0].endswith(" ./packages/monochord-encoders")


def test_every_package_of_the_repository_that_adds_to_monochord_has_its_line() -> None:
    files = {file.parent.name: file.read_text("utf-8") for file in ROOT.glob("packages/*/pyproject.toml")}
    dependencies = {name: tomllib.loads(text)["project"]["dependencies"] for name, text in files.items()}
    adds = {
        name for name, lines in dependencies.items() if any(re.match("monochord", each) for each in lines)
    }
    assert installing.PACKAGES.keys() == adds == files.keys() - {"lerobot_camera_monochord"}
    for name, needed in installing.PACKAGES.items():
        others = [line for line in dependencies[name] if re.match("monochord-", line)]
        assert [re.split("[><=]", line)[0] for line in others] + [name] == list(needed)


def test_several_libraries_come_as_the_extra_of_what_monochord_was_installed_from(
    python: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    checkout, wheel = python / "a checkout", python / "monochord-0.2.0-py3-none-any.whl"
    checkout.mkdir()
    wheel.touch()
    editable = {"editable": True}
    for noted, expected in (
        ({"url": python.as_uri(), "dir_info": {}}, [".[cluster]"]),
        ({"url": python.as_uri(), "dir_info": editable}, ["--editable", ".[cluster]"]),
        ({"url": checkout.as_uri(), "dir_info": {}}, [f"{checkout}[cluster]"]),
        ({"url": wheel.as_uri(), "archive_info": {}}, [f"{wheel}[cluster]"]),
        (None, ["monochord[cluster]"]),
        ({"url": (python / "gone.whl").as_uri(), "archive_info": {}}, EXTRAS["cluster"]),
        ({"url": "https://example.org/monochord.git", "vcs_info": {}}, EXTRAS["cluster"]),
    ):
        installed(monkeypatch, noted)
        assert arguments(installation("cluster")) == [expected]
        assert arguments(installation("export")) == [["pyarrow>=17"]]
        assert arguments(installation("tensorboard")) == [["tensorboard"]]


@pytest.mark.parametrize("noted", [[], "text", {"url": 3}, {"url": "file://["}])
def test_a_strange_note_of_pip_is_none(python: Path, monkeypatch: pytest.MonkeyPatch, noted: Any) -> None:
    installed(monkeypatch, noted)
    assert python
    assert arguments(installation("cluster"))[0][-1] in ("distributed>=2025.1", "monochord[cluster]")


def texts() -> dict[str, str]:
    """The tracked pages, programs and settings, by name."""
    kinds = (".md", ".ipynb", ".py", ".toml", ".yml", ".yaml")
    names = [
        name for name in LISTED.stdout.split() if name.endswith(kinds) or name in ("Makefile", "Dockerfile")
    ]
    own = Path(__file__).relative_to(ROOT).as_posix()
    return {
        name: (ROOT / name).read_text(encoding="utf-8") for name in names if name not in (own, "CHANGELOG.md")
    }


@pytest.mark.skipif(LISTED.returncode != 0, reason="not a checkout with git")
def test_every_page_installs_pytorch_by_the_same_line() -> None:
    asked = re.compile(r"pip install [^`\n\"|]*\btorch\b[^`\n\"|]*")
    expected, found = f"pip install {TORCH} --index-url {TORCH_INDEX}", 0
    for name, text in texts().items():
        if name.startswith(("tests/", "src/monochord/core/installing")):
            continue
        for line in asked.findall(text):
            assert line.removesuffix("\\n").partition("#")[0].strip() == expected, f"{name}: {line}"
            found += 1
    assert found >= 5
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert f"TORCH := {TORCH}\nTORCH_INDEX := {TORCH_INDEX}\n" in makefile


@pytest.mark.skipif(LISTED.returncode != 0, reason="not a checkout with git")
def test_no_page_asks_an_index_for_monochord_before_a_release() -> None:
    for name, text in texts().items():
        asked = re.findall(r"pip install (?:--\S+ )*'?monochord(?:\[|'|\s|$)", text)
        assert not asked, name
    for name, text in texts().items():
        for place, extra in re.findall(r"pip install (?:--\S+ )*'([^'\[]*)\[([a-z,]+)\]'", text):
            folder = ROOT / place if place.startswith("./packages/") else ROOT
            known = (folder / "pyproject.toml").read_text(encoding="utf-8")
            assert all(f"\n{each} = [" in known for each in extra.split(",")), f"{name}: {extra}"


PIP = """#!/bin/sh
echo "$*" >>"$LOG"
case "$*" in
*--no-index*) exit "$WITHOUT_INDEX" ;;
esac
"""


@pytest.mark.skipif(not shutil.which("make"), reason="make is not installed")
@pytest.mark.parametrize("lies_here", [True, False])
def test_make_asks_the_index_only_where_no_build_for_the_cpu_is_at_hand(
    tmp_path: Path, *, lies_here: bool
) -> None:
    venv = tmp_path / "venv"
    (venv / "bin").mkdir(parents=True)
    (venv / "bin" / "python").write_text(PIP, encoding="utf-8")
    (venv / "bin" / "python").chmod(0o755)
    (venv / ".installed-package").touch()
    given = {"LOG": str(tmp_path / "log"), "WITHOUT_INDEX": str(int(not lies_here))}
    command = [
        "make",
        "--silent",
        f"VENV={venv}",
        "--assume-old=system",
        f"--assume-old={venv}/.installed-package",
    ]
    subprocess.run([*command, f"{venv}/.installed"], cwd=ROOT, env=os.environ | given, check=True)
    lines = [line for line in (tmp_path / "log").read_text(encoding="utf-8").splitlines() if "torch" in line]
    assert "--no-index" in lines[0]
    assert lines[0].endswith(f"{TORCH}+cpu")  # a build with a graphics card's libraries does not fit
    assert [f"--index-url {TORCH_INDEX} {TORCH}" in line for line in lines[1:]] == [True] * (not lies_here)


@pytest.mark.skipif(not shutil.which("make"), reason="make is not installed")
def test_make_demo_asks_for_no_pytorch(tmp_path: Path) -> None:
    command = ["make", "--dry-run", "--always-make", f"VENV={tmp_path}", "demo"]
    printed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    lines = [line for line in printed.splitlines() if " install " in line]
    assert [line.rpartition(" install ")[2].split()[-1] for line in lines] == ["."]
