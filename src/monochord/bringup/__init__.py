"""Brings up a newly built sensor: one part after the other, each a number, passed, or what to change."""

from monochord.bringup.check import Check, Take
from monochord.bringup.examine import BringUp, examine, shown
from monochord.bringup.rehearsal import rehearse
from monochord.bringup.run import END, RECORD, SKIP, Guide, bring_up, from_recordings, write
from monochord.bringup.steps import STEPS, Step, steps
from monochord.bringup.takes import Live, Virtual, record, recordings

__all__ = [
    "END",
    "RECORD",
    "SKIP",
    "STEPS",
    "BringUp",
    "Check",
    "Guide",
    "Live",
    "Step",
    "Take",
    "Virtual",
    "bring_up",
    "examine",
    "from_recordings",
    "record",
    "recordings",
    "rehearse",
    "shown",
    "steps",
    "write",
]
