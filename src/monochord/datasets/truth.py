"""Where a session's labels come from, on one clock with its sound."""

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
"""Streams that labels are measured from."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionTruth:
    """What is true of a session: `labels` on the clock of the alignment's reference, and their `source`.

    `calibrating` are the spans on that clock in which the string is not driven, so that the taps stand out.
    """

    labels: LabelTrack
    source: str
    alignment: Alignment
    calibrating: Spans

    def time_of(self, times: Floats) -> Floats:
        """Return times of the microphones (n,), in session seconds, on the clock of the labels."""
        return self.alignment.correct(AUDIO, times)


def truth_of(
    session: SessionReader, source: str = "", thresholds: Thresholds = THRESHOLDS, *, force: bool = False
) -> SessionTruth:
    """Return the ground truth of a session, with its streams aligned by their taps.

    Parameters
    ----------
    session
        A session.
    source
        "recorded" for the labels that the session holds, which are on the clock of the force (without force
        readings, of the microphones); "measured" for those that its readings give, see
        `monochord.datasets.measured`. Left empty: recorded where there are any.
    thresholds
        For measured labels.
    force
        Whether to take a session that its alignment warns of, and to measure with readings whose status
        tells of a fault; without it, those count as missing.

    Raises
    ------
    InputError
        If the alignment warns of something, or the session lacks the labels or the streams that are needed
        for.
    """
    name = session.path.name
    if source not in ("", RECORDED, MEASURED):
        raise InputError(f"labels '{source}'", f"{RECORDED}, {MEASURED}")
    recorded = bool(session.labels.time.size) and source != MEASURED
    if source == RECORDED and not recorded:
        raise InputError(f"session {name} without labels", "recorded labels", "take --labels measured")
    missing = [stream for stream in (WRENCH, POSE) if stream not in session.streams]
    if not recorded and missing:
        given = f"session {name} without {' and '.join(missing)}, and without labels"
        raise InputError(given if source == "" else given.partition(",")[0], "wrench and pose, or labels")
    alignment = align(session)
    if alignment.flags and not force:
        first, *others = alignment.flags
        given = f"session {name}: {first}" + (f" (and {len(others)} more)" if others else "")
        raise InputError(given, "streams on one clock", "leave it out, or take --force")
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
    """Return the readings that are numbers, and whose status is 0 unless `faulty` ones are wanted too."""
    valid = np.isfinite(track.values).all(axis=1) & (faulty | (track.status == 0))
    arrays = ("time", "values", "sequence", "device_time", "status")
    return replace(track, **{name: getattr(track, name)[valid] for name in arrays})
