"""Records in the background until a block ends, like ``monochord record``."""

import re
import threading
from collections.abc import Generator, Iterable, Sequence
from contextlib import contextmanager
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from monochord.capture.instruments import INSTRUMENTS
from monochord.capture.recording import RecordingJob, RecordingSettings, RecordingState, RecordingSummary
from monochord.capture.recording import record as run
from monochord.capture.recording.settings import kind_of
from monochord.capture.recording.streams import free_name
from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Source
from monochord.core.config import Tree, load_toml, override, table
from monochord.core.errors import DeviceError, InputError
from monochord.core.interruption import Interruption
from monochord.core.ranges import Positive, checked
from monochord.core.units import Metres, Seconds
from monochord.live.listen import source_of
from monochord.live.settings import recording_source
from monochord.sessions import Event

RESERVED = tuple(field.name for field in fields(RecordingSettings))
"""First words of settings, which cannot be instrument names."""


class Recording:
    """A recording that runs in a separate thread.

    Attributes
    ----------
    path
        The session's file.
    summary
        Summary of the saved data; None until the recording has ended.
    """

    def __init__(self, job: RecordingJob) -> None:
        self.path = job.path
        self.summary: RecordingSummary | None = None
        self._progress: RecordingState | None = None
        self._error: BaseException | None = None
        self._job, self._stop, self._begun = job, Interruption(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="record")

    def __repr__(self) -> str:
        state = f"{self.seconds:.1f} s" + (", running" if self.running else "")
        return f"<Recording {self.path}, {state}>"

    @property
    def running(self) -> bool:
        """Whether it is still recording; it ends by itself when the source ends or the time is over."""
        return self._thread.is_alive()

    @property
    def seconds(self) -> Seconds:
        """Duration recorded so far, in s."""
        return self.summary.seconds if self.summary else self._progress.elapsed if self._progress else 0.0

    def start(self) -> None:
        """Start, and return once data are saved; raises the error of a failed start."""
        self._thread.start()
        try:
            self._begun.wait()
        except BaseException:
            self.stop()
            raise
        if self._error is not None:
            raise self._error

    def stop(self) -> None:
        """Request the end."""
        self._stop.requested = True

    def wait(self, timeout: Seconds | None = None) -> bool:
        """Wait until it has ended by itself, at most `timeout` s; return whether it has."""
        self._thread.join(timeout)
        return not self.running

    def end(self) -> RecordingSummary | None:
        """End the recording and return its summary; raises the error that ended it."""
        self.stop()
        self._thread.join()
        if self._error is not None:
            raise self._error
        if self.summary is not None and self.summary.failure:
            raise DeviceError(self.summary.failure)
        return self.summary

    def _run(self) -> None:
        try:
            self.summary = run(self._job, self._show, self._stop)
        except BaseException as error:  # noqa: BLE001  (raised in the caller's thread)
            self._error = error
        finally:
            self._begun.set()

    def _show(self, now: RecordingState, notices: Sequence[Event]) -> None:  # noqa: ARG002
        self._progress = now
        self._begun.set()


@checked
@contextmanager
def record(
    path: str | Path,
    source: str | Path | Source | None = None,
    *,
    instruments: Sequence[str] = (),
    seconds: Positive[Seconds] | None = None,
    object: str | None = None,  # noqa: A002  (the session's own word)
    material: str | None = None,
    radius: Positive[Metres] | None = None,
    sensor: str | Path | None = None,
    notes: str | None = None,
    simulated: bool | None = None,
    config: str | Path | None = None,
    settings: Sequence[str] = (),
    **options: Any,
) -> Generator[Recording]:
    """Record audio, force and pose into a session while a ``with`` block runs.

    The recording runs in a separate thread and ends with the block, or earlier when the source ends or the
    time is over. All data recorded so far are always saved.

    Parameters
    ----------
    path
        The new session file, ending in ``.mcap``.
    source
        As for `listen`: a source's name, a recording, or a source object; by default from `config`, else
        ``"jack"``.
    instruments
        Force sensors, robots and other instruments to record, such as ``"net_ft=192.168.1.1"`` or
        ``"left:pose_udp=9871"``: ``[STREAM:]NAME[=WHERE]``.
    seconds
        Largest duration in s; by default until the end of the block.
    object, material
        The touching object and its material.
    radius
        Radius of the object at the contact, in m.
    sensor
        A sensor preset, or a tuned sensor's file.
    notes
        Further notes.
    simulated
        Whether to mark the session as simulated.
    config
        A TOML file of settings, overridden by all other arguments.
    settings
        Overrides, such as ``"net_ft.bias=true"``.
    options
        Options of the source, such as ``seed=1`` for the twin.

    Yields
    ------
    Recording
        The recording, with its `seconds` so far and, after the block, its `summary`.

    Raises
    ------
    InputError
        At the start, if the file exists, its disk is too full, or an option cannot be used.
    DeviceError
        At the start, if a device is missing; at the end of the block, if one was lost for good. The data
        recorded until then are saved.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> import monochord as mc
    >>> take = f"{mkdtemp()}/take.mcap"
    >>> with mc.record(take, "twin", seconds=0.5, seed=1, object="finger") as recording:
    ...     ended = recording.wait()
    >>> recording.summary.stopped, mc.read_session(recording.path).description.object
    ('the time is over', 'finger')
    """
    tree: Tree = load_toml(Path(config)) if config else {}
    if source is not None and not isinstance(source, Source):
        tree["source"] = _source_table(source)
    if options and not isinstance(source, Source):
        tree["source"] = {"name": "jack", **table(tree, "source"), **options}
    job = recording_job(
        Path(path),
        tree,
        instruments=instruments,
        settings=settings,
        seconds=seconds,
        object=object,
        material=material,
        radius=radius,
        sensor=None if sensor is None else str(sensor),
        notes=notes,
        simulated=simulated,
    )
    if isinstance(source, Source):
        job = replace(job, source=source_of(source, options))
    recording = Recording(job)
    recording.start()
    try:
        yield recording
    except BaseException:
        recording.stop()
        recording.wait()
        raise
    recording.end()


