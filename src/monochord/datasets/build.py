"""Sessions into a dataset, one at a time or several side by side."""

import hashlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from glob import glob
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from monochord.core import labels as label_rules
from monochord.core.errors import InputError
from monochord.core.labels import LabelColumns, Rules, window_labels
from monochord.core.ownership import part_folder
from monochord.core.ranges import Checked
from monochord.core.types import Audio, Progress, StringParams
from monochord.core.units import Newtons, Samples, Seconds
from monochord.core.workers import run_all
from monochord.datasets.checksums import FileSums, file_sums
from monochord.datasets.kinds import counts_of, kinds_of
from monochord.datasets.manifest import TABLE, Manifest, Part, audio_name, file_checksum
from monochord.datasets.measured import Thresholds
from monochord.datasets.store import (
    Dataset,
    Flags,
    Indices,
    open_dataset,
    window_starts,
    write_array,
    write_table,
)
from monochord.datasets.truth import SessionTruth, truth_of
from monochord.physics.sensors import load_sensor
from monochord.sessions import TUNING, AudioTrack, SessionReader, read_session
from monochord.sessions.alignment import AUDIO

MANY = 16
"""Sessions from which on several processes are worth their start."""
FULL_SCALE = 1.0 - 2.0**-15
"""A sample of this amount or more is clipped: the greatest that a converter of 16 bits gives."""
Labelling: TypeAlias = Literal["", "recorded", "measured"]
Listen: TypeAlias = Callable[[Audio, int, StringParams | None, Newtons | None], Newtons | None]
"""Gives the tension of a session's string from sound (channels, n), its rate, its string and the tension that
was recorded; None where none is known.

The string is None for a session that names none, the tension for one that was recorded without a tuning."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildOptions(Checked):
    """How sessions become a dataset.

    Parameters
    ----------
    window, hop
        Length and distance of windows in s.
    labels
        "recorded" takes the labels of the session, "measured" those that wrench and pose give; left empty,
        the recorded ones where a session has any.
    force
        Whether to take a session that its alignment warns of, or that is damaged.
    skip
        Whether to leave out a session that cannot be used, rather than to build nothing.
    rules
        What the label of a window is.
    thresholds
        What counts as contact and as sliding, for measured labels.
    sensor
        The sensor as tuned, a preset or a file of ``monochord tune``, of sessions recorded without a tuning.
    """

    window: Annotated[Seconds, Meta(ge=1e-3, le=60.0)] = 0.1
    hop: Annotated[Seconds, Meta(ge=1e-3, le=60.0)] = 0.1
    labels: Labelling = ""
    force: bool = False
    skip: bool = False
    rules: Rules = field(default_factory=Rules)
    thresholds: Thresholds = field(default_factory=Thresholds)
    sensor: str = ""

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.sensor:
            load_sensor(self.sensor)


DEFAULT_OPTIONS = BuildOptions()


def recorded_tension(
    _samples: Audio, _sample_rate: int, _string: StringParams | None, recorded: Newtons | None
) -> Newtons | None:
    """Return the recorded tension: a session that was recorded without a tuning has none."""
    return recorded


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A session to read: its name, its file, and where its samples go."""

    name: str
    path: Path
    audio: Path
    options: BuildOptions
    listen: Listen


@dataclass(frozen=True, slots=True, kw_only=True)
class Taken:
    """What a session contributes beside its samples, which are on disk; `refused` says why it is unusable.

    `part` has no place among the others yet: its `first` is 0, and its `audio` empty.
    """

    refused: str = ""
    part: Part | None = None
    form: tuple[int, int] = (0, 0)
    table: dict[str, NDArray[Any]] = field(default_factory=dict[str, NDArray[Any]])
    columns: LabelColumns = field(default_factory=dict[str, Any])
    sums: FileSums | None = None


def find_sessions(names: Iterable[str]) -> list[Path]:
    """Return the session files of these names: files, folders (searched below), and patterns.

    Raises
    ------
    InputError
        If a name matches no session.
    """
    paths: dict[Path, None] = {}
    for name in names:
        path = Path(name)
        if path.is_dir():
            files = sorted(path.rglob("*.mcap"))
        else:
            files = [path] if path.is_file() else [Path(each) for each in sorted(glob(name, recursive=True))]  # noqa: PTH207  (whole paths)
        if not files:
            raise InputError(f"sessions '{name}'", "files .mcap, a folder that holds some, or a pattern")
        paths |= dict.fromkeys(files)
    return list(paths)


