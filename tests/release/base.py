"""What the parts of the release check share: commands that have to succeed, and environments of their own."""

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).parents[2]


class CheckFailedError(Exception):
    """A check failed; the text says which command, and how it ended."""


class NotHereError(Exception):
    """A check cannot be made on this machine; the text says what is missing."""


def run(*command: str | Path, folder: Path | None = None, environment: Mapping[str, str] = {}) -> str:
    """Return what a command prints; raises `CheckFailedError` with its last lines where it fails.

    It sees nothing of a checkout: neither PYTHONPATH nor a virtual environment that is active.
    """
    own = {name: value for name, value in os.environ.items() if name not in {"PYTHONPATH", "VIRTUAL_ENV"}}
    done = subprocess.run(
        command, cwd=folder, env=own | dict(environment), capture_output=True, text=True, check=False
    )
    if done.returncode:
        last = "\n".join((done.stdout + done.stderr).splitlines()[-20:])
        raise CheckFailedError(f"{' '.join(map(str, command))} ended with {done.returncode}:\n{last}")
    return done.stdout


def environment_of(python: str | Path, folder: Path, *packages: str | Path) -> Path:
    """Make an empty virtual environment, install packages into it, and return its folder of programs."""
    run(python, "-m", "venv", "--clear", folder)
    pip = (folder / "bin/python", "-m", "pip", "--disable-pip-version-check", "--quiet")
    run(*pip, "install", "--no-compile", *packages)
    return folder / "bin"


def tools(folder: Path, *packages: str) -> Path:
    """Return the folder of programs of an environment of tools, such as ``build``; made at the first call."""
    if not (folder / "bin").is_dir():
        environment_of(sys.executable, folder, *packages)
    return folder / "bin"
