"""A recording on disk: audio, instruments, labels and events on one clock, in one MCAP file.

`SessionWriter` writes a session and `read_session` opens one; `check` says what is wrong with a file, and
`recover` mends one that was cut off or damaged.

Conventions. Tracks have times in s of the session's clock (`SessionClock`), which is zero about when the
recording begins; the file holds the times as they were measured, in ns. Sound is (channels, n) in full scale;
lost frames are zeros, and listed as gaps. Units are SI. A file may be cut off, damaged, or written by another
program: what is not intact is left out and reported, never corrected, and what is no session or exceeds the
limits is an `InputError`.

- `description`: what was recorded, and the clock; `tracks`: what is read; `codec`: the ROS 2 messages
- `writer`, `reader`: a session being recorded, and one on disk; `file`: a locked file, with room to end it
- `chunks`: walks a file's records, chunks and messages past damage; `_packing`: unpacks them, within limits
- `scan`: what of a file is intact; `repair`: mends the rest in place; `check`: the report, with checksums
- `alignment`: one clock for all streams; `sync`: when readings were taken, and taps that all streams contain
- `resample`: a copy at another sample rate; `exports`: other formats, and back; `facts`: what a file holds
- `bounds`: limits, checked before memory is allocated; `_layout`: the records around a session's messages
"""

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
