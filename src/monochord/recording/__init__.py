"""From source and instruments to a session.

`Settings` is what a person configures, `Job` what is built from it, `record` the loop and `Summary` what it
counted.
"""

from monochord.recording.loop import record
from monochord.recording.progress import Progress
from monochord.recording.settings import About, DiskLimits, Job, Settings
from monochord.recording.summary import FeedSummary, Summary
from monochord.recording.watch import Notice

__all__ = ["About", "DiskLimits", "FeedSummary", "Job", "Notice", "Progress", "Settings", "Summary", "record"]
