"""A bar shows progress on a terminal, and nothing does elsewhere."""

import os
import pty
import subprocess
import sys
from contextlib import suppress

import pytest

WORK = """
from monochord.core.progress import progress_bar
with progress_bar("takes") as report:
    for done in range(3):
        report("take", done, 7)
    import time
    time.sleep(0.3)
"""


def test_a_terminal_shows_a_bar() -> None:
    ours, theirs = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "80"}
    work = subprocess.Popen([sys.executable, "-c", WORK], stderr=theirs, env=environment)
    os.close(theirs)
    shown = b""
    with suppress(OSError):  # what the kernel says once the other end is closed
        while part := os.read(ours, 4096):
            shown += part
    os.close(ours)
    assert work.wait() == 0
    assert b"take" in shown
    assert b"2/7" in shown


def test_a_pipe_gets_nothing_whatever_the_environment_says_of_terminals() -> None:
    own = {**os.environ, "FORCE_COLOR": "1", "TTY_COMPATIBLE": "1"}
    run = subprocess.run([sys.executable, "-c", WORK], capture_output=True, check=True, env=own)
    assert (run.stdout, run.stderr) == (b"", b"")


def test_a_program_that_has_imported_a_kernel_is_no_notebook() -> None:
    pytest.importorskip("ipykernel")
    run = subprocess.run([sys.executable, "-c", f"import ipykernel\n{WORK}"], capture_output=True, check=True)
    assert run.stdout == b""
