"""A recording on disk: audio, instruments, labels and events on one clock, in one MCAP file."""

from monochord.core.labels import LabelTrack
from monochord.sessions.check import CheckReport, check
from monochord.sessions.description import ESTIMATES, TUNING, Description, SessionClock
from monochord.sessions.reader import SessionReader, read_session
from monochord.sessions.repair import Recovery, recover
from monochord.sessions.tracks import AudioTrack, ClockTrack, Event, ReadingTrack
from monochord.sessions.writer import SessionWriter

__all__ = [
    "ESTIMATES",
    "TUNING",
    "AudioTrack",
    "CheckReport",
    "ClockTrack",
    "Description",
    "Event",
    "LabelTrack",
    "ReadingTrack",
    "Recovery",
    "SessionClock",
    "SessionReader",
    "SessionWriter",
    "check",
    "read_session",
    "recover",
]
