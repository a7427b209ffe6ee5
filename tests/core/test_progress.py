"""A bar shows progress on a terminal, and nothing does elsewhere."""

import os
import subprocess
import sys

import pytest
from tests.cli.terminal import on_a_terminal

WORK = """
from monochord.core.progress import progress_bar
with progress_bar("takes") as report:
    for done in range(3):
        report("take", done, 7)
    import time
    time.sleep(0.3)
"""


def test_a_terminal_shows_a_bar() -> None:
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "80"}
    shown = on_a_terminal([sys.executable, "-c", WORK], environment=environment)
    assert "take" in shown
    assert "2/7" in shown


def test_a_pipe_gets_nothing_whatever_the_environment_says_of_terminals() -> None:
    own = {**os.environ, "FORCE_COLOR": "1", "TTY_COMPATIBLE": "1"}
    run = subprocess.run([sys.executable, "-c", WORK], capture_output=True, check=True, env=own)
    assert (run.stdout, run.stderr) == (b"", b"")


def test_a_program_that_has_imported_a_kernel_is_no_notebook() -> None:
    pytest.importorskip("ipykernel")
    run = subprocess.run([sys.executable, "-c", f"import ipykernel\n{WORK}"], capture_output=True, check=True)
    assert run.stdout == b""
