"""Jobs over processes of this machine with nothing but Python's own library."""

import multiprocessing
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from typing import Any, TypeVar

from monochord.core.errors import DeviceError
from monochord.lab._worker import TRIES, do, one_thread_each, pack, prepare, undisturbed

Job = TypeVar("Job")
Result = TypeVar("Result")


def over_processes(
    jobs: Sequence[Job], work: Callable[[Job], Result], workers: int
) -> Generator[tuple[Job, Result]]:
    """Do the jobs in that many processes; a pool that a dying worker broke is replaced by a new one."""
    left = {number: pack(work, job) for number, job in enumerate(jobs)}
    broken = 0  # pools in a row that broke before any of their jobs was done
    while left:
        with one_thread_each(), _pool(min(workers, len(left)), left) as futures:
            try:
                for future in as_completed(futures):
                    result = future.result()
                    broken = 0
                    del left[futures[future]]
                    yield jobs[futures[future]], result
            except BrokenProcessPool as error:
                broken += 1
                if broken == TRIES:
                    raise DeviceError(f"a job ended its worker {TRIES} times: see what it needs") from error


@contextmanager
def _pool(workers: int, packed: dict[int, bytes]) -> Generator[dict[Future[Any], int]]:
    """Start the jobs; leaving ends the workers at once, whatever they are doing."""
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(workers, multiprocessing.get_context("spawn"), prepare)
    try:
        with undisturbed():
            futures = {pool.submit(do, job): number for number, job in packed.items()}
        yield futures
    finally:
        for process in set(multiprocessing.active_children()) - others:
            process.kill()
        pool.shutdown(cancel_futures=True)
