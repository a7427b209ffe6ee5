"""Guided touches of known position and force, recorded into a session from the page."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from monochord.core.dated import dated_path
from monochord.core.errors import MonochordError
from monochord.core.types import Signal
from monochord.core.units import Metres
from monochord.live.guides.steps import GuidedTouches, OnProgress
from monochord.live.labelled import LabelledRecording
from monochord.live.touch_guide import TouchGuide
from monochord.live.update import Update


class GuidedLabelling(GuidedTouches):
    """Record touches of known position and force; the labels so far are always on the disk.

    The session is ``touches_DATE.mcap`` in the folder; `described` are options of its `Description`.
    """

    def __init__(
        self, signal: Signal, folder: Path, length: Metres, count: int, described: Mapping[str, Any]
    ) -> None:
        self.guide = TouchGuide(signal, length, count)
        self._take = LabelledRecording(dated_path("touches", ".mcap", folder), self.guide, signal, described)
        self.recording = self._take.recording

    def take(self, update: Update) -> None:
        """Record an update, and show it to the guide."""
        self._take.take(update)

    def finish(self) -> bool:
        """End with the touches so far; return whether there are any."""
        self.guide.finish()
        return bool(self.guide.touches)

    def compute(self, check: OnProgress) -> None:  # noqa: ARG002  (once begun, it is completed)
        """Make the session."""
        self._take.finish()

    def save(self) -> list[str]:
        """Return the session's path and its use."""
        out = self._take.out
        use = f"use it with: monochord calibrate demo --sessions {out} --out mine"
        return [f"{len(self.guide.touches)} touches in {out}; {use}"]

    def close(self) -> None:
        """Complete the session; without a labelled touch nothing is kept.

        Where that fails, as on a full disk, sound and labels stay in their own files.
        """
        with suppress(MonochordError, OSError):
            self._take.finish()
