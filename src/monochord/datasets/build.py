"""Builds a dataset from sessions, one at a time or in parallel."""

import hashlib
import json
import os
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from glob import glob
from importlib.metadata import version
from itertools import chain
from math import inf
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Annotated, Literal, TypeAlias

import msgspec
import numpy as np
from msgspec import Meta

from monochord.core import labels as label_rules
from monochord.core.clipping import FULL_SCALE
from monochord.core.errors import InputError
from monochord.core.labels import LabelColumns, Rules, window_labels
from monochord.core.ownership import part_folder
from monochord.core.ranges import Checked, SampleRate
from monochord.core.types import Audio, Progress, StringParams
from monochord.core.units import Metres, Newtons, Samples, Seconds
from monochord.core.workers import run_all
from monochord.datasets.checksums import FileSums, file_sums
from monochord.datasets.kinds import counts_of, kinds_of
from monochord.datasets.manifest import DatasetSession, Manifest, audio_name, file_checksum
from monochord.datasets.measured import Thresholds
from monochord.datasets.records import PackedFiles, PackedRecords
from monochord.datasets.store import (
    TABLES,
    Dataset,
    Flags,
    Indices,
    open_dataset,
    session_rows,
    window_starts,
    write_array,
    write_table,
)
from monochord.datasets.truth import REMEDY, SessionTruth, truth_of
from monochord.physics.sensors import load_sensor, same_wire
from monochord.sessions import TUNING, AudioTrack, Description, SessionReader, read_session
from monochord.sessions.alignment import AUDIO
from monochord.sessions.resample import resample