def build_dataset(
    sessions: Sequence[Path],
    out: Path,
    options: BuildOptions = DEFAULT_OPTIONS,
    progress: Progress = lambda *_: None,
    listen: Listen = recorded_tension,
    *,
    workers: int | None = 1,
    cluster: str = "",
) -> Dataset:
    """Build a dataset from sessions in the new folder `out`, and return it; its format is in `store`.

    The samples of a session are taken as they were recorded: lost frames are zeros, clipped ones and those
    that are no numbers stay, and the windows that hold any are flagged. A process holds one session at a
    time. Equal sessions and options give equal bytes, in however many processes. The folder appears under its
    name when all of it is there; what a killed run left of the same folder is removed.

    Parameters
    ----------
    sessions
        Their files, in any order.
    out
        Folder to be made.
    options
        How; the usual ones by default.
    progress
        Called before each session, and at the end.
    listen
        Gives the tension of a session's string from its sound, its string and the tension that was recorded.
    workers, cluster
        As in `monochord.core.workers.run_all`, but that None means this process for fewer than `MANY`
        sessions.

    Raises
    ------
    InputError
        If `out` is there already, a session cannot be used (see `truth.truth_of`) and is not to be skipped,
        two have one name, or their rates or channels differ.

    Examples
    --------
    ``examples/build_a_dataset.py`` does so with two simulated sessions.
    """
    if out.exists():
        raise InputError(f"{out}, which is there already", "a new folder", "name another, or remove that one")
    if not sessions:
        raise InputError("no sessions", "one or more")
    if not out.absolute().parent.is_dir():
        raise InputError(
            f"folder {out.absolute().parent}, which is not there", "an existing folder", "make it first"
        )
    files = named_sessions(sessions)
    names = [*files, ""]
    workers = workers or (1 if len(files) < MANY else None)
    with part_folder(out) as part:
        (part / "audio").mkdir()
        jobs = [
            Job(name=name, path=path, audio=part / f"taken-{number}.npy", options=options, listen=listen)
            for number, (name, path) in enumerate(files.items())
        ]
        taken: dict[str, Taken] = {}
        progress(names[0], 0, len(files))
        form: tuple[int, int] | None = None
        for job, each in run_all(jobs, take, workers=workers, cluster=cluster):
            if not options.skip:
                form = _form_of(job.name, each, form)
            taken[job.name] = each
            progress(names[len(taken)], len(taken), len(files))
        _write(part, options, [(job, taken[job.name]) for job in jobs])
        part.rename(out)
    return open_dataset(out)


def named_sessions(sessions: Sequence[Path]) -> dict[str, Path]:
    """Return the files by the names of their sessions, sorted; where names clash, folders are put before.

    Raises `InputError` for two of one name in folders of one name.

    >>> list(named_sessions([Path("b/take.mcap"), Path("a/take.mcap"), Path("a/other.mcap")]))
    ['a/take', 'b/take', 'other']
    """
    plain = [(path.stem, path) for path in sessions]
    stems = [name for name, _ in plain]
    named = [
        (f"{path.absolute().parent.name}/{name}" if stems.count(name) > 1 else name, path)
        for name, path in plain
    ]
    names = [name for name, _ in named]
    for name, path in named:
        if names.count(name) > 1:
            raise InputError(
                f"two sessions called {name}, one of them {path}", "names of their own", "rename one"
            )
    return dict(sorted(named))


def take(job: Job) -> Taken:
    """Return what a session gives, with its samples written where they belong.

    Raises
    ------
    InputError
        If it cannot be used and is not to be skipped.
    """
    options = job.options
    try:
        session = read_session(job.path)
        if not options.force:
            _refuse_damaged(session)
        truth = truth_of(session, options.labels, options.thresholds, force=options.force)
        if not options.force:
            _refuse_damaged(session)  # and what was malformed in what has been read
        tension, tuned = _tension_of(session, job.listen, options.sensor)
    except InputError as error:
        if not options.skip:
            raise
        return Taken(refused=str(error))
    description = session.description
    rate, samples = description.sample_rate, session.audio.samples
    size = round(options.window * rate)
    starts = window_starts(samples.shape[1], size, round(options.hop * rate))
    write_array(job.audio, samples)
    late = truth.alignment.lateness.get(AUDIO)
    part = Part(
        name=job.name,
        source=job.path.name,
        checksum=file_checksum(job.path),
        audio="",
        audio_checksum=hashlib.sha256(samples.tobytes()).hexdigest(),
        frames=samples.shape[1],
        first=0,
        windows=len(starts),
        labels=truth.source,
        simulated=description.simulated,
        object=description.object,
        material=description.material,
        radius=description.radius,
        mount=description.more.get("mount", ""),
        day=description.day,
        build=description.build,
        music=description.more.get("music"),
        complete=session.complete,
        late=late.offsets[0].value if late and late.offsets[0].known else None,
        flags=truth.alignment.flags,
        tension=tension,
        tuned=tuned,
    )
    return Taken(
        part=part,
        form=(rate, description.channels),
        table={"start": starts, **_flags(session.audio, starts, size)},
        columns=_labels(session.audio, truth, starts, size, options.rules),
        sums=file_sums(job.audio),
    )


