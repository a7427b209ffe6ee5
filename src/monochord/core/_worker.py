"""A worker process, before and around its jobs."""

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
"""Number of workers that may die during one job before the job is given up."""
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Environment of a worker: one thread each, since every core has a worker."""


_last = threading.local()
"""The function of the last job of each thread, as bytes and unpacked, with what it has loaded."""


def pack(value: Any) -> bytes:
    """Return a job, or its function, as bytes, which no scheduler tries to read."""
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
    """Run a packed job in the folder of the program that sent it, by which relative paths go."""
    with suppress(OSError):
        os.chdir(folder)
    return call(work, job)


def unreadable(error: BaseException) -> str:
    """Return the message about a worker that lacks a module of its job."""
    return f"a worker cannot read its job ({error}): install the same code there"


def prepare() -> None:
    """Prepare a worker as it starts.

    Control-C is left to the parent, which ends its workers; a worker ends with its parent, however that ends.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)


@contextmanager
def shielded() -> Generator[None]:
    """Hold Control-C back while workers start or end; workers that start inside never receive it.

    A terminal sends it to them too, and until they ignore it they would end with a traceback.
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
    """Have workers that start inside run on one thread; restore the environment after."""
    before = dict(os.environ)
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


@contextmanager
def without_main() -> Generator[None]:
    """Keep workers that start inside from running the program's own script again, as `spawn` has them do.

    Jobs and their functions are of modules that can be imported, so that a script needs no guard.
    """
    main = sys.modules["__main__"]
    hidden = {name: vars(main)[name] for name in ("__file__", "__spec__") if name in vars(main)}
    main.__dict__.update({"__spec__": None})
    main.__dict__.pop("__file__", None)
    try:
        yield
    finally:
        main.__dict__.update(hidden)
