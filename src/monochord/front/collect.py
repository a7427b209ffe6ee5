"""Simulates the sessions of a plan, like ``monochord collect``."""

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, overload

from monochord.core.config import from_tree, override, to_tree
from monochord.core.errors import InputError
from monochord.core.ownership import sole_use
from monochord.core.progress import progress_bar, shows_progress
from monochord.core.ranges import Count, Seed, checked
from monochord.core.types import Progress
from monochord.core.units import Seconds
from monochord.core.workers import refuse_both
from monochord.lab.assignment import Assignment
from monochord.lab.collection import checksum, chosen, made_folder
from monochord.lab.collection import collect as carry_out
from monochord.lab.offline import CollectedSession, WindowCounts
from monochord.lab.plan import Plan
from monochord.lab.plans import load_plan
from monochord.lab.schedule import schedule


@dataclass(frozen=True, slots=True, kw_only=True)
class CollectedSessions(Sequence[CollectedSession]):
    """The collected sessions of a plan, sorted by name, and their totals.

    `plan` is the plan's name, `seed` the random seed, `out` the folder, and `wall` the working time in s.
    Each session has its `path`, its `seconds` of sound, its `windows` by kind, its `size` in bytes and its
    file's SHA-256, `checksum`.
    """

    plan: str
    seed: int
    out: Path
    wall: Seconds
    sessions: tuple[CollectedSession, ...] = field(repr=False)

    @overload
    def __getitem__(self, index: int) -> CollectedSession: ...
    @overload
    def __getitem__(self, index: slice) -> tuple[CollectedSession, ...]: ...
    def __getitem__(self, index: int | slice) -> CollectedSession | tuple[CollectedSession, ...]:
        return self.sessions[index]

    def __len__(self) -> int:
        return len(self.sessions)

    def __str__(self) -> str:
        return "\n".join(self.lines())

    @property
    def kept(self) -> int:
        """Number of sessions that already existed and were kept."""
        return sum(one.kept for one in self.sessions)

    @property
    def seconds(self) -> Seconds:
        """Total duration of the sound, in s."""
        return sum(one.seconds for one in self.sessions)

    @property
    def windows(self) -> WindowCounts:
        """Windows of 0.1 s by kind, over all sessions."""
        return sum((one.windows for one in self.sessions), WindowCounts())

    @property
    def size(self) -> int:
        """Total size of the files, in bytes."""
        return sum(one.size for one in self.sessions)

    @property
    def checksum(self) -> str:
        """One SHA-256 over the names and checksums of all files."""
        return checksum(self.sessions)

    def tree(self) -> dict[str, Any]:
        """Return the totals and the sessions as plain values for JSON."""
        return {
            "plan": self.plan,
            "seed": self.seed,
            "out": str(self.out),
            "simulated": True,
            "count": len(self),
            "kept": self.kept,
            "seconds": self.seconds,
            "windows": asdict(self.windows),
            "size": self.size,
            "sha256": self.checksum,
            "wall": self.wall,
            "sessions": [_entry(one) for one in self.sessions],
        }

    def lines(self) -> list[str]:
        """Return the sessions and their totals as text lines."""
        windows, count = self.windows, len(self)
        kinds = (
            f"{windows.static} static ({windows.settled} settled), {windows.slip} slipping, "
            f"{windows.clear} without contact, {windows.transition} transitions"
        )
        number = f"{count} session{'' if count == 1 else 's'} ({self.kept} kept)"
        minutes, size = f"{self.seconds / 60:.1f}", self.size / 1e9
        return [
            *map(_line, self.sessions),
            f"{self.plan}, simulated: {number}, {minutes} min, {size:.3f} GB in {self.out}",
            f"windows of 0.1 s: {kinds}",
            f"SHA-256 of all files {self.checksum}",
            f"made in {self.wall:.0f} s, {self.seconds / max(self.wall, 1e-9):.0f} times real time",
        ]


