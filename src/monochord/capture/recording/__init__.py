"""Records a source and instruments into a session.

`RecordingSettings` are the configuration, `RecordingJob` is built from them, `record` is the loop and
`RecordingSummary` its result.
"""

from monochord.capture.recording.counters import RecordingState
from monochord.capture.recording.loop import record
from monochord.capture.recording.settings import DiskLimits, RecordingJob, RecordingSettings, RecordingSubject
from monochord.capture.recording.summary import FeedSummary, RecordingSummary

__all__ = [
    "DiskLimits",
    "FeedSummary",
    "RecordingJob",
    "RecordingSettings",
    "RecordingState",
    "RecordingSubject",
    "RecordingSummary",
    "record",
]
