"""Jobs: one function of many inputs, run one after another or by many workers."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TypeAlias, TypeVar

Job = TypeVar("Job")
Result = TypeVar("Result")

Run: TypeAlias = Callable[[Sequence[Job], Callable[[Job], Result]], Iterable[tuple[Job, Result]]]
"""Runs a function for every job, in whatever order and in however many processes."""


def one_by_one(jobs: Sequence[Job], work: Callable[[Job], Result]) -> Iterator[tuple[Job, Result]]:
    """Yield each job with what `work` makes of it, in this process.

    >>> list(one_by_one([2, 3], lambda job: job**2))
    [(2, 4), (3, 9)]
    """
    for job in jobs:
        yield job, work(job)