@checked
def collect(
    plan: str | Path | Plan = "quick",
    out: str | Path = "sessions",
    *,
    workers: Count | None = None,
    cluster: str = "",
    seed: Seed = 0,
    only: str = "",
    settings: Sequence[str] = (),
    real_time: bool = False,
    server: str = "",
    progress: Progress | None = None,
) -> CollectedSessions:
    """Simulate the sessions of a plan: a robot touches the virtual sensor while all streams are recorded.

    Existing sessions are kept, so that a call continues an interrupted collection. The files do not depend on
    the number of processes.

    Parameters
    ----------
    plan
        A preset's name, a TOML file, or a plan.
    out
        Folder for the sessions; it is created if missing.
    workers
        Number of worker processes; by default one per core, where that is faster.
    cluster
        Address of a running dask scheduler, to use its workers instead of `workers`.
    seed
        Random seed.
    only
        Name of the one session or group of the plan to collect; by default all.
    settings
        Overrides of the plan, such as ``"sensor=long"``.
    real_time
        Whether to play and record in real time, through JACK, UDP and DDS.
    server
        Name of the JACK server for `real_time`.
    progress
        Called with the progress; by default there is a bar on a terminal and in a notebook.

    Returns
    -------
    CollectedSessions
        A sequence of the sessions, sorted by name, with totals, as input for `build`.

    Raises
    ------
    InputError
        If a plan, name or setting is unknown, the folder is unusable or holds other sessions of the same
        names, or options exclude each other.
    DeviceError
        If a device is missing, with `real_time`.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import monochord as mc
    >>> twin = ["groups=[{name='hold', grid=[2, 1], hold=0.3}]"]
    >>> sessions = mc.collect("quick", mkdtemp(), settings=twin)
    >>> sessions[0].path.name, len(sessions)
    ('hold_000.mcap', 1)
    """
    if isinstance(plan, Plan):
        chosen_plan = from_tree(Plan, override(to_tree(plan), settings), plan.name) if settings else plan
    else:
        chosen_plan = load_plan(str(plan), settings)
    refuse_both(workers, cluster)
    _refuse_both(workers, cluster, server, real_time=real_time)
    folder, start = Path(out), time.monotonic()
    sessions = chosen(chosen_plan, seed=seed, only=only)
    if real_time:
        made = list(_played(sessions, folder, server))
    else:
        with (
            closing(carry_out(sessions, folder, workers=workers, cluster=cluster)) as results,
            progress_bar(progress=progress) as report,
        ):
            quiet = progress is None and not shows_progress()
            made = list(results if quiet else _reported(results, sessions, report))
    made.sort(key=lambda one: one.name)
    return CollectedSessions(
        plan=chosen_plan.name, seed=seed, out=folder, wall=time.monotonic() - start, sessions=tuple(made)
    )


def _refuse_both(workers: int | None, cluster: str, server: str, *, real_time: bool) -> None:
    if server and not real_time:
        raise InputError("--server without --real-time", "both or neither", "add --real-time")
    if real_time and (workers or cluster):
        raise InputError(
            "--real-time with --workers or --cluster", "one of them", "real time uses one process"
        )


def _reported(
    results: Iterator[CollectedSession], sessions: Sequence[Assignment], report: Progress
) -> Iterator[CollectedSession]:
    """Yield the results, and report the simulated seconds of sound."""
    seconds = {session.name: schedule(session).motion.end for session in sessions}
    name, total, done = "s of audio", round(sum(seconds.values())), 0.0
    report(name, 0, total)
    for result in results:
        done += seconds[result.name]
        report(name, round(done), total)
        yield result


def _played(sessions: Sequence[Assignment], out: Path, server: str) -> Iterator[CollectedSession]:
    """Yield the sessions as they are played and recorded in real time, showing the recorder's view."""
    from monochord.capture.recording.view import viewed  # noqa: PLC0415
    from monochord.core.screen import console_of  # noqa: PLC0415
    from monochord.lab.real_time import play  # noqa: PLC0415

    with sole_use(made_folder(out)):
        for session in sessions:
            path = out / f"{session.name}.mcap"
            with viewed(path, console_of(sys.stderr)) as view:
                yield play(session, out, server=server, show=view.show)


def _entry(one: CollectedSession) -> dict[str, Any]:
    entry = {**asdict(one), "path": str(one.path)}
    return {**entry, "sha256": entry.pop("checksum")}


def _line(one: CollectedSession) -> str:
    counts = one.windows
    kinds = f"{counts.static:4} static {counts.slip:4} slip {counts.clear:4} clear"
    kept = "  kept" if one.kept else ""
    size = f"{one.size / 1e6:5.1f} MB"
    return f"  {one.name:<20} {one.seconds:6.1f} s  {kinds}  {size}  {one.checksum[:16]}{kept}"
