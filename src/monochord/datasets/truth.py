"""The labels of a session, on one clock with its sound."""

from dataclasses import dataclass, replace

import numpy as np

from monochord.core.errors import InputError
from monochord.core.labels import LabelTrack
from monochord.core.types import Floats
from monochord.datasets.measured import THRESHOLDS, Thresholds, measured_truth
from monochord.sessions import ReadingTrack, SessionReader
from monochord.sessions.alignment import AUDIO, Alignment, Spans, align, aligned_readings, calibration_spans

RECORDED, MEASURED = "recorded", "measured"
WRENCH, POSE = "wrench", "pose"
"""Streams from which labels are measured."""
REMEDY = "leave it out, or let `build` or `calibrate` take it with --force"
"""What to do about a session that is refused."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionTruth:
    """A session's ground truth: `labels` on the alignment's reference clock, and their `source`.

    `calibrating` holds the spans on that clock in which the drivers are off for the taps.
    """

    labels: LabelTrack
    source: str
    alignment: Alignment
    calibrating: Spans

    def time_of(self, times: Floats) -> Floats:
        """Return microphone times (n,), in session seconds, on the labels' clock."""
        return self.alignment.correct(AUDIO, times)


def truth_of(
    session: SessionReader, source: str = "", thresholds: Thresholds = THRESHOLDS, *, force: bool = False
) -> SessionTruth:
    """Return a session's ground truth, with its streams aligned by their taps.

    `source` is "recorded" for the session's labels, which are on the force sensor's clock (the microphones'
    without force readings), or "measured" for labels derived from its readings by `thresholds`; by default,
    recorded where there are any. `force` accepts a session with alignment flags, and uses readings with a
    fault status, which otherwise count as missing. Raises `InputError` for flags, or without labels or the
    streams to measure them.
    """
    name = session.path.name
    if source not in ("", RECORDED, MEASURED):
        raise InputError(f"labels '{source}'", f"{RECORDED}, {MEASURED}")
    recorded = bool(session.labels.time.size) and source != MEASURED
    if source == RECORDED and not recorded:
        raise InputError(f"session {name} without labels", "recorded labels", "use --labels measured")
    missing = [stream for stream in (WRENCH, POSE) if stream not in session.streams]
    if not recorded and missing:
        given = f"session {name} without {' and '.join(missing)}, and without labels"
        raise InputError(given if source == "" else given.partition(",")[0], "wrench and pose, or labels")
    alignment = align(session)
    if alignment.flags and not force:
        first, *others = alignment.flags
        given = f"session {name}: {first}" + (f" (and {len(others)} more)" if others else "")
        raise InputError(given, "streams on one clock", REMEDY)
    labels = session.labels
    if not recorded:
        wrench, pose = (aligned_readings(session, stream, alignment) for stream in (WRENCH, POSE))
        labels = measured_truth(_sound(wrench, faulty=force), pose, thresholds)
    return SessionTruth(
        labels=labels,
        source=RECORDED if recorded else MEASURED,
        alignment=alignment,
        calibrating=calibration_spans(session, alignment),
    )


def _sound(track: ReadingTrack, *, faulty: bool) -> ReadingTrack:
    """Return the readings that are numbers and have status 0; with `faulty`, any status."""
    valid = np.isfinite(track.values).all(axis=1) & (faulty | (track.status == 0))
    arrays = ("time", "values", "sequence", "device_time", "status")
    return replace(track, **{name: getattr(track, name)[valid] for name in arrays})
