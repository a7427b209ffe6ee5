"""A program on a terminal of its own, and what it prints there."""

import fcntl
import os
import pty
import struct
import subprocess
import termios
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path


def on_a_terminal(
    command: Sequence[str | Path],
    *,
    folder: Path | None = None,
    environment: Mapping[str, str] | None = None,
    size: tuple[int, int] | None = None,
) -> str:
    """Run a command to its end on a pseudo-terminal, of so many columns and rows; return all that it drew."""
    ours, theirs = pty.openpty()
    if size:
        fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", size[1], size[0], 0, 0))
    shown = b""
    with subprocess.Popen(
        command, cwd=folder, stdin=theirs, stdout=theirs, stderr=theirs, env=environment
    ) as process:
        os.close(theirs)
        with suppress(OSError):  # Linux tells this way that the other side was closed
            while more := os.read(ours, 65536):
                shown += more
    os.close(ours)
    assert process.returncode == 0, shown.decode()
    return shown.decode()
