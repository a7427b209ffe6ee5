"""Audio and labels that were recorded elsewhere, as a session."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from monochord.capture.recording._label_file import read_labels
from monochord.capture.sources import SOURCES
from monochord.capture.sources.base import Stream
from monochord.core.config import from_tree
from monochord.core.types import Floats
from monochord.core.units import Seconds
from monochord.sessions import Description, SessionClock, SessionWriter
from monochord.sessions.bounds import json_object

AUDIO_FILES = "wav"  # the source that reads them
BLOCK: Seconds = 0.1


def from_files(
    audio: Path, labels: Path | None, out: Path, *, described: Mapping[str, Any] | None = None
) -> None:
    r"""Write a session of an audio file and a table of what was true when.

    The audio is WAV or FLAC, 1 or 2 channels at 16 to 96 kHz. Samples of up to 24 bits, and 32-bit floats,
    are kept to the last bit; of wider ones, what 32-bit floats hold. The session's begin is the file's date
    less its length; no device told times, so frame n is at n / rate.

    Parameters
    ----------
    audio
        The file.
    labels
        A CSV file; its first line names the columns: ``time`` in s from the audio's begin; ``contact`` and
        ``slip`` (0 or 1), ``position`` in m from pickup 1, ``force`` in N, or any others, all numbers. An
        empty cell is what is not known. None where nothing is.
    out
        The new session, ``NAME.mcap``; what fails leaves none.
    described
        Options of `Description` by name, such as ``object`` and ``string``; its name is else the file's.

    Raises
    ------
    InputError
        If a file cannot be used (with the row and the column of a table), or the session exists.

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
    told = dict(described or {})
    with SOURCES.build(AUDIO_FILES, {"path": str(audio)}).open() as probe:
        rate, channels = probe.signal.sample_rate, probe.signal.channels
        frames = sum(block.samples.shape[1] for block in probe)
    more = {"imported": _text(audio.name), **({"imported_labels": _text(labels.name)} if labels else {})}
    tree: dict[str, Any] = {"name": _text(audio.stem), **told, "sample_rate": rate, "channels": channels}
    description = from_tree(Description, {**tree, "more": {**more, **told.get("more", {})}}, "session")
    json_object(description.dump())  # or text that no file can hold would fail as it is written
    length = description.string.length if description.string else None
    time, columns = np.zeros(0), dict[str, Floats]()
    if labels is not None:
        time, columns = read_labels(labels, frames / rate, length)
    begin = audio.stat().st_mtime_ns - round(frames / rate * 1e9)
    clock = SessionClock(epoch_ns=max(begin, 0))
    options = {"path": str(audio), "block": round(BLOCK * rate)}
    writer = SessionWriter(out, description, clock)
    try:
        with writer, SOURCES.build(AUDIO_FILES, options).open() as stream:
            _write(writer, stream, time, columns)
    except BaseException:
        out.unlink(missing_ok=True)
        raise


def _text(name: str) -> str:
    """Return a file's name as text, whatever bytes it is of."""
    return os.fsencode(name).decode(errors="replace")


def _write(writer: SessionWriter, stream: Stream, time: Floats, columns: Mapping[str, Floats]) -> None:
    done = 0
    for block in stream:
        due = int(np.searchsorted(time, block.start / stream.signal.sample_rate))
        _labels(writer, time, columns, slice(done, due))
        done = due
        writer.audio(block)
    _labels(writer, time, columns, slice(done, None))


def _labels(writer: SessionWriter, time: Floats, columns: Mapping[str, Floats], part: slice) -> None:
    if len(time[part]) and columns:
        writer.labels(time[part], {name: column[part] for name, column in columns.items()})
