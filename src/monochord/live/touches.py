"""Finds the touches in a recording, for the table that ``monochord sessions touches`` writes."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from monochord.core.errors import InputError
from monochord.core.units import Metres, Seconds
from monochord.live.events import Event
from monochord.live.filter import CONTACT
from monochord.live.listen import source_of
from monochord.live.loop import opened
from monochord.live.settings import LiveRun, WindowSettings
from monochord.perception.estimators._loaded import LoadedModel
from monochord.perception.model import load
from monochord.sessions import read_session

SHORTEST: Seconds = 0.2
"""Shortest touch listed, in s: shorter ones are knocks."""
DECAY: Seconds = 0.1
"""How long the sound still resembles a touch after release, in s; twice the value on the twin."""
HEADER = "begin,end,position,force"
POSE = "pose"
"""Stream of a robot's pose, whose x is the position along the string, from pickup 1."""
STILL: Metres = 1e-3
"""Largest motion of a robot during a touch with a position, in m."""


def touch_spans(
    recording: str | Path, model: str | Path = "demo", *, sensor: str = "", allow_truncated: bool = False
) -> list[tuple[Seconds, Seconds]]:
    """Return start and end of each touch in a recording, in s from its first frame, in order.

    The touches are those of the live loop. A span lies within its touch: it begins at the end of the first
    window that shows the touch, and ends `DECAY` before the first window without it. The recording is a
    two-channel sound file, or a session; `sensor` is the tuned sensor, a preset or a file, where the
    recording does not name it. A truncated sound file is refused unless `allow_truncated`, which reads it up
    to its end. Raises `InputError` where one of them cannot be used, or no touch lasts for
    `SHORTEST`.
    """
    estimator = LoadedModel(loaded=load(model))
    length = estimator.window
    setup = LiveRun(
        source=source_of(recording, {"allow_truncated": True} if allow_truncated else {}),
        estimator=estimator,
        window=WindowSettings(length=length),
        sensor=sensor,
    )
    changes: list[Event] = []
    end: Seconds = 0.0
    with opened(setup) as live:
        for update in live:
            changes += [event for event in update.events if event.name == CONTACT]
            end = update.prediction.time + length
    # Of a touch that lasts to the end of the recording the end is that one.
    begins = [event.time for event in changes if event.on]
    ends = [event.time - length - DECAY for event in changes if not event.on]
    spans = list(zip(begins, [*ends, end], strict=False))
    spans = [(first, last) for first, last in spans if last - first >= SHORTEST]
    if not spans:
        given = f"{recording} ({end:.1f} s without a touch of {SHORTEST:g} s)"
        raise InputError(given, "a recording of touches", "tune the sensor, and hold each touch for a second")
    return spans


def robot_positions(recording: str | Path, spans: Sequence[tuple[Seconds, Seconds]]) -> list[Metres] | None:
    """Return the position of each touch by the recorded pose of a robot, in m; None without a pose.

    It is the mean of the pose's x, in metres along the string from pickup 1, over the span; NaN where there
    is no reading, or the robot moved by more than `STILL`. Raises `InputError` for a session that cannot be
    read.
    """
    if Path(recording).suffix != ".mcap":
        return None
    session = read_session(Path(recording))
    if POSE not in session.streams:
        return None
    pose, rate = session.readings(POSE), session.audio.sample_rate
    along = pose.column("x")
    positions: list[Metres] = []
    for span in spans:
        first, last = np.searchsorted(pose.time, session.audio.time(rate * np.array(span)))
        part = along[first:last]
        still = part.size and float(np.ptp(part)) <= STILL
        positions.append(float(part.mean()) if still else math.nan)
    return positions


def touch_table(spans: Sequence[tuple[Seconds, Seconds]], positions: Sequence[Metres] | None = None) -> str:
    """Return touches as a table with empty cells for force in N, and for position in m where it is unknown.

    >>> touch_table([(4.0, 5.5)]).splitlines()
    ['begin,end,position,force', '4.00,5.50,,']
    >>> touch_table([(4.0, 5.5)], [0.0621]).splitlines()[1]
    '4.00,5.50,0.0621,'
    """
    known = positions or [math.nan] * len(spans)
    cells = ["" if math.isnan(each) else f"{each:.4f}" for each in known]
    rows = (f"{first:.2f},{last:.2f},{cell}," for (first, last), cell in zip(spans, cells, strict=True))
    return "\n".join([HEADER, *rows]) + "\n"
