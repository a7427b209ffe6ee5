"""A session's streams as tables: structured arrays of NumPy, and data frames of pandas."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from monochord.core.errors import InputError, did_you_mean
from monochord.core.types import Floats

if TYPE_CHECKING:
    from pandas import DataFrame

    from monochord.sessions.reader import Session

AUDIO, LABELS = "audio", "labels"


def table(session: "Session", stream: str) -> NDArray[Any]:
    """Return a stream as a structured array (n,) whose first field is ``time``, in session seconds.

    ``audio`` has a field for each microphone (``mic_1``, ``mic_2``) in full scale, ``labels`` one for each
    label, a stream of readings one for each column and its ``sequence`` and ``status``.

    Raises
    ------
    InputError
        If there is no such stream.
    """
    if stream == AUDIO:
        audio = session.audio
        columns = {f"mic_{number}": row for number, row in enumerate(audio.samples, start=1)}
        return _structured(audio.time(np.arange(audio.samples.shape[1])), columns)
    if stream == LABELS:
        return _structured(session.labels.time, session.labels.columns)
    if stream not in session.streams:
        names = (AUDIO, LABELS, *session.streams)
        raise InputError(f"stream '{stream}'", ", ".join(names), did_you_mean(stream, names))
    track = session.readings(stream)
    columns = {name: track.column(name) for name in track.feed.columns}
    return _structured(track.time, {**columns, "sequence": track.sequence, "status": track.status})


def frame(session: "Session", stream: str) -> "DataFrame":
    """Return a stream as a data frame indexed by time; raises `InputError` where pandas is not installed."""
    try:
        from pandas import DataFrame  # noqa: PLC0415
    except ImportError as error:
        given = "a data frame without pandas, which is not installed"
        raise InputError(given, "pandas 2 or newer", "pip install 'monochord[pandas]'") from error
    rows = table(session, stream)
    names = rows.dtype.names or ()
    return DataFrame({name: rows[name] for name in names}).set_index("time")


def _structured(time: Floats, columns: dict[str, Any]) -> NDArray[Any]:
    kinds = [("time", np.float64), *((name, values.dtype) for name, values in columns.items())]
    rows = np.empty(len(time), kinds)
    rows["time"] = time
    for name, values in columns.items():
        rows[name] = values
    return rows
