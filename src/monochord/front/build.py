"""Builds a dataset with labels from sessions, split and audited, like ``monochord build``."""

import logging
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from sys import intern
from typing import NamedTuple, TypeAlias

from monochord.core.errors import InputError
from monochord.core.progress import progress_bar
from monochord.core.ranges import Count, Seed, checked
from monochord.core.types import Progress
from monochord.core.units import Seconds
from monochord.core.workers import refuse_both
from monochord.datasets.audit import Audit, audit
from monochord.datasets.build import (
    BuildOptions,
    Labelling,
    Stretch,
    build_dataset,
    find_sessions,
    named_sessions,
)
from monochord.datasets.split import (
    PARTS,
    SPLIT_FILE,
    Split,
    refuse_impossible,
    refuse_too_few,
    split_dataset,
)
from monochord.datasets.store import Dataset
from monochord.lab.offline import CollectedSession
from monochord.perception.data import LabelledData
from monochord.perception.tuning.sessions import estimate_tension
from monochord.sessions import read_session

Sessions: TypeAlias = str | Path | CollectedSession | Iterable[str | Path | CollectedSession]
"""Session files, folders (searched recursively), patterns, or the result of `collect`; one or several."""
_log = logging.getLogger("monochord")


@checked
def build(
    sessions: Sessions,
    out: str | Path = "dataset",
    *,
    window: Stretch = 0.1,
    hop: Stretch = 0.1,
    labels: Labelling | None = None,
    split: str | None = None,
    held_out: Sequence[str] = (),
    seed: Seed = 0,
    force: bool = False,
    sensor: str | Path | None = None,
    skip: bool = False,
    workers: Count | None = None,
    cluster: str = "",
    progress: Progress | None = None,
) -> LabelledData:
    """Build a dataset from sessions: windows with labels, split, and audited for leaks.

    Equal sessions and options give equal bytes, for any number of processes. The string's tuning comes from
    the session, else from `sensor`, else from the untouched beginning of the recording. Sessions of several
    sample rates are resampled to the lowest of them.

    Parameters
    ----------
    sessions
        Session files, folders, patterns, or the result of `collect`.
    out
        New folder for the dataset.
    window
        Length of a window, in s.
    hop
        Time from one window to the next, in s.
    labels
        Labels to use: ``"recorded"`` in the session, or ``"measured"``, derived from force and pose; by
        default recorded, if any.
    split
        Split by ``"session"``, ``"object"``, ``"time"``, ``"day"`` or ``"build"``; by default session, or
        time below 3 sessions.
    held_out
        Keep an object, or sessions by a pattern such as ``'music*'``, for the test only.
    seed
        Random seed of the split.
    force
        Whether to accept sessions whose streams are not on one clock.
    sensor
        A sensor preset, or a tuned sensor's file.
    skip
        Whether to skip sessions that cannot be used; the result's manifest names them.
    workers, cluster
        Worker processes, or the address of a dask scheduler.
    progress
        Called with the progress; by default there is a bar on a terminal and in a notebook.

    Returns
    -------
    LabelledData
        The dataset on disk, with `split`, `audit` and `manifest`, as input for `train` and `evaluate`.

    Raises
    ------
    InputError
        If `out` exists, a session is unusable, or the split is impossible or leaks.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import monochord as mc
    >>> folder, twin = mkdtemp(), ["groups=[{name='hold', grid=[2, 1], hold=0.3}]"]
    >>> sessions = mc.collect("quick", folder, settings=twin)
    >>> data = mc.build(sessions, f"{folder}/dataset")
    >>> data.split.by, data.audit.clean, data.manifest.simulated
    ('time', True, True)
    """
    data = built(
        sessions,
        out,
        window=window,
        hop=hop,
        labels=labels,
        split=split,
        held_out=held_out,
        seed=seed,
        force=force,
        sensor=sensor,
        skip=skip,
        workers=workers,
        cluster=cluster,
        progress=progress,
    )
    data.refuse_leaks()
    return data


