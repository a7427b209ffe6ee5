"""Runs a whole plan: its sessions, spread over processes or machines."""

import hashlib
import logging
from collections.abc import Generator, Iterable, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path

from monochord.core.errors import InputError, did_you_mean
from monochord.core.ownership import sole_use
from monochord.core.workers import run_all
from monochord.lab.assignment import Assignment, assignments
from monochord.lab.offline import CollectedSession, make
from monochord.lab.plan import Plan

_log = logging.getLogger("monochord")


def chosen(plan: Plan, *, seed: int = 0, only: str = "") -> list[Assignment]:
    """Return the sessions of a plan, or those of one group or one session by name, if there is one.

    >>> from monochord.lab.plans import load_plan
    >>> [session.name for session in chosen(load_plan("small"), only="slide")]
    ['slide_000']
    """
    if seed < 0:
        raise InputError(f"seed {seed}", "0 or more")
    sessions = assignments(plan, seed)
    if not only:
        return sessions
    matching = [session for session in sessions if only in (session.name, session.group.name)]
    if not matching:
        names = [group.name for group in plan.groups]
        hint = did_you_mean(only, [*names, *(session.name for session in sessions)])
        raise InputError(f"session '{only}' of plan {plan.name}", f"{', '.join(names)}, or NAME_000", hint)
    return matching


def collect(
    sessions: Iterable[Assignment], folder: Path, *, workers: int | None = None, cluster: str = ""
) -> Generator[CollectedSession]:
    """Simulate sessions, and yield each result as it finishes.

    Existing sessions are kept. Files do not depend on the number of workers.

    Parameters
    ----------
    sessions
        The sessions, all of one plan.
    folder
        Output folder, created if missing. Workers on other machines must see it under the same path.
    workers, cluster
        As in `monochord.core.workers.run_all`.

    Raises
    ------
    InputError
        If the folder cannot be created, another collection is writing to it, or it contains different
        sessions of the same names.
    """
    folder = made_folder(folder.resolve())
    return _collect(folder, list(sessions), workers, cluster)


def made_folder(folder: Path) -> Path:
    """Create a folder unless it exists, and return it.

    Raises `InputError` where a file of that name exists.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise InputError(f"folder '{folder}' (a file)", "a folder, or a free name") from error
    return folder


def _collect(
    folder: Path, sessions: Sequence[Assignment], workers: int | None, cluster: str
) -> Generator[CollectedSession]:
    with sole_use(folder):
        count = _remove_unfinished(folder, sessions)
        if count:
            _log.warning(
                "monochord: removed %d unfinished files in %s, left by a run that was killed", count, folder
            )
        try:
            results = run_all(sessions, partial(make, folder=folder), cluster=cluster, workers=workers)
            with closing(results):
                for _, result in results:
                    yield result
        finally:
            _remove_unfinished(folder, sessions)  # of workers that were ended during their work


def _remove_unfinished(folder: Path, sessions: Sequence[Assignment]) -> int:
    """Remove unfinished session files left by workers; return their number."""
    names = {session.name for session in sessions}
    parts = [file for file in folder.glob("*.mcap.part-*") if file.name.partition(".mcap.part-")[0] in names]
    for file in parts:
        file.unlink(missing_ok=True)
    return len(parts)


def checksum(results: Iterable[CollectedSession]) -> str:
    """Return one SHA-256 over the names and checksums of all sessions, independent of their order."""
    lines = sorted(f"{result.name} {result.checksum}\n" for result in results)
    return hashlib.sha256("".join(lines).encode()).hexdigest()
