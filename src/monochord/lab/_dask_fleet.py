"""Jobs over the workers of a dask cluster: one of this machine's processes, or one that runs somewhere."""

import logging
import socket
import warnings
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TypeVar

import dask.config
from distributed import Client, KilledWorker, LocalCluster, as_completed
from distributed.client import FutureCancelledError
from distributed.versions import VersionMismatchWarning

from monochord.core.errors import DeviceError, InputError
from monochord.core.ownership import scratch_folder
from monochord.core.units import Seconds
from monochord.lab._worker import ALONE, TRIES, do, one_thread_each, pack, undisturbed, unreadable

Job = TypeVar("Job")
Result = TypeVar("Result")
ANSWER_WITHIN: Seconds = 10.0
"""How long a scheduler may take to answer the first call."""


def on_cluster(
    jobs: Sequence[Job], work: Callable[[Job], Result], address: str
) -> Generator[tuple[Job, Result]]:
    """Do the jobs on the cluster whose scheduler is at `address`."""
    with _quiet():
        try:
            _answers(address)
            client = _client(address)
        except (OSError, ValueError) as error:
            raise InputError(
                f"cluster {address} (no dask scheduler answers there)",
                "the address of one, such as tcp://10.0.0.5:8786",
                "start it: dask scheduler; dask worker ADDRESS",
            ) from error
        with client:
            yield from _results(client, jobs, work)


def on_this_machine(
    jobs: Sequence[Job], work: Callable[[Job], Result], workers: int
) -> Generator[tuple[Job, Result]]:
    """Do the jobs in that many processes of this machine, which listen on loopback alone."""
    settings = {"distributed.nanny.environ": ALONE, "distributed.scheduler.allowed-failures": TRIES - 1}
    with (
        _quiet(),
        one_thread_each(),
        dask.config.set(settings),
        scratch_folder() as scratch,
        _local(workers, scratch) as client,
    ):
        yield from _results(client, jobs, work)


def _answers(address: str) -> None:
    """Raise `OSError` where nobody listens, since a client that failed complains once more as it goes."""
    place = address.rpartition("://")[2]
    host, _, port = place.rpartition(":")
    with socket.create_connection((host.strip("[]"), int(port)), timeout=ANSWER_WITHIN):
        pass


def _client(address: str) -> Any:
    with warnings.catch_warnings():
        # Other versions there are no harm by themselves; what they cannot read is an error of its own.
        warnings.simplefilter("ignore", VersionMismatchWarning)
        return Client(address, timeout=ANSWER_WITHIN, set_as_default=False)


@contextmanager
def _local(workers: int, scratch: Path) -> Generator[Any]:
    """Give the client of a cluster of this machine's processes."""
    with ExitStack() as stack:
        try:
            with undisturbed():
                cluster = stack.enter_context(_cluster(workers, scratch))
                client = stack.enter_context(Client(cluster, set_as_default=False))
            yield client
        finally:
            with undisturbed():
                stack.close()


def _cluster(workers: int, scratch: Path) -> LocalCluster:
    return LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        host="127.0.0.1",
        # No dashboard; what answers for the scheduler's health takes any port, or two clusters would meet.
        dashboard_address=None,  # pyright: ignore[reportArgumentType]
        scheduler_kwargs={"dashboard": False, "dashboard_address": "127.0.0.1:0"},
        silence_logs=logging.CRITICAL,
        memory_limit=0,  # a job's memory is its own business
        local_directory=str(scratch),
        preload=["monochord.lab._worker"],
    )


def _results(client: Any, jobs: Sequence[Job], work: Callable[[Job], Result]) -> Iterator[tuple[Job, Result]]:
    futures: dict[Any, int] = {
        client.submit(do, pack(work, job), pure=False): number for number, job in enumerate(jobs)
    }
    try:
        for future in as_completed(list(futures), loop=client.loop):
            result = future.result()
            yield jobs[futures.pop(future)], result
    except KilledWorker as error:
        raise DeviceError(f"a job ended its worker {TRIES} times: see what it needs") from error
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
    """Keep what dask tells of workers that come and go off standard error."""
    logger = logging.getLogger("distributed")
    before = logger.level
    logger.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        logger.setLevel(before)
