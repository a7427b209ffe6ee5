"""Real-time priority: threads that run before those of all other programs."""

import os
from collections.abc import Generator
from contextlib import contextmanager

from monochord.core.errors import InputError

__all__ = ["FIRST", "USUAL", "before_other_programs", "prioritise"]

USUAL, FIRST = 1, 2
"""Real-time priorities of a program's threads, and of the most important one. JACK's are higher."""


@contextmanager
def before_other_programs() -> Generator[None]:
    """Give real-time priority to this thread and to the threads and programs that it starts.

    Raises
    ------
    InputError
        If this user lacks the permission.
    """
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    prioritise(USUAL)
    try:
        yield
    finally:
        os.sched_setscheduler(0, *before)


def prioritise(priority: int) -> None:
    """Give this thread a real-time priority.

    Raises
    ------
    InputError
        If this user lacks the permission.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(priority))
    except PermissionError as error:
        given = f"real-time priority {priority} (not permitted)"
        raise InputError(given, "a user with that permission", "see monochord doctor") from error
