"""Independent jobs in this process, in several, or on a dask cluster; a worker that dies loses no job."""

import logging
import os
import socket
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Any, TypeVar

from monochord.core.errors import DeviceError, InputError, MissingLibraryError
from monochord.core.ownership import scratch_folder
from monochord.core.units import Seconds
from monochord.lab._worker import MAX_DEATHS, ONE_THREAD, call, one_thread_each, pack, shielded, unreadable

Job = TypeVar("Job")
Result = TypeVar("Result")
ANSWER_TIMEOUT: Seconds = 10.0
"""How long a scheduler may take to answer the first call."""


def run_all(
    jobs: Sequence[Job], work: Callable[[Job], Result], *, cluster: str = "", workers: int | None = None
) -> Generator[tuple[Job, Result]]:
    """Run every job and yield it with its result, in the order in which they finish.

    A single job, or a single worker, runs in this process, and so do all jobs where dask is not installed.
    Several workers are processes of this machine, a dask cluster of one thread each; with an address the jobs
    run on that cluster. A job whose worker dies runs again on another: it may be started twice, so a job that
    writes should write to a temporary file and rename it. Each job is yielded exactly once. The first error
    of a job ends the others and is raised here unchanged; closing the iterator ends them too.

    Parameters
    ----------
    jobs
        Arguments, each picklable. A job contains its own seed, so that no result depends on its worker.
    work
        The function of one job, of a module that the workers can import too.
    cluster
        Address of a running dask scheduler, such as ``"tcp://10.0.0.5:8786"``; empty for this machine.
    workers
        Number of processes on this machine; None for one a core.

    Yields
    ------
    tuple
        A job and its result.

    Raises
    ------
    InputError
        If `workers` is below 1, if dask is needed and not installed, or if nothing answers at the address;
        or from a job.
    DeviceError
        If a job's worker died three times, or the cluster went away.

    >>> sorted(result for job, result in run_all([3, 1, 2], float, workers=1))
    [1.0, 2.0, 3.0]
    """
    if workers is not None and workers < 1:
        raise InputError(f"{workers} workers", "1 or more; by default one a core")
    if cluster:
        _require_dask(f"Cluster {cluster}")
        return _on_cluster(jobs, work, cluster)
    if workers is not None and workers > 1 and len(jobs) > 1:
        _require_dask(f"Work by {workers} workers")
    number = min(workers or len(os.sched_getaffinity(0)), len(jobs))
    if number <= 1 or not _has_dask():
        return ((job, work(job)) for job in jobs)
    return _on_this_machine(jobs, work, number)


def _has_dask() -> bool:
    return find_spec("distributed") is not None


def _require_dask(task: str) -> None:
    if not _has_dask():
        raise MissingLibraryError(task, "dask >= 2025.1", "cluster")


def _on_cluster(
    jobs: Sequence[Job], work: Callable[[Job], Result], address: str
) -> Generator[tuple[Job, Result]]:
    """Run the jobs on the cluster whose scheduler is at `address`."""
    with _quiet():
        try:
            _require_listener(address)
            client = _client(address)
        except (OSError, ValueError) as error:
            raise InputError(
                f"cluster {address} (no dask scheduler answers there)",
                "the address of one, such as tcp://10.0.0.5:8786",
                "start it: dask scheduler; dask worker ADDRESS",
            ) from error
        with client:
            yield from _results(client, jobs, work)


def _require_listener(address: str) -> None:
    """Raise `OSError` where nobody listens, since a client that failed logs another error when it ends."""
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
    """Run the jobs in that many processes of this machine, which listen on the loopback interface alone."""
    import dask.config  # noqa: PLC0415
    from distributed import Client  # noqa: PLC0415

    settings = {
        "distributed.nanny.environ": ONE_THREAD,
        "distributed.scheduler.allowed-failures": MAX_DEATHS - 1,
    }
    with (
        _quiet(),
        one_thread_each(),
        dask.config.set(settings),
        scratch_folder() as scratch,
        ExitStack() as stack,
    ):
        try:
            with shielded():
                cluster = stack.enter_context(_local_cluster(workers, scratch))
                client = stack.enter_context(Client(cluster, set_as_default=False))
                stack.callback(_whole_again, client, workers)
            yield from _results(client, jobs, work)
        finally:
            with shielded():
                stack.close()


def _whole_again(client: Any, workers: int) -> None:
    """Wait for a worker that was killed and is being started again, since a cluster cannot end it so."""
    with suppress(TimeoutError):
        client.wait_for_workers(workers, timeout=ANSWER_TIMEOUT)


def _local_cluster(workers: int, scratch: Path) -> Any:
    from distributed import LocalCluster  # noqa: PLC0415

    return LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        # No dashboard; the scheduler's health server takes any port, or two clusters would collide.
        dashboard_address=None,  # pyright: ignore[reportArgumentType]
        scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
        silence_logs=logging.CRITICAL,
        memory_limit=0,  # no limit on a job's memory
        local_directory=str(scratch),
        preload=["monochord.lab._worker"],
    )


def _results(client: Any, jobs: Sequence[Job], work: Callable[[Job], Result]) -> Iterator[tuple[Job, Result]]:
    from distributed import KilledWorker, as_completed  # noqa: PLC0415
    from distributed.client import FutureCancelledError  # noqa: PLC0415

    futures: dict[Any, int] = {
        client.submit(call, pack(work, job), pure=False): number for number, job in enumerate(jobs)
    }
    try:
        for future in as_completed(list(futures), loop=client.loop):
            result = future.result()
            yield jobs[futures.pop(future)], result
    except KilledWorker as error:
        raise DeviceError(f"a job ended its worker {MAX_DEATHS} times: see what it needs") from error
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
    """Keep dask's messages about workers that come and go off standard error."""
    logger = logging.getLogger("distributed")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)