MANY = 16
"""Number of sessions from which starting several processes pays off."""
Labelling: TypeAlias = Literal["", "recorded", "measured"]
Listen: TypeAlias = Callable[[Audio, int, StringParams | None, Newtons | None], Newtons | None]
"""Returns a string's tension from sound (channels, n), its rate, the string and the recorded tension.

None where unknown. The string is None for a session without one, the recorded tension None for a session
recorded without a tuning.
"""
Stretch: TypeAlias = Annotated[Seconds, Meta(ge=1e-3, le=60.0)]
"""Length of a window, or time from one to the next."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildOptions(Checked):
    """Options for building a dataset from sessions.

    Parameters
    ----------
    window, hop
        Window length and hop in s.
    labels
        "recorded" uses the session's labels, "measured" labels derived from wrench and pose; empty uses
        recorded labels where a session has any.
    force
        Whether to accept a session with alignment flags or damage.
    skip
        Whether to skip an unusable session instead of stopping.
    rules
        Rules for the label of a window.
    thresholds
        Thresholds of contact and sliding, for measured labels.
    sensor
        The tuned sensor (a preset, or a file from ``monochord tune``) of sessions recorded without a tuning.
    sample_rate
        Rate of the dataset, in Hz: a session of a higher rate is resampled to it, as ``sessions resample``
        does. None keeps each session's rate, and refuses unequal ones.
    """

    window: Stretch = 0.1
    hop: Stretch = 0.1
    labels: Labelling = ""
    force: bool = False
    skip: bool = False
    rules: Rules = field(default_factory=Rules)
    thresholds: Thresholds = field(default_factory=Thresholds)
    sensor: str = ""
    sample_rate: SampleRate | None = None

    def __post_init__(self) -> None:
        Checked.__post_init__(self)
        if self.sensor:
            load_sensor(self.sensor)


DEFAULT_OPTIONS = BuildOptions()


def recorded_tension(
    _samples: Audio, _sample_rate: int, _string: StringParams | None, recorded: Newtons | None
) -> Newtons | None:
    """Return the recorded tension; None for a session recorded without a tuning."""
    return recorded


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """A session to read: its name, its file, and the folder that receives its samples and its rows."""

    name: str
    number: int
    path: Path
    folder: Path
    options: BuildOptions
    listen: Listen

    @property
    def audio(self) -> Path:
        """File of its samples."""
        return self.folder / f"taken-{self.number}.npy"

    @property
    def rows(self) -> Path:
        """File of its rows, see `monochord.datasets.store.session_rows`."""
        return self.folder / f"rows-{self.number}.npy"


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionContribution:
    """A session's contribution besides its samples and rows, which are on disk.

    `refused` says why it is unusable. `part` is not yet placed among the others: its `first` is 0, and its
    `audio` empty. `columns` names the labels, and `counts` is the number of windows of each kind.
    """

    refused: str = ""
    part: DatasetSession | None = None
    form: tuple[int, int] = (0, 0)
    columns: tuple[str, ...] = ()
    counts: Mapping[str, int] = field(default_factory=dict[str, int])
    sums: FileSums | None = None


def find_sessions(names: Iterable[str]) -> list[Path]:
    """Return the session files for these names: files, folders (searched recursively), and patterns.

    Raises
    ------
    InputError
        If a name matches no session.
    """
    paths: dict[Path, None] = {}
    for name in names:
        path = Path(name)
        if path.is_dir():
            found = (Path(home, name) for home, _, names in os.walk(path) for name in names)
            files = sorted(file for file in found if file.suffix == ".mcap")
        else:
            files = [path] if path.is_file() else [Path(each) for each in sorted(glob(name, recursive=True))]  # noqa: PTH207  (whole paths)
        if not files:
            raise InputError(f"sessions '{name}'", ".mcap files, a folder that contains some, or a pattern")
        paths |= dict.fromkeys(files)
    return list(paths)


def build_dataset(
    sessions: Sequence[Path],
    out: Path,
    options: BuildOptions = DEFAULT_OPTIONS,
    progress: Progress = lambda *_: None,
    listen: Listen = recorded_tension,
    *,
    finish: Callable[[Dataset], None] = lambda _: None,
    workers: int | None = 1,
    cluster: str = "",
) -> Dataset:
    """Build a dataset from sessions in the new folder `out`, and return it; see `store` for the format.

    Samples are copied as recorded, or resampled to `options.sample_rate`: lost frames are zeros, clipped and
    non-finite samples stay, and windows with any of these are flagged. A process holds one session in memory
    at a time. Equal sessions and options give equal bytes, for any number of processes. The folder gets its
    name once it is complete; remains of a killed run are removed.

    Parameters
    ----------
    sessions
        Session files, in any order.
    out
        The new folder.
    options
        Build options; the defaults if omitted.
    progress
        Called before each session, and at the end.
    listen
        Returns the tension of a session's string from its sound, its string and the recorded tension.
    finish
        Called with the complete dataset before it gets its name; what is written into its folder stays there.
    workers, cluster
        As in `monochord.core.workers.run_all`; None uses this process for fewer than `MANY` sessions.

    Raises
    ------
    InputError
        If `out` exists or another process builds it, a session is unusable (see `truth.truth_of`) and not
        skipped, two sessions have the same name, or their rates or channels differ.

    Examples
    --------
    ``examples/build_a_dataset.py`` does so with two simulated sessions.
    """
    if out.exists():
        raise InputError(f"{out}, which already exists", "a new folder", "choose another name, or remove it")
    if not sessions:
        raise InputError("no sessions", "one or more")
    if not out.absolute().parent.is_dir():
        raise InputError(
            f"folder {out.absolute().parent}, which does not exist", "an existing folder", "create it first"
        )
    files = named_sessions(sessions)
    names = [*files, ""]
    workers = workers or (1 if len(files) < MANY else None)
    with part_folder(out) as part:
        (part / "audio").mkdir()
        jobs = [
            Job(name=name, number=number, path=path, folder=part, options=options, listen=listen)
            for number, (name, path) in enumerate(files.items())
        ]
        progress(names[0], 0, len(files))
        form: tuple[int, int] | None = None
        with TemporaryFile(dir=part) as file:
            places = np.zeros((len(jobs), 2), np.int64)
            for done, (job, each) in enumerate(run_all(jobs, take, workers=workers, cluster=cluster), 1):
                if not options.skip:
                    form = _form_of(job.name, each, form)
                places[job.number] = file.tell(), file.write(msgspec.msgpack.encode(each))
                progress(names[done], done, len(files))
            _write(part, options, ((job, _contribution(file, *places[job.number])) for job in jobs))
        finish(open_dataset(part))
        part.rename(out)
    return open_dataset(out)


def named_sessions(sessions: Sequence[Path]) -> dict[str, Path]:
    """Return the files by session name, sorted; where names clash, their folders are prefixed.

    Raises `InputError` for two sessions of one name in folders of one name.

    >>> list(named_sessions([Path("b/take.mcap"), Path("a/take.mcap"), Path("a/other.mcap")]))
    ['a/take', 'b/take', 'other']
    """
    plain = [(path.stem, path) for path in sessions]
    stems = Counter(name for name, _ in plain)
    named = [
        (f"{path.absolute().parent.name}/{name}" if stems[name] > 1 else name, path) for name, path in plain
    ]
    names = Counter(name for name, _ in named)
    for name, path in named:
        if names[name] > 1:
            raise InputError(f"two sessions called {name}, one of them {path}", "unique names", "rename one")
    return dict(sorted(named))


def take(job: Job) -> SessionContribution:
    """Return a session's contribution, with its samples and rows written to the job's files.

    Raises `InputError` for an unusable session that is not skipped.
    """
    options = job.options
    try:
        recorded = read_session(job.path)
        if not options.force:
            _refuse_damaged(recorded)
        session = _at_rate(recorded, job)
        truth = truth_of(session, options.labels, options.thresholds, force=options.force)
        if not options.force:
            _refuse_damaged(recorded)  # and what was malformed in what has been read
        tension, tuned, length, measured = _string_of(session, job.listen, options.sensor)
    except InputError as error:
        if not options.skip:
            raise
        return SessionContribution(refused=str(error))
    description = session.description
    rate, samples = description.sample_rate, session.audio.samples
    size = round(options.window * rate)
    starts = window_starts(samples.shape[1], size, round(options.hop * rate))
    flags = _flags(session.audio, starts, size)
    labels = _labels(session.audio, truth, starts, size, options.rules)
    usable = ~(flags["has_gap"] | flags["not_finite"])
    write_array(job.rows, session_rows({"start": starts, **flags}, labels))
    write_array(job.audio, samples)
    late = truth.alignment.lateness.get(AUDIO)
    part = DatasetSession(
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
        complete=recorded.complete,
        late=late.offsets[0].value if late and late.offsets[0].is_determined else None,
        flags=truth.alignment.flags,
        tension=tension,
        tuned=tuned,
        length=length,
        measured_length=measured,
    )
    return SessionContribution(
        part=part,
        form=(rate, description.channels),
        columns=tuple(labels),
        counts=counts_of(kinds_of(labels, usable)) | {"clipped": int(flags["clipped"].sum())},
        sums=file_sums(job.audio),
    )


def _at_rate(session: SessionReader, job: Job) -> SessionReader:
    """Return a session, or where its rate is above the dataset's, its resampled copy."""
    rate = job.options.sample_rate
    if rate is None or session.description.sample_rate <= rate:
        return session
    path = job.folder / f"resampled-{job.number}.mcap"
    try:
        resample(session, path, rate)
        copy = read_session(path)  # is read after its file's name is gone
    finally:
        path.unlink(missing_ok=True)
    copy.path = session.path
    return copy


