"""From source and instruments to a session.

`Settings` is what a person configures, `Job` what is built from it, `record` the loop and `Summary` what it
counted.
"""

from monochord.capture.recording.loop import record
from monochord.capture.recording.progress import Progress
from monochord.capture.recording.settings import About, DiskLimits, Job, Settings
from monochord.capture.recording.summary import FeedSummary, Summary
from monochord.capture.recording.watch import Notice

__all__ = ["About", "DiskLimits", "FeedSummary", "Job", "Notice", "Progress", "Settings", "Summary", "record"]
