"""Setting up: `make` installs listed versions, and a machine that lacks things is told so in one line."""

import os
import shutil
import subprocess
import sys
import urllib.request
from importlib.metadata import requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

ROOT = Path(__file__).parents[2]
needs_make = pytest.mark.skipif(not shutil.which("make"), reason="make is not installed")


def test_constraints_hold_a_version_of_every_requirement() -> None:
    lines = [line.split("==") for line in (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()]
    pins = {canonicalize_name(name): Version(version) for name, version in lines}
    assert len(pins) == len(lines)
    assert not {"torch", "monochord"} & set(pins)  # installed by themselves
    required = [Requirement(line) for line in requires("monochord") or ()]
    assert required
    wrong = [
        each.name
        for each in required
        if each.name != "torch"
        and not each.specifier.contains(pins[canonicalize_name(each.name)], prereleases=True)
    ]
    assert not wrong


@needs_make
def test_every_installation_of_monochord_is_by_these_versions(tmp_path: Path) -> None:
    command = ["make", "--dry-run", "--always-make", f"VENV={tmp_path}", "docs"]
    printed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    installations = [line for line in printed.splitlines() if "pip" in line and " install " in line]
    assert len(installations) == 4  # Monochord, PyTorch, all else, the documentation's
    assert all(
        line.count("--constraint constraints.txt") == line.count(" install ") for line in installations
    )


def place(folder: Path, name: str, text: str) -> None:
    (folder / name).write_text(f"#!/bin/bash\n{text}\n", encoding="utf-8")
    (folder / name).chmod(0o755)


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """A folder of commands that holds what every machine has, and no JACK, apt or sudo."""
    for name in ("bash", "env", "rm", "touch", "sed"):
        (tmp_path / name).symlink_to(shutil.which(name) or name)
    place(tmp_path, "python3", f'exec {sys.executable} "$@"')
    place(tmp_path, "id", "echo 1000")
    return tmp_path


def set_up(machine: Path, *command: str) -> "subprocess.CompletedProcess[str]":
    environment = {"PATH": str(machine), "HOME": os.environ.get("HOME", "/"), "LANG": "C"}
    run = subprocess.run(
        command or ("bash", ".ci/system-packages"), cwd=ROOT, env=environment, capture_output=True, text=True,
        stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip
    assert "Traceback" not in run.stderr
    return run


@pytest.mark.parametrize(
    ("commands", "words"),
    [
        ({}, ("jackd2", "apt-get")),
        ({"apt-get": "echo called >&2; exit 1"}, ("jackd2", "sudo")),
        ({"apt-get": "exit 100", "id": "echo 0"}, ("jackd2", "apt-get")),
        ({"python3": ""}, ("python3-venv",)),
    ],
    ids=["no apt-get", "neither root nor sudo", "an apt-get that fails", "no Python"],
)
def test_what_cannot_be_installed_is_named_and_ends_nothing(
    machine: Path, commands: dict[str, str], words: tuple[str, ...]
) -> None:
    for name, text in commands.items():
        (machine / name).unlink(missing_ok=True)
        if text:
            place(machine, name, text)
    run = set_up(machine)
    assert run.returncode == 0
    assert len(run.stderr.splitlines()) <= 2
    assert "called" not in run.stderr
    assert all(word in run.stderr for word in words)


def test_with_sudo_it_asks_for_what_is_missing_and_never_for_a_password(machine: Path) -> None:
    place(machine, "apt-get", 'echo "apt-get $*" >&2')
    place(machine, "sudo", '[ "$1" = -n ] || exit 9; shift; exec "$@"')
    run = set_up(machine)
    assert run.returncode == 0
    update, install = run.stderr.splitlines()
    assert update.startswith("apt-get update")
    assert install.startswith("apt-get install")
    assert install.split("--no-install-recommends ")[1].split()[0] == "jackd2"


@pytest.mark.skipif(not shutil.which("jackd"), reason="jackd is not installed")
def test_where_all_is_there_nothing_is_printed_or_installed(machine: Path) -> None:
    place(machine, "jackd", "")
    place(machine, "apt-get", "echo called >&2")
    run = set_up(machine)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")


@needs_make
def test_a_python_that_is_too_old_is_refused(machine: Path, tmp_path: Path) -> None:
    old = "import sys; sys.version_info = (3, 9, 2); exec(sys.argv[1])"
    place(machine, "python3.9", f'[ "$1" = -c ] && exec {sys.executable} -c "{old}" "$2"\nexit 1')
    venv = tmp_path / "venv"
    make = shutil.which("make") or "make"
    run = set_up(machine, make, "--silent", "PYTHON=python3.9", f"VENV={venv}", f"{venv}/bin/python")
    assert run.returncode != 0
    assert "Python 3.9" in run.stderr
    assert "3.11" in run.stderr
    assert not venv.exists()


def reachable(url: str) -> bool:
    try:
        with urllib.request.urlopen(url, timeout=10.0):  # noqa: S310  (https)
            return True
    except OSError:
        return False


@needs_make
@pytest.mark.slow
@pytest.mark.timeout(600)
def test_what_make_demo_installs_comes_from_the_index_alone(tmp_path: Path) -> None:
    if not reachable("https://pypi.org/simple/pip/"):
        pytest.skip("the index of packages cannot be reached")
    command = ["make", "--dry-run", "--always-make", f"VENV={tmp_path}/venv", "demo"]
    printed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    lines = [line for line in printed.splitlines() if " -m pip " in line and " install " in line]
    assert len(lines) == 1
    subprocess.run([sys.executable, "-m", "venv", tmp_path / "venv"], check=True)
    own = {"PIP_CERT", "PIP_INDEX_URL"}
    alone = {name: value for name, value in os.environ.items() if not name.startswith("PIP_") or name in own}
    for line in lines:
        dry = line.replace(" --quiet ", " ").replace(" install ", " install --dry-run ")
        told = subprocess.run(
            ["sh", "-c", dry], cwd=ROOT, env=alone | {"PIP_CONFIG_FILE": os.devnull}, capture_output=True,
            text=True, check=False,
        )  # fmt: skip
        assert told.returncode == 0, told.stderr
        (would,) = [line for line in told.stdout.splitlines() if line.startswith("Would install ")]
        assert "numba-" in would
        assert "nvidia" not in would
        assert "torch" not in would
        print(f"$ {dry}\n{would}")  # noqa: T201  (shown with -s)
