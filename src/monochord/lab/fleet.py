"""Many jobs that do not depend on each other, over processes or machines; a worker that dies loses none."""

import os
from collections.abc import Callable, Generator, Sequence
from importlib.util import find_spec
from typing import TypeVar

from monochord.core.errors import InputError

Job = TypeVar("Job")
Result = TypeVar("Result")


def run_all(
    jobs: Sequence[Job], work: Callable[[Job], Result], *, cluster: str = "", workers: int | None = None
) -> Generator[tuple[Job, Result]]:
    """Do every job and yield it with its result, in the order in which they finish.

    One job, or one worker, runs in this process. More run in processes of this machine: as a dask cluster of
    one thread each where the extra ``cluster`` is installed, by `concurrent.futures` where it is not. With an
    address they run on that cluster. A job whose worker dies is done again by another: it may be begun twice,
    so a job that writes should write aside and rename. Each job is yielded exactly once. The first error of a
    job ends the rest and is raised here as it was raised there; so does closing the iterator.

    Parameters
    ----------
    jobs
        What to do, each picklable. A job holds its own seed, so that no result depends on who does it.
    work
        What does one job: a function of a module that the workers can import too.
    cluster
        Address of a running dask scheduler, such as ``"tcp://10.0.0.5:8786"``; empty for this machine.
    workers
        How many processes on this machine; None for one a core.

    Yields
    ------
    tuple
        A job as it was given and its result.

    Raises
    ------
    InputError
        If `workers` is below 1, if dask is not installed or nothing answers at the address; or from a job.
    DeviceError
        If a job's worker died three times over it, or the cluster went away.

    >>> sorted(result for job, result in run_all([3, 1, 2], float, workers=1))
    [1.0, 2.0, 3.0]
    """
    if workers is not None and workers < 1:
        raise InputError(f"{workers} workers", "1 or more, or none named for one a core")
    if cluster:
        _refuse_without_dask(cluster)
        from monochord.lab._dask_fleet import on_cluster  # noqa: PLC0415  (dask is slow to load)

        return on_cluster(jobs, work, cluster)
    number = min(workers or len(os.sched_getaffinity(0)), len(jobs))
    if number <= 1:
        return ((job, work(job)) for job in jobs)
    if _has_dask():
        from monochord.lab._dask_fleet import on_this_machine  # noqa: PLC0415

        return on_this_machine(jobs, work, number)
    from monochord.lab._process_fleet import over_processes  # noqa: PLC0415

    return over_processes(jobs, work, number)


def _has_dask() -> bool:
    return find_spec("distributed") is not None


def _refuse_without_dask(cluster: str) -> None:
    if not _has_dask():
        raise InputError(
            f"cluster {cluster} (dask is not installed)",
            "this machine alone",
            "pip install 'monochord[cluster]', or leave the cluster out",
        )
