"""Precedence over other programs, where the system grants it."""

import os
from collections.abc import Generator
from contextlib import contextmanager, suppress

NICE = -11
"""What sound servers take."""


@contextmanager
def precedence() -> Generator[None]:
    """Let this thread and those it starts run before others; a user without the right runs as before."""
    before = os.getpriority(os.PRIO_PROCESS, 0)  # Linux keeps it for each thread
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, 0, min(NICE, before))
    try:
        yield
    finally:
        os.setpriority(os.PRIO_PROCESS, 0, before)