def _contribution(file: IO[bytes], place: int, size: int) -> SessionContribution:
    """Return a session's contribution from the file in which all of them wait."""
    file.seek(place)
    return msgspec.msgpack.decode(file.read(size), type=SessionContribution)


def _write(folder: Path, options: BuildOptions, taken: Iterable[tuple[Job, SessionContribution]]) -> None:
    """Combine the sessions in order, and write everything except their sound."""
    parts, sums, refused = PackedRecords(DatasetSession), PackedRecords(FileSums), dict[str, str]()
    rows, labels, counts = list[Path](), dict[str, None](), Counter[str]()
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
            job.rows.unlink()
            continue
        file = audio_name(len(parts))
        job.audio.rename(folder / file)
        sums.append(each.sums)
        rows.append(job.rows)
        labels |= dict.fromkeys(each.columns)
        counts.update(each.counts)
        parts.append(replace(each.part, audio=file, first=windows))
        windows += each.part.windows
    if form is None:
        raise InputError("no usable session", "one or more", next(iter(refused.values()), ""))
    write_table(folder, rows, windows, tuple(labels))
    for each in rows:
        each.unlink()
    tables = (path for name in TABLES for path in (folder / name).glob("*.npy"))
    files = chain(
        ((part.audio, sums[number]) for number, part in enumerate(parts)),
        ((path.relative_to(folder).as_posix(), file_sums(path)) for path in tables),
    )
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
        parts=parts,
        files=PackedFiles(files),
        counts=dict(counts),
        refused=refused,
        thresholds=options.thresholds,
        forced=options.force,
        versions={name: version(name) for name in ("monochord", "numpy")},
    ).write(folder)


