"""Creates a session from audio and labels that were recorded elsewhere."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from monochord.capture.recording.label_table import read_labels
from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Stream
from monochord.core.config import from_tree, to_tree
from monochord.core.errors import InputError
from monochord.core.types import Floats
from monochord.core.units import Seconds
from monochord.sessions import ESTIMATES, Description, SessionClock, SessionWriter, read_session

AUDIO_FILES, SESSIONS = "wav", "session"  # the sources that read them
SESSION_SUFFIX = ".mcap"
POSES = "pose"
BLOCK: Seconds = 0.1


def from_files(
    audio: Path,
    labels: Path | None,
    out: Path,
    *,
    described: Mapping[str, Any] | None = None,
    allow_truncated: bool = False,
) -> None:
    r"""Write a session from an audio file and a table of labels.

    The audio is WAV or FLAC, 1 or 2 channels at 16 to 192 kHz. Samples of up to 24 bits, and 32-bit floats,
    are stored exactly; wider ones are rounded to 32-bit floats. The session begins at the file's date minus
    its duration; without device times, frame n is at n / rate. In place of the file, a session recorded with
    microphones alone is accepted: its sensor, string and gaps are kept, and estimates that a live run
    recorded in it are left out, and so are poses: `monochord.live.touches` reads them for the table.

    Parameters
    ----------
    audio
        The audio file or session.
    labels
        A CSV file whose first line names the columns: ``time`` in s from the audio's beginning; ``contact``
        and ``slip`` (0 or 1), ``position`` in m from pickup 1, ``force`` in N, or any others, all numbers. An
        empty cell is unknown. With ``begin`` and ``end`` in place of ``time``, each row is a touch, and there
        is no contact between rows. A misspelt name of these is refused. None for no labels.
    out
        The new session, ``NAME.mcap``; on an error it is not left behind.
    described
        Options of `Description` by name, such as ``object`` and ``string``; the name defaults to the file's.
    allow_truncated
        Whether to read a truncated audio file, up to its end.

    Raises
    ------
    InputError
        If a file cannot be used (the error names the row and column of a table), or the session exists.

    >>> import tempfile, soundfile
    >>> from monochord.sessions import read_session
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sound, table = Path(folder) / "take.wav", Path(folder) / "take.csv"
    ...     soundfile.write(sound, np.zeros((44100, 2)), 44100)
    ...     _ = table.write_text("time,contact,position\n0.0,0,\n0.5,1,0.12\n")
    ...     from_files(sound, table, Path(folder) / "take.mcap", described={"object": "key"})
    ...     read_session(Path(folder) / "take.mcap").labels.columns["position"]
    array([ nan, 0.12])
    """
    options_ = dict(described or {})
    source, known, begin = AUDIO_FILES, dict[str, Any](), None
    options: dict[str, Any] = {"path": str(audio), **({"allow_truncated": True} if allow_truncated else {})}
    if audio.suffix.lower() == SESSION_SUFFIX:
        source = SESSIONS
        known, begin = _known(audio)
    with SOURCES.build(source, options).open() as probe:
        rate, channels = probe.signal.sample_rate, probe.signal.channels
        frames = max((block.start + block.samples.shape[1] for block in probe), default=0)
    more = {"imported": _text(audio.name), **({"imported_labels": _text(labels.name)} if labels else {})}
    tree: dict[str, Any] = {"name": _text(audio.stem), **known, **options_}
    tree |= {"sample_rate": rate, "channels": channels}
    more = known.get("more", {}) | more
    description = from_tree(Description, {**tree, "more": {**more, **options_.get("more", {})}}, "session")
    time, columns = np.zeros(0), dict[str, Floats]()
    if labels is not None:
        time, columns = read_labels(labels, frames / rate, description.string)
    if begin is None:
        begin = audio.stat().st_mtime_ns - round(frames / rate * 1e9)
    clock = SessionClock(epoch_ns=max(begin, 0))
    options["block"] = round(BLOCK * rate)
    writer = SessionWriter(out, description, clock)
    try:
        with writer, SOURCES.build(source, options).open() as stream:
            _write(writer, stream, time, columns)
    except BaseException:
        out.unlink(missing_ok=True)
        raise


def _known(path: Path) -> tuple[dict[str, Any], int]:
    """Return the description and begin in ns of a recorded session; refuses one with other streams."""
    session = read_session(path)
    streams = [name for name in session.streams if name not in (ESTIMATES, POSES)]
    streams += ["labels"] if session.labels.time.size else []
    if streams:
        given = f"session {path} with {' and '.join(streams)}"
        raise InputError(
            given, "a session of microphones alone", "run build on it, which labels it from these streams"
        )
    about = to_tree(session.description)
    for name in ("feeds", "sample_rate", "channels"):
        about.pop(name, None)
    return about, session.clock.epoch_ns


def _text(name: str) -> str:
    """Return a file's name as text; it may hold any bytes."""
    return os.fsencode(name).decode(errors="replace")


def _write(writer: SessionWriter, stream: Stream, time: Floats, columns: Mapping[str, Floats]) -> None:
    written = 0
    for block in stream:
        due = int(np.searchsorted(time, block.start / stream.signal.sample_rate))
        _labels(writer, time, columns, slice(written, due))
        written = due
        writer.audio(block)
        writer.flush()  # a file that is cut keeps what came before
    _labels(writer, time, columns, slice(written, None))


def _labels(writer: SessionWriter, time: Floats, columns: Mapping[str, Floats], part: slice) -> None:
    if len(time[part]) and columns:
        writer.labels(time[part], {name: column[part] for name, column in columns.items()})
