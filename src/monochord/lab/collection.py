"""A whole plan carried out: its sessions spread over processes or machines, and what came of them."""

import hashlib
import logging
from collections.abc import Generator, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from monochord.core.errors import InputError, did_you_mean
from monochord.core.ownership import sole_use
from monochord.lab.bench import Outcome, make
from monochord.lab.fleet import run_all
from monochord.lab.plan import Assignment, Plan, assignments

_log = logging.getLogger("monochord")


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A session to make, and the folder for it."""

    session: Assignment
    folder: Path


def chosen(plan: Plan, *, seed: int = 0, only: str = "") -> list[Assignment]:
    """Return the sessions of a plan, or those of one name: a group's or a session's own.

    Raises
    ------
    InputError
        If the plan has none of this name, or the seed is negative.

    Examples
    --------
    >>> from monochord.lab.plans import load_plan
    >>> [session.name for session in chosen(load_plan("small"), only="slide")]
    ['slide_000']
    """
    if seed < 0:
        raise InputError(f"seed {seed}", "0 or more")
    found = assignments(plan, seed)
    if not only:
        return found
    picked = [session for session in found if only in (session.name, session.group.name)]
    if not picked:
        names = [group.name for group in plan.groups]
        hint = did_you_mean(only, [*names, *(session.name for session in found)])
        raise InputError(f"session '{only}' of plan {plan.name}", f"{', '.join(names)}, or NAME_000", hint)
    return picked


def collect(
    sessions: Iterable[Assignment], folder: Path, *, workers: int | None = None, cluster: str = ""
) -> Generator[Outcome]:
    """Make sessions, and yield what became of each in the order in which they finish.

    Those that are there already are kept. Files do not depend on how many make them.

    Parameters
    ----------
    sessions
        What to make, of one plan.
    folder
        Where; it is made if it is not there. Workers on other machines must see it under the same name.
    workers, cluster
        As `monochord.lab.fleet.run_all` takes them.

    Raises
    ------
    InputError
        If the folder cannot be made, another collection is writing to it, or it holds other sessions of the
        same names.
    """
    folder = made_folder(folder.resolve())
    tasks = [Task(session=session, folder=folder) for session in sessions]
    return _outcomes(folder, tasks, workers, cluster)


def made_folder(folder: Path) -> Path:
    """Make a folder unless it is there, and return it; raises `InputError` where a file is in the way."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise InputError(f"folder '{folder}' (a file)", "a folder, or a name that is free") from error
    return folder


def _outcomes(folder: Path, tasks: Sequence[Task], workers: int | None, cluster: str) -> Generator[Outcome]:
    with sole_use(folder):
        left = _remove_unfinished(folder, tasks)
        if left:
            _log.warning(
                "monochord: removed %d unfinished files in %s, left by a run that was killed", left, folder
            )
        try:
            with closing(run_all(tasks, work, cluster=cluster, workers=workers)) as outcomes:
                for _, outcome in outcomes:
                    yield outcome
        finally:
            _remove_unfinished(folder, tasks)  # of workers that were ended within their work


def _remove_unfinished(folder: Path, tasks: Sequence[Task]) -> int:
    """Remove what workers that ended have begun of the tasks' files; return how many there were."""
    names = {task.session.name for task in tasks}
    found = [file for file in folder.glob("*.mcap.part-*") if file.name.partition(".mcap.part-")[0] in names]
    for file in found:
        file.unlink(missing_ok=True)
    return len(found)


def work(task: Task) -> Outcome:
    """Do one task: what a worker runs."""
    return make(task.session, task.folder)


def checksum(outcomes: Iterable[Outcome]) -> str:
    """Return one SHA-256 over the names and checksums of all, whatever order they finished in."""
    lines = sorted(f"{outcome.name} {outcome.checksum}\n" for outcome in outcomes)
    return hashlib.sha256("".join(lines).encode()).hexdigest()