def _form_of(name: str, taken: SessionContribution, before: tuple[int, int] | None) -> tuple[int, int]:
    """Return a session's rate and channels.

    Raises `InputError` where they differ from the previous sessions'.
    """
    if before is not None and taken.form != before:
        given = f"session {name} with {taken.form[1]} channels at {taken.form[0]} Hz"
        raise InputError(given, f"{before[1]} channels at {before[0]} Hz, as in the other sessions")
    return taken.form


def _string_of(
    session: SessionReader, listen: Listen, sensor: str
) -> tuple[Newtons | None, str | None, Metres | None, Metres | None]:
    """Return the tension of a session's string and its source, and its length, stated and measured."""
    description = session.description
    measured = _measured_length(description)
    string = description.string
    recorded = string.tension if string is not None and TUNING in description.more else None
    if sensor and recorded is None:
        known = load_sensor(sensor)
        if string is not None and not same_wire(known.string, string):
            given = f"session {session.path.name} with sensor '{sensor}'"
            raise InputError(given, "the session's string, at any tension")
        string, recorded, measured = known.string, known.string.tension, known.measured_length or measured
    tension = listen(session.audio.samples, description.sample_rate, string, recorded)
    tuned = None if tension is None else "heard" if recorded is None else "recorded"
    return tension, tuned, None if string is None else string.length, measured


def _measured_length(description: Description) -> Metres | None:
    """Return the length of a session's string as measured with a ruler, None where unknown."""
    try:
        simulated = json.loads(description.more.get("length", "{}"))
    except ValueError:
        simulated = {}
    stated = simulated.get("measured") if isinstance(simulated, dict) else None
    length = description.sensor.get("measured_length", stated)
    return length if isinstance(length, float) and 0.0 < length < inf else None


def _refuse_damaged(session: SessionReader) -> None:
    malformed = sum(count for count, _ in session.malformed.values())
    if session.damaged or malformed:
        counts = f"damaged chunks: {session.damaged}, malformed messages: {malformed}"
        given = f"session {session.path.name} ({counts})"
        raise InputError(given, "an undamaged session", REMEDY)


def _flags(audio: AudioTrack, starts: Indices, size: Samples) -> dict[str, Flags]:
    """Return the fault flags of each window's samples."""
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
    """Return the labels of a session's windows, all NaN during the taps."""
    begin, end = (truth.time_of(audio.time(frames)) for frames in (starts, starts + size))
    calibrating = np.zeros(len(starts), bool)
    for first, last in truth.calibrating:
        calibrating |= (end > first) & (begin < last)
    columns = window_labels(truth.labels, begin, end, rules)
    labels = {name: np.where(calibrating, np.nan, values) for name, values in columns.items()}
    return {**labels, "calibrating": calibrating.astype(np.float64)}
