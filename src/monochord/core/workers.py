"""Runs independent jobs in this process, in several, or on a dask cluster; a dead worker loses no job.

A `Spread` is where jobs run and who hears of their progress, to hand on as one argument. A `Worker` is one
process for the jobs of a program that goes on meanwhile.
"""

import logging
import multiprocessing
import socket
import warnings
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Generic, TypeVar

from monochord.core._worker import (
    MAX_DEATHS,
    call,
    call_in,
    one_thread_each,
    pack,
    prepare,
    shielded,
    unreadable,
    without_main,
)
from monochord.core.cores import available_cores
from monochord.core.errors import DeviceError, InputError, MissingLibraryError
from monochord.core.types import Progress
from monochord.core.units import Seconds

Job = TypeVar("Job")
Result = TypeVar("Result")
ANSWER_TIMEOUT: Seconds = 10.0
"""Timeout of a scheduler's first answer, in s."""


def refuse_both(workers: int | None, cluster: str) -> None:
    """Raise `InputError` for a number of workers together with a cluster, which has its own workers."""
    if workers and cluster:
        raise InputError(
            "workers with a cluster", "one of both", "leave workers out: a cluster has its own workers"
        )


def run_all(
    jobs: Sequence[Job], work: Callable[[Job], Result], *, cluster: str = "", workers: int | None = None
) -> Generator[tuple[Job, Result]]:
    """Run every job, and yield it with its result in order of completion.

    A single job, or a single worker, runs in this process. Several workers are processes of this machine,
    with one thread each; with an address, jobs run on a dask cluster, in this process's working folder. A job
    whose worker dies runs again on another worker: since it may start twice, a job that writes should write
    to a temporary file and rename it. Each job is yielded exactly once. The first error of a job ends the
    others and is raised here unchanged; closing the iterator also ends them.

    Parameters
    ----------
    jobs
        Arguments, each picklable. A job includes its random seed, so that results do not depend on the
        worker.
    work
        The function of one job, from a module that workers can import. A worker unpickles it once for all its
        jobs: bind shared data to it, as with `functools.partial`.
    cluster
        Address of a running dask scheduler, such as ``"tcp://10.0.0.5:8786"``; empty for this machine.
    workers
        Number of processes on this machine; by default one per core that this process may use, or none inside
        a job.

    Yields
    ------
    tuple
        A job and its result.

    Raises
    ------
    InputError
        If `workers` is below 1, a cluster is named without dask installed, or no scheduler answers at its
        address; or from a job.
    DeviceError
        If a job's worker died three times, or the cluster was lost.

    >>> sorted(result for job, result in run_all([3, 1, 2], float, workers=1))
    [1.0, 2.0, 3.0]
    """
    if workers is not None and workers < 1:
        raise InputError(f"{workers} workers", "1 or more; by default one per core")
    if cluster:
        _require_dask(f"Cluster {cluster}")
        return _on_cluster(jobs, work, cluster)
    cores = 1 if multiprocessing.parent_process() else available_cores()
    number = min(workers or cores, len(jobs))
    if number <= 1:
        return ((job, work(job)) for job in jobs)
    return _on_this_machine(jobs, work, number)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Where independent jobs run, as in `run_all`; `progress` gets a job's name, how many are done, and all.

    >>> spread = Spread(workers=1, progress=print)
    >>> dict(spread({3: "three", 1: "one"}, float))
    three 0 2
    one 1 2
     2 2
    {3: 3.0, 1: 1.0}
    """

    workers: int | None = None
    cluster: str = ""
    progress: Progress = lambda *_: None

    def __call__(
        self, jobs: Mapping[Job, str], work: Callable[[Job], Result], *, few: bool = False
    ) -> Generator[tuple[Job, Result]]:
        """Run jobs, given with their names, as `run_all` does; report progress before each and at the end.

        `few` jobs run in this process, unless workers or a cluster are named.
        """
        names, workers = [*jobs.values(), ""], self.workers or (1 if few else None)
        self.progress(names[0], 0, len(jobs))
        results = run_all(list(jobs), work, workers=workers, cluster=self.cluster)
        for done, result in enumerate(results, start=1):
            self.progress(names[done], done, len(jobs))
            yield result


ALL_CORES, ONE_PROCESS = Spread(), Spread(workers=1)


class Worker(Generic[Job, Result]):
    """One process for jobs that this one does not wait for: it starts with the first, and again if it died.

    `work` is the function of one job, from a module that the process can import; `niceness` is how far below
    this process it stands for the system's scheduler.

    >>> worker = Worker(float)
    >>> worker.submit(3).result(), worker.submit(4).result()
    (3.0, 4.0)
    >>> worker.end()
    """

    def __init__(self, work: Callable[[Job], Result], *, niceness: int = 0) -> None:
        self._work, self._niceness = pack(work), niceness
        self._pool: ProcessPoolExecutor | None = None

    def submit(self, job: Job) -> Future[Result]:
        """Return the result to come; it raises `BrokenProcessPool` if the process dies meanwhile."""
        if self._pool is not None:
            try:
                return self._pool.submit(call, self._work, pack(job))
            except BrokenProcessPool:  # it died between two jobs
                self.end()
        context = multiprocessing.get_context("spawn")
        self._pool = ProcessPoolExecutor(1, context, initializer=prepare, initargs=(self._niceness,))
        with shielded(), without_main():
            return self._pool.submit(call, self._work, pack(job))

    def end(self) -> None:
        """End the process, whatever it does."""
        pool, self._pool = self._pool, None
        if pool is not None:
            _end(pool)


def _require_dask(task: str) -> None:
    if find_spec("distributed") is None:
        raise MissingLibraryError(task, "dask >= 2025.1", "cluster")


def _on_cluster(
    jobs: Sequence[Job], work: Callable[[Job], Result], address: str
) -> Generator[tuple[Job, Result]]:
    """Run the jobs on the cluster with the scheduler at `address`."""
    with _quiet():
        try:
            _require_listener(address)
            client = _client(address)
        except (OSError, ValueError) as error:
            raise InputError(
                f"cluster {address} (no dask scheduler answers there)",
                "the address of a running scheduler, such as tcp://10.0.0.5:8786",
                "start it: dask scheduler; dask worker ADDRESS",
            ) from error
        with client:
            yield from _results(client, jobs, work)


def _require_listener(address: str) -> None:
    """Raise `OSError` where no scheduler listens, since a failed client logs another error when it ends."""
    host, _, port = address.rpartition("://")[2].rpartition(":")
    with socket.create_connection((host.strip("[]"), int(port)), timeout=ANSWER_TIMEOUT):
        pass


def _client(address: str) -> Any:
    from distributed import Client  # noqa: PLC0415  (dask is slow to load)
    from distributed.versions import VersionMismatchWarning  # noqa: PLC0415

    with warnings.catch_warnings():
        # Other versions do no harm by themselves; a job that they cannot read raises an error of its own.
        warnings.simplefilter("ignore", VersionMismatchWarning)
        return Client(address, timeout=ANSWER_TIMEOUT, set_as_default=False)


def _on_this_machine(
    jobs: Sequence[Job], work: Callable[[Job], Result], workers: int
) -> Generator[tuple[Job, Result]]:
    """Run the jobs in a number of local processes; jobs of a dead worker run again."""
    left = dict(enumerate(jobs))
    for _ in range(MAX_DEATHS):
        with suppress(BrokenProcessPool), _pool(left, work, workers) as futures:
            for future in as_completed(futures):
                result = future.result()
                number = futures[future]
                yield left.pop(number), result
            return
    raise DeviceError(f"a job ended its worker {MAX_DEATHS} times: check its memory use")


@contextmanager
def _pool(
    jobs: Mapping[int, Job], work: Callable[[Job], Result], workers: int
) -> Generator[dict[Future[Result], int]]:
    """Yield the futures of jobs with their numbers, and end the processes afterwards."""
    number = min(workers, len(jobs))
    with shielded():
        pool = ProcessPoolExecutor(number, multiprocessing.get_context("spawn"), initializer=prepare)
    try:
        with shielded(), one_thread_each(), without_main():
            packed = pack(work)
            futures = {pool.submit(call, packed, pack(job)): number for number, job in jobs.items()}
        yield futures
    finally:
        _end(pool)


def _end(pool: ProcessPoolExecutor) -> None:
    """End the processes of a pool, whatever they do."""
    with shielded():
        processes = list((pool._processes or {}).values())  # noqa: SLF001  (no other way to end one)
        manager: Any = pool._executor_manager_thread  # noqa: SLF001  (shutdown forgets it)
        pool.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.kill()
        for process in processes:
            process.join()
        if manager is not None:
            manager.join()


def _results(client: Any, jobs: Sequence[Job], work: Callable[[Job], Result]) -> Iterator[tuple[Job, Result]]:
    from distributed import KilledWorker  # noqa: PLC0415
    from distributed import as_completed as finished  # noqa: PLC0415
    from distributed.client import FutureCancelledError  # noqa: PLC0415

    here, packed = str(Path.cwd()), pack(work)
    futures: dict[Any, int] = {
        client.submit(call_in, here, packed, pack(job), pure=False): number for number, job in enumerate(jobs)
    }
    try:
        for future in finished(list(futures), loop=client.loop):
            result = future.result()
            yield jobs[futures.pop(future)], result
    except KilledWorker as error:
        raise DeviceError(f"a job ended its worker {MAX_DEATHS} times: check its memory use") from error
    except FutureCancelledError as error:
        raise DeviceError("the cluster went away before all jobs were done: start it again") from error
    except RuntimeError as error:
        if isinstance(error.__cause__, (ImportError, AttributeError)):
            raise DeviceError(unreadable(error.__cause__)) from error
        raise
    finally:
        client.cancel(list(futures), force=True)


@contextmanager
def _quiet() -> Generator[None]:
    """Suppress dask's messages about workers that join and leave."""
    logger = logging.getLogger("distributed")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)
