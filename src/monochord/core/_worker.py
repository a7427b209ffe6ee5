"""A worker process: its setup, and running its jobs."""

import os
import pickle
import signal
import sys
import threading
from collections.abc import Generator
from contextlib import contextmanager, suppress
from multiprocessing import parent_process, resource_tracker
from typing import Any

from monochord.core.errors import DeviceError
from monochord.core.interruption import interruption

MAX_DEATHS = 3
"""Number of workers that may die during one job before it fails."""
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Environment of a worker: one thread each, since every core has a worker."""


_last = threading.local()
"""Function of each thread's last job, as bytes and unpickled, including anything it has loaded."""


def pack(value: Any) -> bytes:
    """Return a job, or its function, as bytes, opaque to schedulers."""
    return pickle.dumps(value)


def call(work: bytes, job: bytes) -> Any:
    """Run a packed job with its packed function; raises `DeviceError` if this worker lacks its module."""
    try:
        if getattr(_last, "packed", None) != work:
            _last.work = pickle.loads(work)  # noqa: S301  (from the process that started this one)  # nosec B301
            _last.packed = work
        argument = pickle.loads(job)  # noqa: S301  (likewise)  # nosec B301
    except (ImportError, AttributeError) as error:
        raise DeviceError(unreadable(error)) from error
    return _last.work(argument)


def call_in(folder: str, work: bytes, job: bytes) -> Any:
    """Run a packed job in the working folder of the program that sent it, so that relative paths work."""
    with suppress(OSError):
        os.chdir(folder)
    return call(work, job)


def unreadable(error: BaseException) -> str:
    """Return the error message for a worker that lacks a module of its job."""
    return f"a worker cannot read its job ({error}): install the same code there"


def prepare(niceness: int = 0) -> None:
    """Initialise a worker as it starts, with a niceness above its parent's.

    Workers ignore Control-C, since their parent ends them; a worker also ends when its parent does, in any
    way.
    """
    os.nice(niceness)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)


@contextmanager
def shielded() -> Generator[None]:
    """Block Control-C while workers start or end; workers started inside ignore it.

    A terminal sends Control-C to workers too; before they ignore it, it would end them with a traceback.
    """
    resource_tracker.ensure_running()  # which would unblock the signal in the thread that starts it
    with interruption() as stop:
        # A new process or thread inherits the mask.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    if stop.requested:
        raise KeyboardInterrupt


@contextmanager
def one_thread_each() -> Generator[None]:
    """Let workers started inside use one thread each; restore the environment afterwards."""
    before = dict(os.environ)
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


@contextmanager
def without_main() -> Generator[None]:
    """Keep workers started inside from running the program's script again, as `spawn` would.

    Jobs and their functions come from importable modules, so that a script needs no guard.
    """
    main = sys.modules["__main__"]
    hidden = {name: vars(main)[name] for name in ("__file__", "__spec__") if name in vars(main)}
    main.__dict__.update({"__spec__": None})
    main.__dict__.pop("__file__", None)
    try:
        yield
    finally:
        main.__dict__.update(hidden)
