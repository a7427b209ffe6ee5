"""Real-time priority: threads that run as soon as they can, before those of all other programs."""

import os
from collections.abc import Generator
from contextlib import contextmanager

from monochord.core.errors import InputError

USUAL, FIRST = 1, 2
"""Real-time priorities of a program's threads, and of the one that matters most. Those of JACK are higher."""


@contextmanager
def before_other_programs() -> Generator[None]:
    """Give real-time priority to this thread and to the threads and programs that it starts.

    Raises
    ------
    InputError
        If this user may not have it.
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
        If this user may not have it.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(priority))
    except PermissionError as error:
        given = f"real-time priority {priority} (not permitted)"
        raise InputError(
            given, "a user with that permission", "see what monochord doctor says of it"
        ) from error
