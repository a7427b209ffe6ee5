"""What a worker process does before and around its jobs. Dask loads this module into its workers by name."""

import os
import pickle
import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from multiprocessing import parent_process, resource_tracker
from typing import Any

from monochord.core.errors import DeviceError
from monochord.core.interruption import interruption

TRIES = 3
"""Workers that may die over one job before it counts as hopeless."""
_BLAS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
ALONE = {"NUMBA_NUM_THREADS": "1"}
"""Settings of a worker for what reads them late; one thread each, since there is a worker a core."""


def pack(work: Any, job: Any) -> bytes:
    """Return a job and what does it as bytes, which no scheduler looks into."""
    return pickle.dumps((work, job))


def do(packed: bytes) -> Any:
    """Do a packed job; raises `DeviceError` where this worker lacks its module."""
    try:
        work, job = pickle.loads(packed)  # noqa: S301  (from the process that started this one)
    except (ImportError, AttributeError) as error:
        raise DeviceError(unreadable(error)) from error
    return work(job)


def unreadable(error: BaseException) -> str:
    """Return what to say of a worker that lacks what its job needs."""
    return f"a worker cannot read its job ({error}): install the same code there"


def dask_setup(worker: Any) -> None:  # noqa: ARG001
    """Prepare a dask worker; dask calls this as the worker starts."""
    prepare()


def prepare() -> None:
    """Leave Control-C to the parent, which ends its workers; end with it, however it ends."""
    os.environ.update(ALONE)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()


def _end_with(parent: Any) -> None:
    parent.join()
    os._exit(1)


@contextmanager
def undisturbed() -> Generator[None]:
    """Start or end workers with Control-C held back until that is done; workers started inside never see it.

    A terminal sends it to them too, and until they are ready to ignore it, they would end with a traceback.
    """
    resource_tracker.ensure_running()  # which would lift the mask in the thread that starts it
    with interruption() as stop:
        before = signal.pthread_sigmask(
            signal.SIG_BLOCK, {signal.SIGINT}
        )  # a new process or thread has it too
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
    if stop.requested:
        raise KeyboardInterrupt


@contextmanager
def one_thread_each() -> Generator[None]:
    """Hand on to workers started inside that linear algebra runs on one thread; restore the environment."""
    before = dict(os.environ)
    os.environ.update(dict.fromkeys(_BLAS, "1"))
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
