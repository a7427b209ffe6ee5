"""Setting up on machines that lack things: one clear line, and on it goes."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


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


def set_up(machine: Path, *command: str) -> subprocess.CompletedProcess[str]:
    environment = {"PATH": str(machine), "HOME": os.environ.get("HOME", "/"), "LANG": "C"}
    run = subprocess.run(
        command or ("bash", ".ci/system-packages"),
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
        check=False,
    )
    assert "Traceback" not in run.stderr
    return run


def test_what_is_missing_and_cannot_be_installed_is_one_line(machine: Path) -> None:
    run = set_up(machine)
    assert (run.returncode, run.stdout) == (0, "")
    assert run.stderr.count("\n") == 1
    assert "jackd2" in run.stderr
    assert "there is no apt-get here; install them by hand" in run.stderr


def test_without_root_and_sudo_it_says_so(machine: Path) -> None:
    place(machine, "apt-get", "echo called >&2; exit 1")
    run = set_up(machine)
    assert run.returncode == 0
    assert "neither root nor sudo is at hand" in run.stderr
    assert "called" not in run.stderr


def test_with_sudo_it_asks_for_what_is_missing_and_never_for_a_password(machine: Path) -> None:
    place(machine, "apt-get", 'echo "apt-get $*" >&2')
    place(machine, "sudo", '[ "$1" = -n ] || exit 9; shift; exec "$@"')
    run = set_up(machine)
    assert run.returncode == 0
    update, install = run.stderr.splitlines()
    assert update.startswith("apt-get update")
    assert install.startswith("apt-get install")
    assert install.split("--no-install-recommends ")[1].split()[0] == "jackd2"


def test_an_apt_that_fails_is_one_line_more(machine: Path) -> None:
    place(machine, "apt-get", "exit 100")
    place(machine, "id", "echo 0")
    run = set_up(machine)
    assert run.returncode == 0
    assert "apt-get could not install them" in run.stderr


def test_where_python_is_missing_it_is_installed_too(machine: Path) -> None:
    (machine / "python3").unlink()
    assert "python3 python3-venv" in set_up(machine).stderr


@pytest.mark.skipif(not shutil.which("jackd"), reason="jackd is not installed")
def test_where_all_is_there_nothing_is_printed_or_installed(machine: Path) -> None:
    place(machine, "jackd", "")
    place(machine, "apt-get", "echo called >&2")
    run = set_up(machine)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")


@pytest.mark.skipif(not shutil.which("make"), reason="make is not installed")
def test_a_python_that_is_too_old_is_refused_in_one_line(machine: Path, tmp_path: Path) -> None:
    old = "import sys; sys.version_info = (3, 9, 2); exec(sys.argv[1])"
    place(machine, "python3.9", f'[ "$1" = -c ] && exec {sys.executable} -c "{old}" "$2"\nexit 1')
    venv = tmp_path / "venv"
    make = shutil.which("make") or "make"
    run = set_up(machine, make, "--silent", "PYTHON=python3.9", f"VENV={venv}", f"{venv}/bin/python")
    assert run.returncode != 0
    assert "Python 3.9: allowed is 3.11 or newer; name another one: make PYTHON=python3.12" in run.stderr
    assert not venv.exists()