def _write(folder: Path, options: BuildOptions, taken: Sequence[tuple[Job, Taken]]) -> None:
    """Put sessions together, in their order, and write what is not their sound."""
    parts, files, refused = list[Part](), dict[str, FileSums](), dict[str, str]()
    tables, columns = list[dict[str, NDArray[Any]]](), list[LabelColumns]()
    form: tuple[int, int] | None = None
    windows = 0
    for job, each in taken:
        if each.part is None or each.sums is None:
            refused[job.name] = each.refused
            continue
        try:
            form = _form_of(job.name, each, form)
        except InputError as error:
            refused[job.name] = str(error)
            job.audio.unlink()
            continue
        file = audio_name(len(parts))
        job.audio.rename(folder / file)
        files[file] = each.sums
        tables.append({"session": np.full(each.part.windows, len(parts)), **each.table})
        columns.append(each.columns)
        parts.append(replace(each.part, audio=file, first=windows))
        windows += each.part.windows
    if form is None:
        raise InputError("no session that can be used", "one or more", next(iter(refused.values()), ""))
    labels = _joined(columns, [part.windows for part in parts])
    table = {name: np.concatenate([each[name] for each in tables]) for name in TABLE}
    usable = ~(table["has_gap"] | table["not_finite"])
    write_table(folder, table, labels)
    for path in sorted(folder.glob("*/*.npy")):
        name = path.relative_to(folder).as_posix()
        if name not in files:
            files[name] = file_sums(path)
    rate, channels = form
    Manifest(
        sample_rate=rate,
        channels=channels,
        window=round(options.window * rate),
        hop=round(options.hop * rate),
        windows=windows,
        columns=tuple(labels),
        rules=options.rules,
        labelling=label_rules.__doc__ or "",
        parts=tuple(parts),
        files=files,
        counts=counts_of(kinds_of(labels, usable)) | {"clipped": int(table["clipped"].sum())},
        refused=refused,
        thresholds=options.thresholds,
        forced=options.force,
        versions={name: version(name) for name in ("monochord", "numpy")},
    ).write(folder)


def _form_of(name: str, taken: Taken, before: tuple[int, int] | None) -> tuple[int, int]:
    """Return the rate and channels of a session; refuse those that differ from the ones before."""
    if before is not None and taken.form != before:
        given = f"session {name} with {taken.form[1]} channels at {taken.form[0]} Hz"
        raise InputError(given, f"{before[1]} channels at {before[0]} Hz, as those before")
    return taken.form


def _tension_of(session: SessionReader, listen: Listen, sensor: str) -> tuple[Newtons | None, str | None]:
    """Return the tension of a session's string at rest, and where it is known from."""
    description = session.description
    string = description.string
    recorded = string.tension if string is not None and TUNING in description.more else None
    if sensor and recorded is None:
        own = load_sensor(sensor).string
        if string is not None and replace(own, tension=string.tension) != string:
            given = f"session {session.path.name} with sensor '{sensor}'"
            raise InputError(given, "the string that the session names, at any tension")
        recorded = own.tension
    tension = listen(session.audio.samples, description.sample_rate, string, recorded)
    return tension, None if tension is None else "heard" if recorded is None else "recorded"


def _refuse_damaged(session: SessionReader) -> None:
    malformed = sum(count for count, _ in session.malformed.values())
    if session.damaged or malformed:
        counts = f"damaged chunks: {session.damaged}, malformed messages: {malformed}"
        given = f"session {session.path.name} ({counts})"
        raise InputError(given, "a session as it was written", "leave it out, or take --force")


def _flags(audio: AudioTrack, starts: Indices, size: Samples) -> dict[str, Flags]:
    """Return what is wrong with the samples of each window."""
    lost = np.zeros(audio.samples.shape[1], bool)
    for begin, end in audio.gaps:
        lost[begin:end] = True
    bad: Flags = np.any(~np.isfinite(audio.samples), axis=0)
    clipped: Flags = np.any(np.abs(audio.samples) >= FULL_SCALE, axis=0)
    return {
        "has_gap": _any_within(lost, starts, size),
        "clipped": _any_within(clipped, starts, size),
        "not_finite": _any_within(bad, starts, size),
    }


def _any_within(frames: Flags, starts: Indices, size: Samples) -> Flags:
    counts = np.concatenate([[0], np.cumsum(frames, dtype=np.int32)])
    return counts[starts + size] > counts[starts]


def _labels(
    audio: AudioTrack, truth: SessionTruth, starts: Indices, size: Samples, rules: Rules
) -> LabelColumns:
    """Return the labels of a session's windows, all of them NaN while it is calibrated."""
    begin, end = (truth.time_of(audio.time(frames)) for frames in (starts, starts + size))
    calibrating = np.zeros(len(starts), bool)
    for first, last in truth.calibrating:
        calibrating |= (end > first) & (begin < last)
    columns = window_labels(truth.labels, begin, end, rules)
    labels = {name: np.where(calibrating, np.nan, values) for name, values in columns.items()}
    return {**labels, "calibrating": calibrating.astype(np.float64)}


def _joined(columns: list[LabelColumns], counts: list[int]) -> LabelColumns:
    """Return the labels of all sessions; what a session has no column of is NaN."""
    parts = list(zip(columns, counts, strict=True))
    names = dict.fromkeys(name for each in columns for name in each)
    return {
        name: np.concatenate([each.get(name, np.full(count, np.nan)) for each, count in parts])
        for name in names
    }