def recording_job(
    path: Path,
    tree: Tree,
    *,
    instruments: Sequence[str] = (),
    settings: Sequence[str] = (),
    seconds: Seconds | None = None,
    notes: str | None = None,
    **about: Any,
) -> RecordingJob:
    """Return a recording job, ready to start, of plain values that the other arguments override.

    `settings` are overrides in which an instrument's options start with its name; `instruments`, `seconds`,
    `notes` and `about` are as for `record`, and None keeps the tree's values. `InputError` refuses an unknown
    name, option or sensor, and a path that does not end in .mcap.
    """
    tables = _instruments(table(tree, "instruments"), instruments)
    given = {key: value for key, value in {**about, "note": notes}.items() if value is not None}
    tree = {**tree, "instruments": {**table(tree, "instruments"), **tables}}
    if given:
        tree["about"] = {**table(tree, "about"), **given}
    if seconds is not None:
        tree["seconds"] = seconds
    return RecordingSettings.read(override(tree, _in_full(settings, tables))).job(path)


def _instruments(configured: Tree, named: Sequence[str]) -> Tree:
    """Return the instrument tables: those of the configuration, overridden by --instrument."""
    tables: Tree = {name.replace("-", "_"): table(configured, name) for name in configured}
    if len(tables) < len(configured):
        raise InputError(f"instruments {', '.join(configured)}", "names that differ by more than - and _")
    given: set[str] = set()
    for text in named:
        head, equals, where = text.partition("=")
        stream, _, kind = (part.replace("-", "_") for part in head.rpartition(":"))
        if (
            not stream and kind in tables and kind not in INSTRUMENTS.names()
        ):  # one of the configuration's own
            stream, kind = kind, kind_of(kind, tables[kind])
        if head.count(":") and not re.fullmatch("[a-z][a-z0-9_]*", stream):
            raise InputError(f"stream '{stream}'", "lower-case letters, digits and _, starting with a letter")
        name = stream or free_name(kind, given)
        if name in given or name in RESERVED:
            allowed = (
                "a different name for each" if name in given else f"a name other than {', '.join(RESERVED)}"
            )
            raise InputError(f"--instrument {text} called '{name}'", allowed, "name it: STREAM:NAME=WHERE")
        given.add(name)
        known = tables.get(name, {})
        tables[name] = {
            **(known if kind_of(name, known) == kind else {}),
            **({_first_field(kind): where} if equals else {}),
            **({"name": kind} if stream else {}),
        }
    return tables


def _in_full(assignments: Sequence[str], instruments: Iterable[str]) -> list[str]:
    """Return assignments, with those that start with an instrument's name moved into its table."""
    names = set(instruments)
    full: list[str] = []
    for text in assignments:
        head, dot, rest = text.removeprefix("instruments.").partition(".")
        name = head.replace("-", "_")
        if text.startswith("instruments.") or (dot and name in names):
            full.append(f"instruments.{name}{dot}{rest}")
            continue
        if name in INSTRUMENTS.names():
            raise InputError(f"--set {text}", f"options of a recorded instrument; add --instrument {name}")
        full.append(text)
    return full


def _source_table(source: str | Path) -> Tree:
    """Return the table of a source by name, or of the source that reads a recording."""
    if isinstance(source, str) and source.replace("-", "_") in SOURCES.names():
        return {"name": source}
    return {"name": recording_source(source) or "wav", "path": str(source)}


def _first_field(kind: str) -> str:
    """Return the name of the option with an instrument's input."""
    return next(each.name for each in fields(INSTRUMENTS.load(kind)) if each.init)  # pyright: ignore[reportArgumentType]