def built(
    sessions: Sessions,
    out: str | Path,
    *,
    window: Seconds,
    hop: Seconds,
    labels: Labelling | None,
    split: str | None,
    held_out: Sequence[str],
    seed: int,
    force: bool,
    sensor: str | Path | None,
    skip: bool,
    workers: int | None,
    cluster: str,
    progress: Progress | None = None,
    note: Callable[[str], None] = lambda line: _log.warning("monochord: %s", line),
) -> LabelledData:
    """Return the dataset of `build` with its audit, even with leaks.

    `note` receives a line for each session that is left out or resampled.
    """
    refuse_both(workers, cluster)
    folder, files = Path(out), find_sessions(session_names(sessions))
    held_out = tuple(held_out)
    overview = _overview(files)
    _refuse_split(split or _default_split(len(files)), overview, held_out)
    rate = min(overview.rates, default=None)
    for name, session_rate in zip(overview.names, overview.rates, strict=True):
        if session_rate != rate:
            note(f"resampled: session {name}, {session_rate} to {rate} Hz, the lowest rate of all")
    options = BuildOptions(
        window=window,
        hop=hop,
        labels=labels or "",
        force=force,
        skip=skip,
        sensor=str(sensor or ""),
        sample_rate=rate,
    )
    ended: list[tuple[Split, Audit] | InputError] = []

    def finish(dataset: Dataset) -> None:
        by = split or _default_split(len(dataset.manifest.parts))
        try:
            made = split_dataset(dataset, by=by, seed=seed, held_out=held_out)
        except InputError as error:  # the dataset is kept: building it took the time
            remedy = f"{error.remedy}; {out} stands without a split".removeprefix("; ")
            ended.append(InputError(error.given, error.expected, remedy))
        else:
            made.write(dataset.path / SPLIT_FILE)
            ended.append((made, audit(dataset, made)))

    with progress_bar(progress=progress) as report:
        dataset = build_dataset(
            files, folder, options, report, estimate_tension, finish=finish, workers=workers, cluster=cluster
        )
    for line in dataset.manifest.refused.values():
        note(f"left out: {line}")
    (end,) = ended
    if isinstance(end, InputError):
        raise end
    made, leaks = end
    return LabelledData(dataset=dataset, split=made, audit=leaks, split_file=dataset.path / SPLIT_FILE)


def session_names(sessions: Sessions) -> list[str]:
    """Return session files, folders and patterns as text.

    >>> session_names([Path("take.mcap"), "monday/*.mcap"])
    ['take.mcap', 'monday/*.mcap']
    """
    one = isinstance(sessions, str | Path | CollectedSession)
    each = [sessions] if one else list(sessions)
    return [str(item.path if isinstance(item, CollectedSession) else item) for item in each]


def _default_split(count: int) -> str:
    """Return the default split strategy for a number of sessions."""
    return "session" if count >= len(PARTS) else "time"


class _Overview(NamedTuple):
    """Of each session that can be read its name, object, day, build and sample rate in Hz."""

    names: list[str]
    objects: list[str]
    days: list[int | None]
    builds: list[int | None]
    rates: list[int]


def _overview(files: Sequence[Path]) -> _Overview:
    """Return what the split and the sample rate depend on, in little memory."""
    overview = _Overview([], [], [], [], [])
    for name, file in named_sessions(files).items():
        with suppress(InputError):  # refused when it is built
            about = read_session(file).description
            overview.names.append(name)
            overview.objects.append(intern(about.material or about.object))
            overview.days.append(about.day)
            overview.builds.append(about.build)
            overview.rates.append(about.sample_rate)
    return overview


def _refuse_split(by: str, overview: _Overview, held_out: Sequence[str]) -> None:
    """Raise `InputError` for an impossible split before anything is built."""
    refuse_impossible(by, held_out=held_out)
    if overview.names:
        refuse_too_few(by, overview.objects, overview.days, held_out, overview.names, overview.builds)
